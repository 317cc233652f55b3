#include "kernels/blends/rib_profile.h"

#include <algorithm>
#include <cmath>

#include "octree/portable_math.h"
#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr double kMinAngle = 0.08;  ///< radians: flatter ones have no corner to speak of
constexpr double kMaxAngle = 2.9;
constexpr int kMaxFitSteps = 40;
constexpr double kEnough = 1e-12;  ///< of the extent: a step that changes nothing,
/// Or of what noise leaves uncertain: rms by the root of the number of points.
constexpr double kEnoughOfNoise = 1e-3;

double dot2(const Double2& a, const Double2& b) {
  return a[0] * b[0] + a[1] * b[1];
}
Double2 normal_at(double angle) {
  const SinCos s = sin_cos(angle);
  return {s.sin, s.cos};
}
/// In the direction of growing x.
Double2 tangent_at(double angle) {
  const SinCos s = sin_cos(angle);
  return {s.cos, -s.sin};
}
double tan_half(double angle) {
  const SinCos s = sin_cos(0.5 * angle);
  return s.sin / s.cos;
}
/// Of a direction, from y towards x, in (-pi, pi].
double angle_of(const Double2& d) {
  const double length = std::sqrt(dot2(d, d));
  if (!(length > 0.0)) return 0.0;
  const double a = angle_between({d[0] / length, d[1] / length, 0.0}, {0.0, 1.0, 0.0});
  return d[0] < 0.0 ? -a : a;
}

/// Angle of the normal and offset of the line through points, least squares; y up.
bool fit_line(std::span<const Double2> points, double& angle, double& offset) {
  if (points.size() < 3) return false;
  double n = 0.0, x = 0.0, y = 0.0;
  for (const Double2& p : points) n += 1.0, x += p[0], y += p[1];
  x /= n, y /= n;
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (const Double2& p : points) {
    xx += (p[0] - x) * (p[0] - x), xy += (p[0] - x) * (p[1] - y), yy += (p[1] - y) * (p[1] - y);
  }
  // Direction of the larger eigenvalue.
  const double half = 0.5 * (xx - yy), root = std::sqrt(half * half + xy * xy);
  Double2 d = half >= 0.0 ? Double2{half + root, xy} : Double2{xy, root - half};
  if (!(dot2(d, d) > 0.0)) return false;
  if (d[0] < 0.0) d = {-d[0], -d[1]};
  angle = angle_of({-d[1], d[0]});
  offset = dot2(normal_at(angle), {x, y});
  return true;
}

using Row = std::array<double, 5>;  ///< angle 0, offset 0, angle 1, offset 1, radius

/// What every point is held against.
struct Laid {
  explicit Laid(const RibProfile& p)
      : radius(p.radius),
        sign(p.angle[1] > p.angle[0] ? 1.0 : -1.0),
        middle(p.middle_angle()),
        half(0.5 * p.arc_length()),
        determinant(sin_cos(p.angle[0] - p.angle[1]).sin),
        centre(p.centre()),
        offset(p.offset) {
    for (std::size_t k = 0; k < 2; ++k) {
      normal[k] = normal_at(p.angle[k]);
      tangent[k] = tangent_at(p.angle[k]);
      end[k] = {centre[0] + radius * normal[k][0], centre[1] + radius * normal[k][1]};
    }
  }
  /// \param along  out: on flanks the way from the arc's end, else 0
  RibZone zone(const Double2& p, double& along, double& distance) const {
    const double before = dot2(tangent[0], {p[0] - end[0][0], p[1] - end[0][1]});
    const double beyond = dot2(tangent[1], {p[0] - end[1][0], p[1] - end[1][1]});
    const double left = dot2(normal[0], p) - offset[0], right = dot2(normal[1], p) - offset[1];
    // Deep inside a convex corner, or far outside a concave one, a point is beside both flanks.
    if (before < 0.0 && (beyond <= 0.0 || std::fabs(left) <= std::fabs(right))) {
      along = before, distance = left;
      return RibZone::kLeft;
    }
    if (beyond > 0.0) {
      along = beyond, distance = right;
      return RibZone::kRight;
    }
    const Double2 off = {p[0] - centre[0], p[1] - centre[1]};
    along = 0.0, distance = sign * std::sqrt(dot2(off, off)) - radius;
    return RibZone::kArc;
  }

