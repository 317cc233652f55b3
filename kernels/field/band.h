/// \file band.h
/// Which lattice nodes get a value: a canonical rule on the nodes nearest to the points.
///
/// Mark the node nearest to every point; close the marks by a cube of 5^3 nodes (gaps of up to four nodes
/// between samples fill up, a sheet grows no thicker); add two layers of nodes around: one leaves pinholes where the
/// normal runs along a diagonal of the lattice and chance leaves a gap of two cells. Measured against all
/// nodes of the cells within Chebyshev distance 1 and 2 of an occupied cell: see kernels/README.md, "Field".
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "kernels/field/point_leaves.h"

namespace tessera {

inline constexpr int kBandClosing = 2;  ///< nodes by which marks are dilated and eroded again
inline constexpr int kBandLayers = 2;   ///< layers of nodes added around the closed marks
/// How far from a node a point can put it into the band, in cells.
inline constexpr int kBandHalo = 2 * kBandClosing + kBandLayers + 1;

struct BandNodes {
  std::uint32_t leaf = 0;                    ///< index into the dense table
  std::array<std::uint64_t, 8> nodes{};      ///< bit x + 8 y of word z
  std::array<std::uint64_t, 8> requested{};  ///< what the filter said, where there is one
};

/// Nodes of a leaf (relative to the block, in leaves) that are to be evaluated.
using NodeFilter = std::function<std::array<std::uint64_t, 8>(const Int3& leaf)>;

/// Nodes of a leaf that lie within [-1, cells + 1] of the block.
[[nodiscard]] std::array<std::uint64_t, 8> nodes_in_block(const Int3& leaf, const Int3& cells);

/// Nodes of the band within [-1, cells + 1] of the block, by leaf in table order; leaves without any are left
/// out. \param wanted  no others: what it says of a leaf is kept; empty = all
[[nodiscard]] std::vector<BandNodes> choose_band(const PointLeaves& leaves, const NodeFilter& wanted = {});

}  // namespace tessera
