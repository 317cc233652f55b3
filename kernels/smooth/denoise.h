/// \file denoise.h
/// Denoising by local fits: smooth surfaces keep their curvature, creases and corners come out sharp.
///
///   normals   filtered bilaterally (normal_filter.h): they tell the smooth sides at a vertex (star_sides.h)
///   untangle  faces that noise turned over against their filtered normal are spread out along the surface
///   noise     its standard deviation around every vertex, from how much fits in two windows differ
///   fit       per side a quadric to the given positions, in a window that spreads over faces of like normals
///             and grows as far as the noise asks for (window_fit.h); wide ones at centres, one vertex in twelve, serve
///             the vertices around them too
///   move      the vertex goes to the nearest point on its side, on the intersection of its sides at creases
///             and corners
///
/// After the moving least squares of Fleishman, Cohen-Or, Silva 2005 and Oeztireli, Guennebaud, Gross 2009, with
/// the feature vertices of Kobbelt, Botsch, Schwanecke, Seidel 2001 (intersection of tangent elements).
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/face_corners.h"
#include "kernels/mesh/mesh_block.h"
#include "kernels/smooth/normal_filter.h"

namespace tessera {

struct DenoiseOptions {
  NormalFilterOptions normals;  ///< its vertex_rounds are not used
  double noise = 0.0;           ///< standard deviation along the normal, scan units; 0 = measured
};

/// Rings that it reads around a vertex.
[[nodiscard]] int denoise_rings(const DenoiseOptions& options);
/// Mean edges that mostly hold all that decides where a vertex goes: windows end by distance, and mostly early.
double denoise_edges(const DenoiseOptions& options);

struct DenoisedBlock {
  std::vector<Double3> position;  ///< n; of the wanted vertices, the others stay
  /// n; 1: nothing that it hangs on is beyond the block. Of the wanted vertices; always where denoise_rings() whole rings
  /// are in the block, mostly with half as many.
  std::vector<std::uint8_t> right;
};

/// A vertex whose sides have too few samples for a fit stays.
/// \param corners  the block's own
/// \param whole   n flags, 1: all faces at the vertex are in the block
/// \param wanted  n flags, 1 or 0
/// \pre the block is canonical, fewer than 2^30 faces, positions finite
/// \cost denoise_bytes()
[[nodiscard]] DenoisedBlock denoise(const MeshBlock& block, const FaceCorners& corners,
                                    const DenoiseOptions& options, std::span<const std::uint8_t> whole,
                                    std::span<const std::uint8_t> wanted);

/// Bytes that denoise() allocates, the result included, the corners not.
[[nodiscard]] std::uint64_t denoise_bytes(std::uint64_t vertices, std::uint64_t faces);

}  // namespace tessera
