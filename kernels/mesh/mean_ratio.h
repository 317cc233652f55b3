/// \file mean_ratio.h
/// The shape of a triangle as one number: 4 sqrt(3) area / (sum of squared edges), 1 for the equilateral one, 0 without area.
#pragma once
#include "octree/vector.h"

namespace tessera {

[[nodiscard]] inline double mean_ratio(const Double3& a, const Double3& b, const Double3& c) {
  const Double3 u = b - a, v = c - a, w = c - b;
  const double squares = dot(u, u) + dot(v, v) + dot(w, w);
  return squares > 0.0 ? 2.0 * 1.7320508075688772 * norm(cross(u, v)) / squares : 0.0;
}

/// Its square, without a root.
[[nodiscard]] inline double squared_mean_ratio(const Double3& a, const Double3& b, const Double3& c) {
  const Double3 u = b - a, v = c - a, w = c - b, n = cross(u, v);
  const double squares = dot(u, u) + dot(v, v) + dot(w, w);
  return squares > 0.0 ? 12.0 * dot(n, n) / (squares * squares) : 0.0;
}

}  // namespace tessera
