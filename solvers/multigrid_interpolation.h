/// \file multigrid_interpolation.h
/// Interpolation from the seeds of clusters to all unknowns, for the levels of multigrid.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"
#include "solvers/sparse_matrix.h"

namespace tessera {

/// Neighbours of each node, without itself, ascending: those of i are to[start[i]] .. to[start[i + 1]].
struct NodeGraph {
  std::vector<std::int32_t> start, to;
};

/// A partition of the unknowns; each cluster is named by one of its members.
struct Clusters {
  std::vector<std::int32_t> of;    ///< cluster of each unknown
  std::vector<std::int32_t> seed;  ///< unknown of each cluster
};

/// The cluster's own value everywhere.
[[nodiscard]] SparseMatrix constant_interpolation(const Clusters& clusters);

/// Barycentric weights of the closest point in a triangle of mutually touching seeds, one of them the own
/// one; exact for linear functions on a flat mesh, about 2.7 entries a row. Source: Wiersma, Nasikun,
/// Eisemann, Hildebrandt 2023.
/// \param touching  graph of the clusters
/// \param fine  position of each unknown
/// \param coarse  of each seed
[[nodiscard]] SparseMatrix linear_interpolation(const Clusters& clusters, const NodeGraph& touching,
                                                std::span<const Double3> fine,
                                                std::span<const Double3> coarse);

/// Moving least squares with linear functions over the seeds within two steps (Lancaster and Salkauskas
/// 1981): the shape functions have continuous derivatives, as the energy of a plate wants them. Hats have
/// kinks, whose bending energy grows by the coarsening ratio with every level. About 13 entries a row.
/// \param[out] checked_out  rows that were checked and taken from linear_interpolation instead: too few seeds, or they
///             miss the unknown's own position, or weights that would amplify errors
SparseMatrix smooth_interpolation(const Clusters& clusters, const NodeGraph& touching,
                                  std::span<const Double3> fine, std::span<const Double3> coarse,
                                  std::size_t& checked_out);

}  // namespace tessera