  double radius, sign, middle, half, determinant;
  Double2 centre;
  std::array<double, 2> offset;
  std::array<Double2, 2> normal, tangent, end;
};

/// Distance and its derivatives.
double residual(const Laid& q, const Double2& p, Row& row) {
  double along = 0.0, distance = 0.0;
  const RibZone zone = q.zone(p, along, distance);
  row.fill(0.0);
  if (zone != RibZone::kArc) {
    const std::size_t k = zone == RibZone::kLeft ? 0 : 1;
    row[2 * k] = dot2(q.tangent[k], p);
    row[2 * k + 1] = -1.0;
    return distance;
  }
  const Double2 off = {p[0] - q.centre[0], p[1] - q.centre[1]};
  const double length = std::sqrt(dot2(off, off));
  if (!(length > 0.0)) return distance;
  const Double2 e = {q.sign * off[0] / length, q.sign * off[1] / length};
  const double e0 = dot2(e, q.tangent[1]) / q.determinant, e1 = -dot2(e, q.tangent[0]) / q.determinant;
  row = {e0 * dot2(q.tangent[0], q.centre), -e0, e1 * dot2(q.tangent[1], q.centre), -e1, e0 + e1 - 1.0};
  return distance;
}

double cost_of(const RibProfile& q, std::span<const Double2> points) {
  const Laid laid(q);
  double sum = 0.0;
  for (const Double2& p : points) {
    double along = 0.0, distance = 0.0;
    laid.zone(p, along, distance);
    sum += distance * distance;
  }
  return sum;
}

bool is_sound(const RibProfile& q, bool convex) {
  const double arc_angle = convex ? q.angle[1] - q.angle[0] : q.angle[0] - q.angle[1];
  return arc_angle > kMinAngle && arc_angle < kMaxAngle && std::fabs(q.angle[0]) < 0.5 * kPi &&
         std::fabs(q.angle[1]) < 0.5 * kPi;
}

}  // namespace

double RibProfile::arc_angle() const {
  return std::fabs(angle[1] - angle[0]);
}
double RibProfile::arc_length() const {
  return std::fabs(radius) * arc_angle();
}
double RibProfile::tangent_length() const {
  return std::fabs(radius) * tan_half(arc_angle());
}
Double2 RibProfile::centre() const {
  const double determinant = sin_cos(angle[0] - angle[1]).sin;
  const Double2 t0 = tangent_at(angle[0]), t1 = tangent_at(angle[1]);
  const double a = (offset[0] - radius) / determinant, b = (offset[1] - radius) / determinant;
  return {a * t1[0] - b * t0[0], a * t1[1] - b * t0[1]};
}
Double2 RibProfile::corner() const {
  RibProfile sharp = *this;
  sharp.radius = 0.0;
  return sharp.centre();
}
Double2 RibProfile::middle() const {
  return on_arc(0.5);
}
Double2 RibProfile::arc_normal(double share) const {
  return normal_at(angle[0] + share * (angle[1] - angle[0]));
}
Double2 RibProfile::flank_normal(std::size_t side) const {
  return normal_at(angle[side]);
}
Double2 RibProfile::on_arc(double share) const {
  const Double2 c = centre(), n = arc_normal(share);
  return {c[0] + radius * n[0], c[1] + radius * n[1]};
}
Double2 RibProfile::on_flank(std::size_t side, double from_corner) const {
  const Double2 c = corner(), t = tangent_at(angle[side]);
  const double signed_length = side == 0 ? -from_corner : from_corner;
  return {c[0] + signed_length * t[0], c[1] + signed_length * t[1]};
}

