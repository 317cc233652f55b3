/// \file exact_point.h
/// Points where edges of one mesh pass faces and edges of another, as quotients of whole numbers: what is asked of them has the
/// answer of real numbers. A filter in double precision tells nearly all signs.
/// Source: Attene, "Indirect Predicates for Geometric Constructions", 2020; here quotients are formed, for they are few.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <boost/multiprecision/cpp_int.hpp>

#include "octree/vector.h"

namespace tessera {

using BigInt =
    boost::multiprecision::number<boost::multiprecision::cpp_int_backend<>, boost::multiprecision::et_off>;

/// x / w in steps of an ExactGrid.
struct ExactPoint {
  std::array<BigInt, 3> x;
  BigInt w;  ///< > 0
};

/// A step of which all coordinates of some points are whole multiples.
class ExactGrid {
 public:
  ExactGrid() = default;
  /// \pre finite
  explicit ExactGrid(std::span<const Double3> points);
  [[nodiscard]] ExactPoint point(const Double3& p) const;
  /// The nearest double on each axis.
  [[nodiscard]] Double3 rounded(const ExactPoint& p) const;
  /// Where the line through p and q passes the plane through a, b, c. \pre p and q lie on both sides of it
  [[nodiscard]] ExactPoint on_plane(const Double3& p, const Double3& q, const Double3& a, const Double3& b,
                                    const Double3& c) const;
  /// Where the line through p and q passes that through a and b. \pre they pass each other in one point
  [[nodiscard]] ExactPoint on_line(const Double3& p, const Double3& q, const Double3& a,
                                   const Double3& b) const;

 private:
  BigInt steps(double x) const;
  std::array<BigInt, 3> steps(const Double3& p) const;

  int exponent_ = 0;  ///< a step is 2 to this
};

/// Points by number: those that are given first, then those that are made. Nothing moves while it is asked.
class PointTable {
 public:
  PointTable() = default;
  explicit PointTable(std::vector<Double3> given);
  [[nodiscard]] const ExactGrid& grid() const { return grid_; }
  std::uint32_t add(ExactPoint made);
  [[nodiscard]] std::size_t size() const { return near_.size(); }
  [[nodiscard]] std::size_t given() const { return given_; }
  [[nodiscard]] bool is_given(std::uint32_t i) const { return i < given_; }
  /// The point itself where it is given, else the nearest doubles.
  [[nodiscard]] const Double3& near(std::uint32_t i) const { return near_[i]; }
  [[nodiscard]] ExactPoint exact(std::uint32_t i) const {
    return is_given(i) ? grid_.point(near_[i]) : made_[i - given_];
  }

  /// Of twice the area of a, b, c along axes u and v, as orient2d_sign() tells it.
  [[nodiscard]] int orient2d(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::size_t u,
                             std::size_t v) const;
  /// As orient3d_sign() tells it.
  [[nodiscard]] int orient3d(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) const;
  /// The middle of three points, as a new one.
  std::uint32_t add_middle(std::uint32_t a, std::uint32_t b, std::uint32_t c);

 private:
  ExactGrid grid_;
  std::size_t given_ = 0;
  std::vector<Double3> near_;
  std::vector<ExactPoint> made_;
};

}  // namespace tessera
