/// \file nearest_points.h
/// The nearest neighbours of a point, and what they tell: how far apart points lie, and whether one lies on a local surface
/// beyond doubt, so that a mesh of the scan has to come by. Lengths are in the unit of the points.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Points in cubes for searches. Holds the spans, which must outlive it, and 4 bytes a point, 1 MiB at most besides.
class NearestPoints {
 public:
  struct Neighbour {
    double square = 0.0;  ///< of the distance
    std::uint32_t point = 0;
  };

  /// \param x, y, z  finite, of one length below 2^32  \param edge  of the cubes, > 0; larger ones where it would take too many
  NearestPoints(std::span<const float> x, std::span<const float> y, std::span<const float> z, double edge);

  /// The nearest `count` points to p, itself among them, that lie within `limit`: ascending, of equally far ones the first
  /// given first. Fewer where there are not as many. \param out  scratch too
  void find(const Float3& p, std::size_t count, double limit, std::vector<Neighbour>& out) const;

 private:
  Int3 cube(const Float3& p) const;

  std::span<const float> x_, y_, z_;
  Float3 low_{};
  double edge_ = 1.0;
  float per_edge_ = 1.0f;
  Int3 cubes_ = {1, 1, 1};
  std::vector<std::uint32_t> start_,
      point_;  ///< points of cube c: point_[start_[c]] to point_[start_[c + 1]]
};

/// Nearest points, the point itself among them, that confirmed() looks at.
inline constexpr std::size_t kConfirmingPoints = 13;
/// Neighbour by which spacing is told.
inline constexpr int kSpacingNeighbour = 6;
/// The farthest of them may lie so far away, spacings.
inline constexpr double kConfirmingReach = 4.0;

/// Distance of samples of a surface by that of a neighbour: on a square grid the first four lie one spacing away, the next
/// four across a square. \param square  of that distance  \param neighbour  from 1 to 8
double spacing_by_neighbour(double square, int neighbour);

/// Whether a point lies on a surface beyond doubt: its twelve neighbours lie within kConfirmingReach spacings, around it, not
/// in a line, and within half a spacing of their plane of least squares, of which they are a flat share.
/// \param at  its kConfirmingPoints nearest points, ascending distance \param spacing  > 0
[[nodiscard]] bool confirmed(const Float3& p, std::span<const Float3, kConfirmingPoints> at, double spacing);

}  // namespace tessera
