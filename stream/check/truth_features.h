/// \file truth_features.h
/// Parts of the comparison with the truth: an index of points, sharp edges of a mesh, coverage.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "octree/portable_math.h"

namespace tessera {

/// Squared distance from p to the triangle abc.
double squared_distance(const Double3& p, const Double3& a, const Double3& b, const Double3& c);

/// Points in cells of a grid, each with the squared distance to what has come near it so far.
class NearestTracker {
 public:
  /// \param max_distance  distances beyond it are not told apart
  NearestTracker(std::vector<Double3> points, double max_distance);
  /// Takes a triangle (or, with equal corners, a segment or a point) into account.
  void take(const Double3& a, const Double3& b, const Double3& c);
  std::span<const Double3> points() const { return points_; }
  /// Distance of point i to the nearest taken, at most `max_distance`.
  double distance(std::size_t i) const;

 private:
  std::uint64_t key(std::int64_t i, std::int64_t j, std::int64_t k) const;

  std::vector<Double3> points_;      ///< by cell
  std::vector<std::uint64_t> keys_;  ///< of points_, ascending
  std::vector<double> squared_;
  Double3 lo_{}, hi_{};
  double cell_ = 1.0, max_distance_ = 0.0;
};

/// Edges where two faces of a mesh meet at more than an angle.
class SharpEdges {
 public:
  /// \param min_cosine  of the angle between normals
  explicit SharpEdges(double min_cosine) : min_cosine_(min_cosine) {}
  /// \param normal  unit
  void add(const std::uint64_t (&corners)[3], const Double3& normal);
  struct Edge {
    std::uint64_t a, b;
  };
  /// Pairs what was added. Edges with more or fewer than two faces are no creases and are left out.
  std::vector<Edge> find();

 private:
  struct Side {
    std::uint64_t a, b;
    float n[3];
  };
  double min_cosine_;
  std::vector<Side> sides_;
};

}  // namespace tessera
