/// \file exact_winding.h
/// How often a closed mesh winds around a point, exactly: faces above it, each counted by the way that it looks. A line that
/// passes an edge or a vertex is moved by less than any number.
/// Source: Edelsbrunner, Mücke, "Simulation of Simplicity", 1990.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "kernels/boolean/exact_point.h"
#include "kernels/mesh/face_boxes.h"

namespace tessera {

class ExactWinding {
 public:
  /// \param faces  of a closed mesh, by numbers of points that are given; both outlive this
  ExactWinding(const PointTable& points, std::span<const std::array<std::uint32_t, 3>> faces);

  /// 1 inside of a solid, 0 outside. \param point  a number that is on no face that counts
  /// \param counts  of faces, whether they do; together they are closed
  int at(std::uint32_t point, const std::function<bool(std::uint32_t)>& counts) const;
  [[nodiscard]] int at(std::uint32_t point) const {
    return at(point, [](std::uint32_t) { return true; });
  }

 private:
  int side(std::uint32_t a, std::uint32_t b, std::uint32_t point) const;

  const PointTable& points_;
  std::span<const std::array<std::uint32_t, 3>> faces_;
  FaceBoxes boxes_;
  double top_ = 0.0;
};

}  // namespace tessera
