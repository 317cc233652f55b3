/// \file supernodes.h
/// What eliminating the unknowns of a symmetric matrix in some order leads to: the tree of elimination, how many entries each
/// column of the factor gets, and which columns are worked on as one. By the pattern alone, in whole numbers.
/// Sources: Liu, "The Role of Elimination Trees in Sparse Factorization", 1990; Gilbert, Ng, Peyton, "An Efficient Algorithm to
/// Compute Row and Column Counts for Sparse Cholesky Factorization", 1994; Ashcraft, Grimes, "The Influence of Relaxed Supernode
/// Partitions on the Multifrontal Method", 1989.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "solvers/sparse_matrix.h"

namespace tessera {

/// Of each column the next one that it changes (-1: none), and the entries that it gets, the diagonal included.
struct EliminationTree {
  std::vector<std::int32_t> parent;
  std::vector<std::int32_t> count;
};

/// \param order  of elimination: unknowns \pre symmetric pattern
[[nodiscard]] EliminationTree elimination_tree(const SparseMatrix& a, std::span<const std::int32_t> order);

/// Children before parents, each subtree without a gap, the child with the longest column last: the same factor, and a stack of
/// what waits that stays low. Renames the columns of the tree, and returns the new order of unknowns.
std::vector<std::int32_t> postorder(EliminationTree& tree, std::span<const std::int32_t> order);

/// Columns [first[k], first[k + 1]) are worked on as one, with the rows [start[k], start[k + 1]) of `rows`, ascending, these
/// columns first. Zeros are taken in where that makes many small ones into one.
struct Supernodes {
  std::vector<std::int32_t> first;
  std::vector<std::size_t> start;
  std::vector<std::int32_t> rows;
};

/// \pre `order` and `tree` come from postorder()
[[nodiscard]] Supernodes find_supernodes(const SparseMatrix& a, std::span<const std::int32_t> order,
                                         const EliminationTree& tree);

}  // namespace tessera
