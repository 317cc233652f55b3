#include "kernels/mesh/triangle_foot.h"

namespace tessera {
namespace {

/// \param k  corner of a, l  corner of b
TriangleFoot foot_on_edge(const Double3& p, const Double3& a, const Double3& b, int k, int l) {
  const Double3 d = b - a;
  const double square = dot(d, d);
  if (!(square > 0.0)) return {a, -1, k};
  const double t = dot(p - a, d) / square;
  if (t <= 0.0) return {a, -1, k};
  if (t >= 1.0) return {b, -1, l};
  return {a + d * t, k, -1};
}

}  // namespace

TriangleFoot foot_in_triangle(const Double3& p, const Double3& a, const Double3& b, const Double3& c) {
  const Double3 n = triangle_normal(a, b, c);
  const double nn = dot(n, n);
  if (nn > 0.0) {
    const double wa = dot(cross(b - p, c - p), n), wb = dot(cross(c - p, a - p), n),
                 wc = dot(cross(a - p, b - p), n);
    if (wa > 0.0 && wb > 0.0 && wc > 0.0) return {p + n * (dot(a - p, n) / nn), -1, -1};
    // Exactly on the rim: the foot is what it would be within, but it belongs to an edge or a corner.
    if (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) {
      const Double3 at = p + n * (dot(a - p, n) / nn);
      if (wa == 0.0 && wb == 0.0) return {at, -1, 2};
      if (wb == 0.0 && wc == 0.0) return {at, -1, 0};
      if (wc == 0.0 && wa == 0.0) return {at, -1, 1};
      return {at, wa == 0.0 ? 1 : wb == 0.0 ? 2 : 0, -1};
    }
  }
  const TriangleFoot feet[3] = {foot_on_edge(p, a, b, 0, 1), foot_on_edge(p, b, c, 1, 2),
                                foot_on_edge(p, c, a, 2, 0)};
  int best = 0;
  for (int i = 1; i < 3; ++i)
    if (squared_distance(p, feet[i].at) < squared_distance(p, feet[best].at)) best = i;
  return feet[best];
}

}  // namespace tessera
