/// \file border_retreat.h
/// Vertices at a border go inwards, along the faces, so that what ends beside another sheet no longer pokes into it.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

struct BorderRetreat {
  std::vector<std::uint32_t> faces;  ///< of the block, at the vertices that move, ascending
  /// Theirs, in that order; vertices that move have the numbers from the block's own on.
  std::vector<std::array<std::uint32_t, 3>> corners;
  std::vector<Double3> position;    ///< of the vertices that move
  std::vector<std::uint32_t> rgba;  ///< theirs, or empty without colour
  bool turns = false;               ///< a face would turn over, or lose its area
};

/// Corners of some faces at which the surface ends, ascending. \pre the block has all faces at them
[[nodiscard]] std::vector<std::uint32_t> border_vertices(const MeshBlock& block,
                                                         std::span<const std::uint32_t> faces);

/// Each vertex goes this share of the way to the middle of the faces around it. \param vertices  ascending
[[nodiscard]] BorderRetreat pulled_in(const MeshBlock& block, std::span<const std::uint32_t> vertices,
                                      double share, bool float_positions);

}  // namespace tessera
