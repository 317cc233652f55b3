/// \file rcm_ordering.h
/// Reverse Cuthill-McKee ordering from pseudo-peripheral vertices. Source: George and Liu 1981, chapter 4.
#pragma once
#include <cstdint>
#include <vector>

#include "solvers/sparse_matrix.h"

namespace tessera {

/// \return order[k] = the row that comes k-th. \pre symmetric pattern
[[nodiscard]] std::vector<std::int32_t> reverse_cuthill_mckee(const SparseMatrix& a);

}  // namespace tessera
