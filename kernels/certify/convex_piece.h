/// \file convex_piece.h
/// Convex pieces of a face, and where certificates cut them (certificate.h): at the sides of a triangle of the other
/// surface, seen along the normal of the face, or at the bisector of two of them. Any cut is right.
#pragma once
#include <array>
#include <cstdint>

#include "kernels/mesh/closest_face.h"
#include "octree/lattice.h"
#include "octree/vector.h"

namespace tessera {

inline constexpr int kMaxCorners = 16;
inline constexpr int kPieceColumn = 20;  ///< corners, the centroid, padding to whole vectors

/// A convex polygon in columns; two corners make a segment.
struct ConvexPiece {
  alignas(32) double x[kPieceColumn], y[kPieceColumn], z[kPieceColumn];
  int corners = 0;
  int cuts = 0;
  std::uint32_t hint = ClosestFaces::kNone;  ///< slot of a triangle that may be near

  [[nodiscard]] Double3 at(int i) const { return {x[i], y[i], z[i]}; }
  [[nodiscard]] Double3 centroid() const { return at(corners); }
  void add(const Double3& p) {
    x[corners] = p[0], y[corners] = p[1], z[corners] = p[2];
    ++corners;
  }
  /// Puts the centroid behind the corners and repeats it up to a whole vector.
  void close();
};

/// Points x with normal . x <= offset are inside.
struct CutPlane {
  Double3 normal{};  ///< unit
  double offset = 0.0;
  double height(const Double3& p) const { return dot(normal, p) - offset; }
};

/// Cuts in two; false when one side would be empty (then nothing is said about `inside` and `outside`).
/// \pre at most kMaxCorners - 2 corners
bool cut(const ConvexPiece& piece, const CutPlane& plane, ConvexPiece& inside, ConvexPiece& outside);

/// The side of a triangle, seen along `normal`, that `far` lies beyond most; for a segment the
/// plane across its end. False when none separates `far` from `centre`.
bool side_plane(const std::array<Double3, 3>& triangle, const Double3& normal, const Double3& centre,
                const Double3& far, CutPlane& plane);

/// Where the planes of two triangles are equally far, if that parts the point near each well. \param p1, p2  those points
bool bisector(const std::array<Double3, 3>& t1, const Double3& p1, const std::array<Double3, 3>& t2,
              const Double3& p2, CutPlane& plane);

}  // namespace tessera
