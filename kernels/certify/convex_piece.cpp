#include "kernels/certify/convex_piece.h"

namespace tessera {

void ConvexPiece::close() {
  Double3 sum{};
  for (int i = 0; i < corners; ++i) sum[0] += x[i], sum[1] += y[i], sum[2] += z[i];
  const double share = 1.0 / corners;
  for (int i = corners; i < (corners / 4 + 1) * 4; ++i)
    x[i] = sum[0] * share, y[i] = sum[1] * share, z[i] = sum[2] * share;
}

bool cut(const ConvexPiece& piece, const CutPlane& plane, ConvexPiece& inside, ConvexPiece& outside) {
  double height[kMaxCorners];
  bool below = false, above = false;
  for (int i = 0; i < piece.corners; ++i) {
    height[i] = plane.height(piece.at(i));
    below = below || height[i] < 0.0;
    above = above || height[i] > 0.0;
  }
  if (!below || !above) return false;
  inside.corners = outside.corners = 0;
  inside.cuts = outside.cuts = piece.cuts + 1;
  inside.hint = outside.hint = piece.hint;
  const int sides = piece.corners == 2 ? 1 : piece.corners;  // a segment has one
  for (int i = 0; i < piece.corners; ++i) {
    const Double3 p = piece.at(i);
    if (height[i] <= 0.0) inside.add(p);
    if (height[i] >= 0.0) outside.add(p);
    const int j = i + 1 == piece.corners ? 0 : i + 1;
    if (i >= sides || !((height[i] < 0.0 && height[j] > 0.0) || (height[i] > 0.0 && height[j] < 0.0)))
      continue;
    const double t = height[i] / (height[i] - height[j]);
    const Double3 q = piece.at(j);
    const Double3 crossing = {p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), p[2] + t * (q[2] - p[2])};
    inside.add(crossing);
    outside.add(crossing);
  }
  inside.close();
  outside.close();
  return true;
}

bool side_plane(const std::array<Double3, 3>& t, const Double3& normal, const Double3& centre,
                const Double3& far, CutPlane& plane) {
  double maximum = 0.0;
  const auto offer = [&](Double3 across, const Double3& on) {
    const double size = norm(across);
    if (!(size > 0.0)) return;
    across = across * (1.0 / size);
    const CutPlane p{across, dot(across, on)};
    const double height = p.height(far);
    if (height <= maximum || p.height(centre) > 0.25 * height) return;
    maximum = height;
    plane = p;
  };
  if (t[1] == t[2]) {
    offer(t[1] - t[0], t[1]);
    offer(t[0] - t[1], t[0]);
    return maximum > 0.0;
  }
  for (std::size_t c = 0; c < 3; ++c) {
    const Double3& a = t[c];
    const Double3& b = t[(c + 1) % 3];
    Double3 across = cross(b - a, normal);
    if (dot(across, t[(c + 2) % 3] - a) > 0.0) across = across * -1.0;
    offer(across, a);
  }
  return maximum > 0.0;
}

bool bisector(const std::array<Double3, 3>& t1, const Double3& p1, const std::array<Double3, 3>& t2,
              const Double3& p2, CutPlane& plane) {
  const auto signed_plane = [](const std::array<Double3, 3>& t, const Double3& p, CutPlane& out) {
    out.normal = cross(t[1] - t[0], t[2] - t[0]);
    const double size = norm(out.normal);
    if (!(size > 0.0)) return false;
    out.normal = out.normal * (1.0 / size);
    out.offset = dot(out.normal, t[0]);
    if (out.height(p) < 0.0) out = {out.normal * -1.0, -out.offset};
    return true;
  };
  CutPlane a, b;
  if (!signed_plane(t1, p1, a) || !signed_plane(t2, p2, b)) return false;
  plane.normal = a.normal - b.normal;
  const double size = norm(plane.normal);
  if (size < 1e-6) return false;
  plane.normal = plane.normal * (1.0 / size);
  plane.offset = (a.offset - b.offset) / size;
  const double at1 = plane.height(p1), at2 = plane.height(p2);
  return at1 < 0.0 && at2 > 0.0 && at2 > 0.05 * (at2 - at1) && at1 < 0.05 * (at1 - at2);
}

}  // namespace tessera
