/// \file fair_positions.h
/// A surface without the waves of its triangles, to take second derivatives of: what an edit of order 3 asks of the surface
/// beside its support. Source: Desbrun, Meyer, Schroeder, Barr 1999 (implicit fairing), of order 2.
#pragma once
#include <vector>

#include "solvers/factor_store.h"
#include "solvers/laplacian.h"

namespace tessera {

/// Waves of `length` keep a 250th of their height, those four times as long a half. Edges that have not two faces stay.
/// \param operators  of the surface \param length  > 0 \param store  where the factor lies; empty. Null: in memory
/// \return n positions \throws InputError  there is no solution
[[nodiscard]] std::vector<Double3> fair_positions(const TriangleSpan& surface, const Laplacian& operators,
                                                  double length, FactorStore* store);

}  // namespace tessera
