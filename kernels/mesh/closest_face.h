/// \file closest_face.h
/// Which of many triangles is closest to a point, exactly, in double precision, four triangles at a time.
///
/// A hierarchy of boxes, eight children to a node, over triangles halved at the median of their centroids; after
/// Wald et al., "Getting Rid of Packets", 2008 (wide nodes, one query at a time). A triangle may be
/// degenerate: (a, b, b) is a segment, so border curves are served by the same code. Boxes around long needles
/// across the axes are all but empty and hide nothing from each other: needles stand in a hierarchy of their own, of
/// hulls of two balls in double precision, in Morton order of both their ends.
///
/// Rounding. Coordinates are relative to an origin near the block, R is the largest of them, u = 2^-53. The
/// closest point is formed with parameters clamped to the triangle, so it lies on it but for rounding: the
/// distance returned is never below the true one by more than closest_face_error(R) = 32 u R, however thin
/// the triangle is. Boxes are single precision, widened by 2^-21 R, and only skip triangles that cannot be
/// closer.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// By how much a distance of ClosestFaces may be too small; R as above.
[[nodiscard]] constexpr double closest_face_error(double largest_coordinate) {
  return 0x1p-48 * largest_coordinate;
}

class ClosestFaces {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;
  static constexpr int kLanes = 4;

  struct Hit {
    double square = 0.0;         ///< of the distance
    std::uint32_t slot = kNone;  ///< where the triangle is stored; kNone: nothing closer than the limit
  };

  ClosestFaces() = default;
  /// \param position  n, world; \param faces m, indices below n; \param origin subtracted from all positions
  ClosestFaces(std::span<const Double3> position, std::span<const std::array<std::uint32_t, 3>> faces,
               const Double3& origin);

  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] const Double3& origin() const { return origin_; }
  double largest_coordinate() const { return largest_; }
  /// Bytes per triangle, for those who plan memory; holds for more than 64 triangles.
  [[nodiscard]] static constexpr std::uint64_t bytes_per_face() { return 15 * 8 + 4 + 12 + 16; }

  /// The closest triangle to `p` (relative to origin) nearer than sqrt(limit_square). `hint` is a slot to
  /// start with, or kNone. Of several at the same distance the one of the lowest face.
  [[nodiscard]] Hit closest(const Double3& p, double limit_square, std::uint32_t hint) const;

  /// Squared distance of one point to one triangle.
  double square_to(std::uint32_t slot, const Double3& p) const;
  /// The same for `count` points given as columns x, y, z, padded to a multiple of four.
  void squares_to(std::uint32_t slot, const double* x, const double* y, const double* z, int count,
                  double* square) const;

  [[nodiscard]] std::uint32_t face(std::uint32_t slot) const {
    return face_[slot];
  }  ///< index in the span given
  /// Corners relative to origin, in cyclic order.
  [[nodiscard]] std::array<Double3, 3> corners(std::uint32_t slot) const;

 private:
  /// Four triangles as columns: a, u = b - a the longest side, c - a = k u + v with v orthogonal to u: feet
  /// on slivers stay as exact as numbers allow. Reciprocals of squared lengths of u, v, c - a and c - b; 0
  /// where degenerate.
  struct alignas(32) Leaf {
    double a[3][kLanes], u[3][kLanes], v[3][kLanes];
    double uu[kLanes], k[kLanes], per_uu[kLanes], per_vv[kLanes], per_ac[kLanes], per_bc[kLanes];
  };
  struct alignas(32) Node {
    float low[3][8], high[3][8];
  };

  /// Hulls of two balls around eight children: a segment, the radius at its start, by how much it grows, the larger one.
  struct alignas(32) NeedleNode {
    double from[3][8], along[3][8], per_square[8], radius[8], growth[8], maximum[8], slope[8];
  };

  void store(std::size_t slot, const std::array<Double3, 3>& corner);
  void build_nodes();
  void bound_needles(std::size_t first, std::size_t end, NeedleNode& node, std::size_t lane) const;
  void build_needle_nodes();
  static void needle_squares(const NeedleNode& node, const Double3& p, float* square);

  Double3 origin_{};
  double largest_ = 0.0;
  std::size_t count_ = 0;
  std::vector<Leaf> leaves_;
  std::vector<std::uint32_t> face_;
  std::size_t plain_leaves_ = 0;           ///< the leaves after them hold needles alone
  std::vector<std::vector<Node>> levels_;  ///< levels_[0] over plain leaves; the last has one node
  std::vector<std::vector<NeedleNode>> needle_levels_;  ///< over the others; may be empty
};

}  // namespace tessera
