/// \file ribbon_angles.h
/// Solid angles of ribbons from border edges to infinity in direction +x, summed up as products of complex numbers
/// (van Oosterom, Strackee, "The Solid Angle of a Plane Triangle", 1983): one at a time, or seen from a row of nodes at once.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>

#include "kernels/solid/border_winding.h"
#include "octree/lanes.h"

namespace tessera {

inline constexpr double kCellsPerQuantum = 1.0 / static_cast<double>(kSolidQuanta);

/// A sum of angles as a product of complex numbers, and how often it went round.
class AngleSum {
 public:
  /// An angle within (-pi, pi), its imaginary part not zero: two of pi exactly would go round unseen.
  void add(double re, double im);
  double value() const;

 private:
  double re_ = 1.0, im_ = 0.0;
  int windings_ = 0;
};

/// The same of several angles side by side, four to a vector. \tparam kVectors  vectors of four
template <std::size_t kVectors>
class AngleSums {
 public:
  using Vectors = std::array<Double4, kVectors>;
  AngleSums();
  /// Adds an angle to each, so many times. \param up  per lane, whether its imaginary part is above zero
  [[gnu::always_inline]] void add(const Vectors& re, const Vectors& im, const std::array<Mask4, kVectors>& up,
                                  std::int64_t times) {
    for (; times > 0; --times) {
      for (std::size_t v = 0; v < kVectors; ++v) {
        const Double4 r = re_[v] * re[v] - im_[v] * im[v], i = re_[v] * im[v] + im_[v] * re[v];
        const Mask4 was_up = im_[v] >= 0.0, now_up = i >= 0.0;  // masks are -1 where true
        windings_[v] -= was_up & up[v] & ~now_up;
        windings_[v] += ~was_up & ~up[v] & now_up;
        re_[v] = r;
        im_[v] = i;
      }
      if (++factors_ == kFactors) scale();
    }
  }
  std::array<double, 4 * kVectors> value();

 private:
  /// Products of so many factors need no scaling: each is within 2^-24 and 2^48.
  static constexpr int kFactors = 8;
  void scale();

  Vectors re_, im_;
  std::array<Mask4, kVectors> windings_{};
  int factors_ = 0;
};

/// Adds half the solid angle of the ribbon from an edge to +x infinity, times its count, seen from a place in quanta.
void add_boundary_strip(const BorderEdge& edge, const Long3& x, AngleSum& half);

/// The same for places that differ in x alone, four to a vector. \tparam kVectors  vectors of four
template <std::size_t kVectors>
class BoundaryStripRow {
 public:
  static constexpr std::size_t kTargets = 4 * kVectors;
  BoundaryStripRow(const std::array<std::int64_t, kTargets>& x, std::int64_t y, std::int64_t z);
  void add(const BorderEdge& edge);
  /// Half of all solid angles.
  std::array<double, kTargets> value();

 private:
  std::array<std::int64_t, kTargets> quanta_;
  std::int64_t y_, z_;
  std::array<Double4, kVectors> x_;
  AngleSums<kVectors> half_;
  std::array<AngleSum, kTargets> apart_;  ///< of edges that the line of the row meets or nearly so
  bool any_apart_ = false;
};

/// Half the solid angles of endless strips, from edges to infinity in both directions of x: the same from any place of a row. Eight
/// rows at once, whose y are a cell apart.
class EndlessStripRows {
 public:
  /// \param y, z  of the first row, quanta
  EndlessStripRows(std::int64_t y, std::int64_t z);
  void add(const BorderEdge& edge);
  std::array<double, 8> value();

 private:
  std::int64_t y_, z_;
  std::array<Double4, 2> at_;  ///< y of the rows, cells from y_
  AngleSums<2> half_;
  std::array<AngleSum, 8> apart_;  ///< of edges that a row meets or nearly so
  bool any_apart_ = false;
};

}  // namespace tessera