ProfilePosition profile_position(const RibProfile& q, const Double2& p) {
  const Laid laid(q);
  ProfilePosition out;
  double along = 0.0;
  out.zone = laid.zone(p, along, out.distance);
  if (out.zone == RibZone::kLeft) {
    out.run = along - laid.half;
  } else if (out.zone == RibZone::kRight) {
    out.run = along + laid.half;
  } else {
    const Double2 off = {laid.sign * (p[0] - laid.centre[0]), laid.sign * (p[1] - laid.centre[1])};
    out.run = q.radius * (angle_of(off) - laid.middle);
  }
  return out;
}

ProfileFit guess_profile(std::span<const Double2> points, double half_width, bool convex) {
  ProfileFit out;
  std::vector<Double2> side[2];
  for (const Double2& p : points)
    if (std::fabs(p[0]) > half_width) side[p[0] > 0.0].push_back(p);
  RibProfile& q = out.profile;
  for (std::size_t k = 0; k < 2; ++k)
    if (!fit_line(side[k], q.angle[k], q.offset[k])) return out;
  if (!is_sound(q, convex)) return out;
  const double r = half_width / std::max(0.05, sin_cos(0.5 * q.arc_angle()).sin);
  q.radius = convex ? r : -r;
  out.found = true;
  return out;
}

ProfileFit fit_profile(std::span<const Double2> points, const RibProfile& start, bool convex) {
  ProfileFit out;
  out.profile = start;
  if (points.size() < 7 || !is_sound(start, convex)) return out;
  RibProfile q = start;
  double extent = 0.0;
  for (const Double2& p : points) extent = std::max(extent, std::sqrt(dot2(p, p)));
  double cost = cost_of(q, points), damp = 1e-4;
  for (int step = 0; step < kMaxFitSteps; ++step) {
    SmallMatrix<5> normal = SmallMatrix<5>::zero();
    Row gradient{};
    const Laid laid(q);
    for (const Double2& p : points) {
      Row row;
      const double d = residual(laid, p, row);
      for (std::size_t i = 0; i < 5; ++i) {
        const double a = row[static_cast<std::size_t>(i)];
        if (a == 0.0) continue;
        for (std::size_t j = 0; j <= i; ++j) normal(i, j) += a * row[static_cast<std::size_t>(j)];
        gradient[static_cast<std::size_t>(i)] -= a * d;
      }
    }
    double largest = 0.0;
    for (std::size_t i = 0; i < 5; ++i) largest = std::max(largest, normal(i, i));
    bool better = false;
    double moved = 0.0;
    for (; damp < 1e8 && !better; damp *= 8.0) {
      SmallMatrix<5> a = normal;
      for (std::size_t i = 0; i < 5; ++i) a(i, i) += damp * normal(i, i) + 1e-14 * largest;
      Row x = gradient;
      if (!cholesky_factor(a)) continue;
      cholesky_solve(a, x);
      RibProfile next = q;
      next.angle[0] += x[0], next.offset[0] += x[1], next.angle[1] += x[2], next.offset[1] += x[3];
      next.radius += x[4];
      next.radius = convex ? std::max(0.0, next.radius) : std::min(0.0, next.radius);
      if (!is_sound(next, convex)) continue;
      const double now = cost_of(next, points);
      if (!(now <= cost)) continue;
      moved =
          std::fabs(x[1]) + std::fabs(x[3]) + std::fabs(x[4]) + extent * (std::fabs(x[0]) + std::fabs(x[2]));
      q = next;
      cost = now;
      better = true;
    }
    damp = std::max(1e-12, damp * 1e-3);
    const double uncertain = std::sqrt(cost) / static_cast<double>(points.size());
    if (!better || moved <= std::max(kEnough * extent, kEnoughOfNoise * uncertain)) break;
  }
  out.profile = q;
  out.found = true;
  out.rms = std::sqrt(cost / static_cast<double>(points.size()));
  for (const Double2& p : points) ++out.count[static_cast<std::size_t>(profile_position(q, p).zone)];
  return out;
}

}  // namespace tessera
