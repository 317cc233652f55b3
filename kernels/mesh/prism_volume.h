/// \file prism_volume.h
/// Volumes between surfaces seen from above: exact integrals over the prisms that two triangles, or a triangle and a level,
/// bound over what their shadows share. Source: Sutherland, Hodgman, "Reentrant Polygon Clipping", 1974.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Over the shadow that two surfaces share: its area, and the volumes where the first lies above and below the second.
struct CutFill {
  double area = 0.0;
  double fill = 0.0;  ///< first above second
  double cut = 0.0;   ///< first below second; not negative
  /// \param sign  1, or -1 where a face shows downwards or a piece counts negative
  void add(const CutFill& piece, double sign) {
    area += sign * piece.area, fill += sign * piece.fill, cut += sign * piece.cut;
  }
};

/// A triangle and its shadow.
class PlanTriangle {
 public:
  PlanTriangle(const Double3& a, const Double3& b, const Double3& c);
  /// 1 where it shows upwards, -1 downwards, 0 where it stands upright: then it has no shadow and bounds no prism.
  [[nodiscard]] int facing() const { return facing_; }
  [[nodiscard]] const std::array<Double2, 3>& shadow() const { return shadow_; }  ///< counter-clockwise
  /// Of its plane, held within the heights of its corners.
  double height(const Double2& at) const;
  [[nodiscard]] Double2 gradient() const {
    return {slope_x_, slope_y_};
  }  ///< rise of its plane along x and y

 private:
  std::array<Double2, 3> shadow_{};
  double low_ = 0.0, high_ = 0.0, z_ = 0.0, slope_x_ = 0.0, slope_y_ = 0.0;
  int facing_ = 0;
};

/// A convex piece of a plane by its corners, counter-clockwise.
class PlanPiece {
 public:
  explicit PlanPiece(const std::array<Double2, 3>& triangle);
  /// Keeps what lies in the triangle. At most twice. \param triangle  counter-clockwise
  void clip(const std::array<Double2, 3>& triangle);
  [[nodiscard]] bool empty() const { return size_ < 3; }
  double area() const;
  [[nodiscard]] CutFill between(const PlanTriangle& first, const PlanTriangle& second) const;
  [[nodiscard]] CutFill above(const PlanTriangle& first, double level) const;

 private:
  template <class Difference>
  CutFill integrate(Difference&& difference) const;
  /// Of a triangle, and every side of two others can cut off one corner and leave two.
  static constexpr std::size_t kMaxCorners = 9;
  std::array<Double2, kMaxCorners> corners_{};
  std::size_t size_ = 3;
};

/// A polygon with holes, or several, as a sum of triangles of either sign: whole numbers of them cover the inside once.
struct SignedTriangle {
  std::array<Double2, 3> corner{};  ///< counter-clockwise
  int sign = 1;
};

/// \param rings  open or closed, either way round; the first is the outline, the others are holes
/// \pre the outline does not cross itself, holes lie inside it and apart
[[nodiscard]] std::vector<SignedTriangle> triangles_of_rings(std::span<const std::vector<Double2>> rings);

}  // namespace tessera
