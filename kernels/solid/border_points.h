/// \file border_points.h
/// What edges of a border that lie far from a cube make of the winding numbers in it.
///
/// Ribbons (border_winding.h) that pass far from the cube make a harmonic function without poles near it: it is summed at 4^3
/// Chebyshev points, edge by edge or by clusters, and interpolated (Fong, Darve, "The black-box fast multipole method", 2009).
/// Of edges far behind the cube, whose ribbons pass near it, those to the other side are smooth in it.
#pragma once
#include <array>
#include <cstdint>

#include "kernels/solid/border_winding.h"
#include "octree/lanes.h"

namespace tessera {

/// Sums of solid angles at the points of a cube: of a leaf's nodes, or so many times as wide.
class BorderPoints {
 public:
  static constexpr std::size_t kPoints = 4;
  /// Of a leaf, quanta from its corner.
  static constexpr std::array<std::int64_t, kPoints> kNodes = {1091, 8850, 19822, 27581};
  using Weights = std::array<double, kPoints>;
  enum class Side { kAhead, kBehind };  ///< ribbons run to +x infinity, to -x infinity

  /// \param corner  node of the cube with the least coordinates  \param scale  1: a leaf, whose nodes span 7 cells
  BorderPoints(const Int3& corner, int scale) : corner_(corner), scale_(scale) {}

  /// Whether a cluster's ribbons are so far that its moments stand for its edges, to the accuracy of the interpolation.
  [[nodiscard]] bool is_far(const BorderCluster& cluster, Side side = Side::kAhead) const;
  /// Whether what begins `near` cells from the middle of the cube, by distance(), is smooth in it.
  [[nodiscard]] bool is_smooth(double near) const { return near >= kSmooth * scale_; }
  /// Distance of the cube's own points from `away`, which counts from its middle.
  [[nodiscard]] double free(double away) const { return away - kHalfDiagonal * scale_; }
  [[nodiscard]] Double3 middle() const {
    const double half = 3.5 * scale_;
    return {corner_[0] + half, corner_[1] + half, corner_[2] + half};
  }

  void add_cluster(const BorderCluster& cluster, Side side = Side::kAhead);
  /// By Gauss's rule of two points. \param middle  of the edge
  void add_edge(const Double3& middle, const Double3& edge, double count, Side side = Side::kAhead);
  void add(std::size_t row, std::size_t point, double angle) { sum_[kPoints * row + point] += angle; }
  /// What another cube, which holds this one, has at these points.
  void add_from(const BorderPoints& wider);

  /// Lagrange's polynomials of the points at a node. \param cells  from the corner, in leaves' cells: over `scale`
  [[nodiscard]] static Weights weights(double cells);
  /// Interpolated.
  [[nodiscard]] double at(const Int3& node) const;
  /// Along x, interpolated over y and z.
  [[nodiscard]] Weights line(const Weights& y, const Weights& z) const;

  /// Distance of a place from the ray from `r` to infinity.
  [[nodiscard]] static double distance(const Double3& r, Side side);

 private:
  static constexpr double kHalfDiagonal = 6.07;  ///< of the leaf's nodes, cells
  static constexpr double kSmooth = 18.0;        ///< cells
  static constexpr double kFar = 0.2;            ///< radius over distance from which moments stand for edges

  double place(std::size_t point) const {
    return scale_ * (static_cast<double>(kNodes[point]) / static_cast<double>(kSolidQuanta));
  }
  double row_y(std::size_t row) const { return corner_[1] + place(row % kPoints); }
  double row_z(std::size_t row) const { return corner_[2] + place(row / kPoints); }
  /// x seen from the points of a row.
  Double4 points_from(double x) const;

  Int3 corner_;
  double scale_;
  std::array<double, kPoints * kPoints * kPoints> sum_{};
};

}  // namespace tessera
