/// \file normal_filter.h
/// Denoising that keeps creases: face normals are averaged bilaterally, then vertices follow the normals.
/// Sources: Zheng, Fu, Au, Tai 2011 (local iterative scheme); Sun, Rosin, Martin, Langbein 2007 (vertex
/// update).
///
/// A fixed number of rounds of each, so a vertex depends on filter_rings() rings alone. The range of angles that
/// mix starts at one and a half times the option and is drawn in over the first half of the rounds; faces whose
/// normal is then like hardly any around (noise turned them over) take that of a neighbour. Two
/// choices make it local: the spatial width is the mean distance to a face's own neighbours (not a mean over
/// the mesh), and the Gaussian is the polynomial (1 - t/16)^16 with compact support.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/face_corners.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

struct NormalFilterOptions {
  int normal_rounds = 8;
  int vertex_rounds = 10;
  double range_angle_deg = 20.0;  ///< normals that differ by much more do not mix: the standard deviation
};

/// Faces at a vertex up to which they are neighbours of each other: more than scans and remeshed surfaces ever have.
inline constexpr std::size_t kMaxStar = 128;

/// Rings that filter_normals() reads around a face's vertices.
[[nodiscard]] int normal_rings(const NormalFilterOptions& options);
/// Rings that filter_by_normals() reads around a vertex.
[[nodiscard]] int filter_rings(const NormalFilterOptions& options);

/// Filtered unit normals of all faces; zero for faces without an area.
/// \param corners  the block's own
/// \param wanted   m flags, 1 for the faces whose normals are asked for: others may stay as they are; empty: all
[[nodiscard]] std::vector<Float3> filter_normals(const MeshBlock& block, const FaceCorners& corners,
                                                 const NormalFilterOptions& options,
                                                 std::span<const std::uint8_t> wanted = {});

/// Bytes that filter_normals() allocates, the result included.
[[nodiscard]] std::uint64_t normal_bytes(std::uint64_t faces);

/// New positions of all vertices. Right where filter_rings() whole rings are in the block (complete_rings()).
/// \pre the block is canonical, fewer than 2^30 faces, positions finite
/// \cost normal_bytes() for its normals, then 48 bytes a vertex and 12 bytes a face
[[nodiscard]] std::vector<Double3> filter_by_normals(const MeshBlock& block, const FaceCorners& corners,
                                                     const NormalFilterOptions& options);

}  // namespace tessera
