/// \file fill_ordering.h
/// Orders of elimination that leave a Cholesky factor sparse, by the pattern of the matrix alone: whole numbers, the same on
/// every machine. Sources: Amestoy, Davis, Duff, "An Approximate Minimum Degree Ordering Algorithm", 1996; Karypis, Kumar, "A
/// Fast and High Quality Multilevel Scheme for Partitioning Irregular Graphs", 1998.
#pragma once
#include <cstdint>
#include <vector>

#include "solvers/linear_solver.h"

namespace tessera {

/// \param ordering  kMinimumDegree: by AMD; kNestedDissection: by METIS \pre symmetric pattern
/// \returns the unknowns in the order of elimination
/// \throws ResourceError  out of memory or of 32-bit indices
[[nodiscard]] std::vector<std::int32_t> fill_ordering(const SparseMatrix& a, Ordering ordering);

}  // namespace tessera
