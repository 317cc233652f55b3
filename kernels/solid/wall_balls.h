/// \file wall_balls.h
/// How thick a wall is behind a place on its surface: the largest ball that touches it there from inside and holds nothing of
/// the faces on the other side of the wall. That is the medial ball of Ma, Bae, Choi, "3D medial axis point approximation using
/// nearest neighbors and the normal field", 2012, but found face by face in closed form instead of by shrinking steps from
/// point to point: the smallest over all faces, so faces may come in any parts and any order, with the same result.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// Faces are on the other side of a wall where their outward normals are at least so far from that of the place, as a cosine:
/// 135 degrees. So a wedge of less than 45 degrees is a wall that runs out.
inline constexpr double kWallCosine = 0.7071067811865476;

struct WallSample {
  Double3 position{};
  Double3 inward{};  ///< unit
  double radius = std::numeric_limits<double>::infinity();
};

/// Radius of the ball on `s.inward` that passes through `s.position` and is touched by the triangle, infinite where the
/// triangle is not on the other side of a wall. \param corner  counter-clockwise from outside
double wall_ball_radius(const WallSample& s, const std::array<Double3, 3>& corner);

/// Some of the faces of a mesh, ordered for such questions.
class WallFaces {
 public:
  /// \param faces  corners, finite, counter-clockwise from outside; at least one
  explicit WallFaces(std::vector<std::array<Double3, 3>> faces);

  /// Lets the radius of a sample be no larger than these faces allow: the smallest of wall_ball_radius(), to the bit.
  void shrink(WallSample& s) const;

  /// While the faces are ordered, for many of them.
  [[nodiscard]] static constexpr std::uint64_t bytes_per_face() { return 2 * 72 + 16 + 24; }

 private:
  static constexpr std::size_t kLeaf = 4, kChildren = 8;
  struct Box {
    Double3 low, high;                     ///< of corners
    Float3 lowest_normal, highest_normal;  ///< of unit normals, coordinate by coordinate
  };
  void bound_normals();

  std::vector<std::array<Double3, 3>> faces_;
  std::vector<std::vector<Box>> levels_;  ///< box_levels() over kLeaf faces each
};

}  // namespace tessera
