/// \file signed_distance.h
/// Signed Euclidean distance to a piece of a triangle mesh: the closest face, and the side of it by pseudo-normals.
///
/// Source: Bærentzen, Aanæs, "Signed Distance Computation Using the Angle Weighted Pseudonormal", 2005: where the closest
/// point is a vertex or lies on an edge, the sum of the normals there, each weighted by its angle (on an edge both are pi),
/// tells the side, for any closed mesh without self-intersections. An open mesh has sides near its faces alone.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

class SignedDistance {
 public:
  static constexpr std::uint32_t kNone = ClosestFaces::kNone;

  /// \param block  edges with one face are a border where its flag says so, else the end of what was loaded
  /// \param origin  subtracted from all positions
  SignedDistance(const MeshBlock& block, const Double3& origin);

  struct Foot {
    std::uint32_t face = kNone;  ///< of the block; kNone: nothing nearer than the limit
    std::uint32_t slot = kNone;  ///< hint for a point nearby
    Double3 at{};                ///< relative to the origin
    double square = 0.0;         ///< of the distance
    Double3 side{};              ///< pseudo-normal: outside is where it points; not unit
    bool border = false;         ///< the foot lies on an edge or vertex where the surface ends
  };
  /// The foot of a point (relative to the origin) nearer than the root of `limit_square`.
  [[nodiscard]] Foot closest(const Double3& p, double limit_square, std::uint32_t hint = kNone) const;
  /// Distance, < 0 inside. \pre the foot is one of p
  [[nodiscard]] static double signed_distance(const Double3& p, const Foot& foot);

  /// Vertex of the block nearest to a foot, among those of its face.
  [[nodiscard]] std::uint32_t nearest_corner(const Foot& foot) const;

  [[nodiscard]] bool empty() const { return faces_.empty(); }
  [[nodiscard]] const Double3& origin() const { return faces_.origin(); }
  [[nodiscard]] const Double3& face_normal(std::uint32_t face) const {
    return normal_[face];
  }  ///< unit, or zero
  /// Angle-weighted, not unit. Whole for vertices of which all faces are in the block.
  [[nodiscard]] const Double3& vertex_normal(std::uint32_t vertex) const { return vertex_normal_[vertex]; }

  /// Upper bound of what it holds and takes while it is made, with what the block has of it left out.
  [[nodiscard]] static constexpr std::uint64_t bytes(std::uint64_t vertices, std::uint64_t faces) {
    return faces * (ClosestFaces::bytes_per_face() + 24 + 12 + 12 + 72) + vertices * 49;
  }

 private:
  void join_edges(const MeshBlock& block);

  ClosestFaces faces_;
  std::vector<std::array<std::uint32_t, 3>> corner_;  ///< per face
  std::vector<std::array<std::uint32_t, 3>> beyond_;  ///< per face and edge: the face across it, kNone: none
  std::vector<std::uint8_t> border_edge_;             ///< per face: bit k, the surface ends at edge k
  std::vector<Double3> position_;                     ///< relative to the origin
  std::vector<Double3> normal_;                       ///< per face
  std::vector<Double3> vertex_normal_;
  std::vector<std::uint8_t> border_vertex_;
};

}  // namespace tessera
