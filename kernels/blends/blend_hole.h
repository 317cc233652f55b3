/// \file blend_hole.h
/// The hole that faces under a blend's grid leave, and whether what fills it is a manifold.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/blends/rib_profile.h"
#include "kernels/mesh/face_corners.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// Whether a triangle meets the rectangle [left, width] x [-height, height]: no axis separates them.
[[nodiscard]] bool meets_rectangle(const std::array<Double2, 3>& t, double left, double width, double height);

inline constexpr std::uint32_t kNoFaceAcross = 0xffffffffu;
/// The face on the other side of edge k of face f, or kNoFaceAcross.
[[nodiscard]] std::uint32_t face_across(const MeshBlock& block, const FaceCorners& corners, std::size_t f,
                                        std::size_t k);

/// Of the removed faces (per face of the block, 0: stays) the largest piece that hangs together; faces that it surrounds go
/// with it.
void keep_largest_piece(const MeshBlock& block, const FaceCorners& corners,
                        std::vector<std::uint8_t>& removed);

/// Where faces are no manifold: vertices at edges without their other side, or with two of one, and those whose faces do
/// not hang together; empty: nowhere.
/// \param open      per face: bits of edges that need no other side
/// \param vertices  above all corners
[[nodiscard]] std::vector<std::uint32_t> loose_vertices(std::span<const std::array<std::uint32_t, 3>> faces,
                                                        std::span<const std::uint8_t> open,
                                                        std::size_t vertices);

}  // namespace tessera
