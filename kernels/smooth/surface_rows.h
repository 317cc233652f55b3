/// \file surface_rows.h
/// The discrete Laplacian of a mesh block as one row per vertex, decided from the vertex's own star alone, so
/// that a row has the same bits in every block that holds the star.
///
/// Row v means  (A x)_v = x_v - inverse_degree_v * sum_u weight_vu x_u.  A = D^-1 (D - W) is similar to the
/// symmetric D^-1/2 (D - W) D^-1/2, so its spectrum lies in [0, 2] for any weights >= 0 (the a-priori bound
/// of the filters), and it maps constants to zero.
///   free    bivariate: all neighbours, cotangent weights clamped >= 0 (Pinkall and Polthier 1993), or 1
///   line    univariate: the two neighbours along the crease or border, weights 1 / length
///           A line that fades out ends at a free vertex; filters must take it as held, or line and surface would
///           depend on each other both ways and the spectrum would no longer be real.
///   fixed   corners, junctions of lines, non-manifold and unused vertices: the row is empty
///   open    the block does not hold the whole star: the row is empty, the vertex belongs to another block
/// A free vertex beside a crease sees the crease, a crease vertex does not see the faces: smoothing never
/// crosses it.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/mesh/face_corners.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

enum class LaplaceWeights : std::uint8_t { kCotangent, kUniform };
enum class VertexRole : std::uint8_t { kFree, kLine, kFixed, kOpen };

struct SurfaceRowOptions {
  LaplaceWeights weights = LaplaceWeights::kCotangent;
  /// Edges whose faces open more are creases; 0 = no creases (borders stay lines).
  double feature_angle_deg = 0.0;
};

struct SurfaceRows {
  std::vector<std::uint32_t> first;      ///< n + 1, into neighbour and weight
  std::vector<std::uint32_t> neighbour;  ///< in the order in which the ascending faces of the star name them
  std::vector<float> weight;             ///< >= 0; symmetric between two free vertices
  std::vector<float> inverse_degree;     ///< n; 1 / sum of the row's weights, 0 for an empty row
  std::vector<VertexRole> role;          ///< n
  std::uint64_t degenerate_faces = 0;    ///< without an area: their angles count as right angles
};

/// \pre  the block is canonical (mesh_block.h), fewer than 2^30 faces; the corners are its own
/// \throws InputError for a position that is not finite, naming the vertex
/// \cost 60 bytes of scratch a vertex beside the result
[[nodiscard]] SurfaceRows make_surface_rows(const MeshBlock& block, const FaceCorners& corners,
                                            const SurfaceRowOptions& options);

/// 1 for every vertex with `rings` whole rings around it: what a rule that reads one ring a round may have
/// computed right after `rings` rounds. Vertices within that many edges of an open vertex get 0.
[[nodiscard]] std::vector<std::uint8_t> complete_rings(const MeshBlock& block, const FaceCorners& corners,
                                                       const SurfaceRows& rows, int rings);

/// Clears the flags of all vertices within so many rings of faces around a vertex whose flag is 0.
void erode(const MeshBlock& block, const FaceCorners& corners, int rings, std::vector<std::uint8_t>& flags);

}  // namespace tessera
