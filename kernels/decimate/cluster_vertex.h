/// \file cluster_vertex.h
/// The one vertex that stands for all corners in a cell of vertex clustering.
/// Source: Lindstrom, "Out-of-Core Simplification of Large Polygonal Models", 2000.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "kernels/decimate/quadric.h"

namespace tessera {

/// Sums over the corners of a cell, relative to an origin near it. Add in a fixed order.
struct ClusterVertex {
  Quadric quadric;  ///< of the planes of faces
  Double3 sum{};
  double weight = 0.0;
  std::array<double, 3> colour_sum{};
  double colour_weight = 0.0;

  void add(const Double3& offset, double w) {
    sum = sum + offset * w;
    weight += w;
  }
  void add_colour(std::uint32_t rgba, double w) {
    for (std::size_t c = 0; c < 3; ++c) colour_sum[c] += w * static_cast<double>((rgba >> (8 * c)) & 0xffu);
    colour_weight += w;
  }

  /// Where the quadric is smallest; the mean of the corners where that is farther than `cell` from the mean.
  /// \pre some corner was added \return relative to the origin
  [[nodiscard]] Double3 position(double cell) const {
    constexpr double kMeanWeight = 1e-4;
    const Double3 mean = sum * (1.0 / weight);
    Double3 best{};
    // Along a plane or a crease the quadric says nothing: there a little of the mean decides.
    Quadric q = quadric;
    const double w = kMeanWeight * (q.xx + q.yy + q.zz);
    q.xx += w, q.yy += w, q.zz += w;
    q.bx += w * mean[0], q.by += w * mean[1], q.bz += w * mean[2];
    return quadric_minimum(q, best) && norm(best - mean) <= cell ? best : mean;
  }
  /// Mean of the colours, opaque.
  [[nodiscard]] std::uint32_t rgba() const {
    std::uint32_t out = 0xff000000u;
    if (colour_weight > 0.0)
      for (std::size_t c = 0; c < 3; ++c)
        out |= static_cast<std::uint32_t>(colour_sum[c] / colour_weight) << (8 * c);
    return out;
  }
};

}  // namespace tessera
