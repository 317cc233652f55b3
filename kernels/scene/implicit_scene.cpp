#include "kernels/scene/implicit_scene.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <span>

namespace tessera::synth {
namespace {

double sign(double v) {
  return v < 0.0 ? -1.0 : 1.0;
}

/// Signed distance to the rounded rectangle of half extents (a, b) about the origin, for u, v >= 0, and its
/// gradient.
double rectangle(double u, double v, double a, double b, double round, double& gu, double& gv) {
  const double qu = u - (a - round), qv = v - (b - round);
  if (qu > 0.0 && qv > 0.0) {
    const double d = std::sqrt(qu * qu + qv * qv);
    gu = qu / d, gv = qv / d;
    return d - round;
  }
  gu = qu > qv ? 1.0 : 0.0, gv = 1.0 - gu;
  return (qu > qv ? qu : qv) - round;
}

/// Signed distances of the shapes in their own frames (Quilez, "Distance functions"), with exact gradients.
double shape_distance(const Primitive& s, const Double3& p, Double3& g) {
  switch (s.shape) {
    case Shape::kBox: {
      const Double3 q{std::fabs(p[0]) - s.size[0] + s.round, std::fabs(p[1]) - s.size[1] + s.round,
                      std::fabs(p[2]) - s.size[2] + s.round};
      const Double3 o{std::max(q[0], 0.0), std::max(q[1], 0.0), std::max(q[2], 0.0)};
      const double d2 = dot(o, o);
      if (d2 > 0.0) {
        const double d = std::sqrt(d2);
        g = {sign(p[0]) * o[0] / d, sign(p[1]) * o[1] / d, sign(p[2]) * o[2] / d};
        return d - s.round;
      }
      g = q[0] >= q[1] && q[0] >= q[2] ? Double3{sign(p[0]), 0, 0}
          : q[1] >= q[2]               ? Double3{0, sign(p[1]), 0}
                                       : Double3{0, 0, sign(p[2])};
      return std::max(q[0], std::max(q[1], q[2])) - s.round;
    }
    case Shape::kCylinder: {
      const double rho = std::sqrt(p[0] * p[0] + p[1] * p[1]);
      double gr, gz;
      const double d = rectangle(rho, std::fabs(p[2]), s.size[0], s.size[2], s.round, gr, gz);
      g = rho > 0.0 ? Double3{gr * p[0] / rho, gr * p[1] / rho, gz * sign(p[2])}
                    : Double3{gr, 0.0, gz * sign(p[2])};
      return d;
    }
    case Shape::kTorus: {
      const double rho = std::sqrt(p[0] * p[0] + p[1] * p[1]);
      const double u = rho - s.size[0];
      const double d = std::sqrt(u * u + p[2] * p[2]);
      if (!(rho > 0.0) || !(d > 0.0)) {
        g = {0, 0, 1};
      } else {
        g = {u / d * p[0] / rho, u / d * p[1] / rho, p[2] / d};
      }
      return d - s.size[1];
    }
    case Shape::kRoundCone: {
      const double ra = s.size[0], rb = s.size[1], h = s.size[2];
      const double rho = std::sqrt(p[0] * p[0] + p[1] * p[1]);
      const double b = h > 0.0 ? (ra - rb) / h : 0.0;
      const double a = std::sqrt(1.0 - b * b);
      const double k = rho * -b + p[2] * a;  // position along the slant
      if (h > 0.0 && k >= 0.0 && k <= a * h) {
        g = rho > 0.0 ? Double3{a * p[0] / rho, a * p[1] / rho, b} : Double3{a, 0, b};
        return rho * a + p[2] * b - ra;
      }
      const bool upper = h > 0.0 && k > 0.0;
      const Double3 q{p[0], p[1], upper ? p[2] - h : p[2]};
      const double d = norm(q);
      g = d > 0.0 ? q * (1.0 / d) : Double3{0, 0, 1};
      return d - (upper ? rb : ra);
    }
  }
  return 0.0;
}

double primitive_distance(const Primitive& s, const Double3& p, Double3& gradient) {
  const Double3 r = p - s.centre;
  Double3 local{};
  const double d = shape_distance(s, {dot(r, s.x), dot(r, s.y), dot(r, s.z)}, local);
  gradient = s.x * local[0] + s.y * local[1] + s.z * local[2];
  return d;
}

/// Quadratic smooth minimum: a circular-like blend, gradient a convex combination (so still 1-Lipschitz).
double smooth_min(double a, double b, double k, Double3& ga, const Double3& gb) {
  if (k <= 0.0 || std::fabs(a - b) >= k) {
    if (b < a) ga = gb;
    return std::min(a, b);
  }
  const double h = 0.5 + 0.5 * (b - a) / k;  // weight of a
  ga = ga * h + gb * (1.0 - h);
  return b + (a - b) * h - k * h * (1.0 - h);
}

constexpr double kFar = 1e30;

}  // namespace

// ---------------------------------------------------------------------------------------------- primitives

Primitive& Primitive::rotated(double angle) {
  const SinCos t = sin_cos(angle);
  const auto rotate = [&t](const Double3& v) {
    return Double3{v[0] * t.cos - v[1] * t.sin, v[0] * t.sin + v[1] * t.cos, v[2]};
  };
  x = rotate(x), y = rotate(y), z = rotate(z);
  return *this;
}
Primitive& Primitive::along(const Double3& direction) {
  z = unit(direction);
  x = any_orthogonal(z);
  y = cross(z, x);
  return *this;
}
Primitive& Primitive::painted(int r, int g, int b) {
  colour = static_cast<std::uint32_t>(r) | static_cast<std::uint32_t>(g) << 8 |
           static_cast<std::uint32_t>(b) << 16 | 0xff000000u;
  return *this;
}
Primitive box(const Double3& centre, const Double3& half, double round, double blend) {
  Primitive p;
  p.shape = Shape::kBox, p.centre = centre, p.size = half, p.round = round, p.blend = blend;
  return p;
}
Primitive cylinder(const Double3& centre, double radius, double half_height, double round, double blend) {
  Primitive p;
  p.shape = Shape::kCylinder, p.centre = centre, p.size = {radius, radius, half_height}, p.round = round;
  p.blend = blend;
  return p;
}
Primitive torus(const Double3& centre, double major, double minor, double blend) {
  Primitive p;
  p.shape = Shape::kTorus, p.centre = centre, p.size = {major, minor, 0}, p.blend = blend;
  return p;
}
Primitive round_cone(const Double3& a, const Double3& b, double ra, double rb, double blend) {
  Primitive p;
  p.shape = Shape::kRoundCone, p.centre = a, p.blend = blend;
  p.size = {ra, rb, norm(b - a)};
  if (p.size[2] > 0.0) p.along(b - a);
  return p;
}
Primitive ball(const Double3& centre, double radius, double blend) {
  return round_cone(centre, centre, radius, radius, blend);
}

// ---------------------------------------------------------------------------------------------- field

ImplicitScene::ImplicitScene(ImplicitModel model) : model_(std::move(model)) {
  assert(model_.primitives.size() < 65536);
  size_ = norm(model_.bounds.hi - model_.bounds.lo);
  if (model_.skin.amplitude != 0.0) skin_slope_ = fractal_volume_slope_bound(model_.skin);
  if (model_.ground) {
    const double slope = fractal_slope_bound(model_.relief);
    ground_factor_ = 1.0 / std::sqrt(1.0 + slope * slope);
  }
  build_grid();
}

void ImplicitScene::build_grid() {
  const Double3 margin = (model_.bounds.hi - model_.bounds.lo) * 0.02;
  grid_lo_ = model_.bounds.lo - margin;
  grid_hi_ = model_.bounds.hi + margin;
  const Double3 extent = grid_hi_ - grid_lo_;
  const double widest = std::max(extent[0], std::max(extent[1], extent[2]));
  const double e[3] = {extent[0], extent[1], extent[2]};
  for (int a = 0; a < 3; ++a)
    cells_[a] = static_cast<int>(std::clamp(std::floor(40.0 * e[a] / widest + 0.5), 4.0, 40.0));
  per_cell_ = {cells_[0] / extent[0], cells_[1] / extent[1], cells_[2] / extent[2]};
  const Double3 cell{1.0 / per_cell_[0], 1.0 / per_cell_[1], 1.0 / per_cell_[2]};
  const double radius = 0.5 * norm(cell);
  double blend = 0.0;
  for (const auto& s : model_.primitives) blend = std::max(blend, s.blend);
  std::vector<double> distance(model_.primitives.size());
  for (int k = 0; k < cells_[2]; ++k) {
    for (int j = 0; j < cells_[1]; ++j) {
      for (int i = 0; i < cells_[0]; ++i) {
        const Double3 centre =
            grid_lo_ + Double3{(i + 0.5) * cell[0], (j + 0.5) * cell[1], (k + 0.5) * cell[2]};
        first_.push_back(static_cast<std::uint32_t>(ids_.size()));
        double nearest = kFar;
        Double3 unused{};
        for (std::size_t s = 0; s < distance.size(); ++s) {
          const auto& primitive = model_.primitives[s];
          distance[s] = primitive_distance(primitive, centre, unused);
          if (primitive.join == Join::kHollow) distance[s] = -distance[s];
          if (primitive.join != Join::kSubtract) nearest = std::min(nearest, distance[s]);
        }
        for (std::size_t s = 0; s < distance.size(); ++s) {
          // What is further than the nearest by both spreads and both transitions changes nothing here. A
          // hole matters where its wall can be, and where it opens what is nearest.
          const bool hole = model_.primitives[s].join == Join::kSubtract;
          const double limit = hole ? radius + 2.0 * blend : nearest + 2.0 * radius + 2.0 * blend;
          if (distance[s] <= limit) ids_.push_back(static_cast<std::uint16_t>(s));
        }
      }
    }
  }
  first_.push_back(static_cast<std::uint32_t>(ids_.size()));
}

template <class Ids>
double ImplicitScene::join(const Ids& ids, const Double3& p, Double3& gradient, std::uint32_t* paint) const {
  double f = kFar;
  gradient = {0, 0, 1};
  double nearest = kFar;
  for (const auto id : ids) {
    const Primitive& s = model_.primitives[id];
    Double3 g{};
    double d = primitive_distance(s, p, g);
    if (s.join == Join::kSubtract) {
      // max(f, -d) = -min(-f, d)
      Double3 negative = -gradient;
      f = -smooth_min(-f, d, s.blend, negative, g);
      gradient = -negative;
    } else {
      if (s.join == Join::kHollow) d = -d, g = -g;
      f = smooth_min(f, d, s.blend, gradient, g);
    }
    if (paint && std::fabs(d) < nearest) {
      nearest = std::fabs(d);
      *paint = s.colour;
    }
  }
  return f;
}

double ImplicitScene::ground(const Double3& p, Double3& gradient) const {
  double z, sx, sy;
  fractal_heights(model_.relief, {&p[0], 1}, {&p[1], 1}, {&z, 1}, {&sx, 1}, {&sy, 1});
  gradient = Double3{-sx, -sy, 1.0} * ground_factor_;
  return (p[2] - z) * ground_factor_;
}

double ImplicitScene::field(const Double3& p, Double3& gradient, std::uint32_t* paint) const {
  const Double3 q{(p[0] - grid_lo_[0]) * per_cell_[0], (p[1] - grid_lo_[1]) * per_cell_[1],
                  (p[2] - grid_lo_[2]) * per_cell_[2]};
  double f;
  if (q[0] >= 0.0 && q[1] >= 0.0 && q[2] >= 0.0 && q[0] < cells_[0] && q[1] < cells_[1] && q[2] < cells_[2]) {
    const auto cell = (static_cast<std::size_t>(q[2]) * static_cast<std::size_t>(cells_[1]) +
                       static_cast<std::size_t>(q[1])) *
                          static_cast<std::size_t>(cells_[0]) +
                      static_cast<std::size_t>(q[0]);
    f = join(std::span(ids_.data() + first_[cell], first_[cell + 1] - first_[cell]), p, gradient, paint);
  } else {
    struct All {
      struct Iterator {
        std::size_t i;
        std::size_t operator*() const { return i; }
        Iterator& operator++() { return ++i, *this; }
        bool operator!=(const Iterator& o) const { return i != o.i; }
      };
      std::size_t n;
      Iterator begin() const { return {0}; }
      Iterator end() const { return {n}; }
    };
    f = join(All{model_.primitives.size()}, p, gradient, paint);
  }
  // The skin fades out of sight of the surface: far away its bound alone would slow every ray.
  if (skin_slope_ > 0.0) {
    const double fade_width = 4.0 * std::fabs(model_.skin.amplitude);
    if (std::fabs(f) < fade_width) {
      Double3 g{};
      const double bump = fractal_volume(model_.skin, p, g);
      const double t = f / fade_width, fade = (1.0 - t * t) * (1.0 - t * t);
      const double fade_slope = -4.0 * t * (1.0 - t * t) / fade_width;
      gradient = gradient * (1.0 + fade_slope * bump) + g * fade;
      f += fade * bump;
    }
  }
  if (model_.ground) {
    Double3 g{};
    const double d = ground(p, g);
    if (d < f) {
      f = d;
      gradient = g;
      if (paint) *paint = 0xff5a8a6eu;
    }
  }
  return f;
}

// ---------------------------------------------------------------------------------------------- queries

bool ImplicitScene::project(Double3& q, Double3& normal) const {
  Double3 g{};
  for (int k = 0; k < 30; ++k) {
    const double f = field(q, g);
    const double slope = norm(g);
    if (!(slope > 1e-9)) return false;
    normal = g * (1.0 / slope);
    if (std::fabs(f) < 1e-13 * size_) return true;
    q = q - normal * (f / slope);
  }
  return std::fabs(field(q, g)) < 1e-10 * size_;
}

SurfacePoint ImplicitScene::closest(const Double3& p) const {
  SurfacePoint best;
  double best_d = std::numeric_limits<double>::max();
  Double3 q = p, normal{0, 0, 1};
  for (int round = 0; round < 24; ++round) {
    if (!project(q, normal)) break;
    const double d = norm(p - q);
    const bool gained = d < best_d - 1e-13 * size_;
    if (d < best_d) {
      best_d = d;
      best = {q, normal};
    }
    if (!gained && round > 0) break;
    q = p - normal * dot(p - q, normal);  // foot on the tangent plane, then back onto the surface
  }
  if (best_d == std::numeric_limits<double>::max()) best = {q, normal};
  return best;
}

bool ImplicitScene::clip(const Ray& ray, double limit, double& t0, double& t1) const {
  t0 = 0.0, t1 = limit;
  const double o[3] = {ray.origin[0], ray.origin[1], ray.origin[2]};
  const double d[3] = {ray.direction[0], ray.direction[1], ray.direction[2]};
  const double lo[3] = {grid_lo_[0], grid_lo_[1], grid_lo_[2]},
               hi[3] = {grid_hi_[0], grid_hi_[1], grid_hi_[2]};
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0.0) {
      if (o[axis] < lo[axis] || o[axis] > hi[axis]) return false;
      continue;
    }
    const double a = (lo[axis] - o[axis]) / d[axis], b = (hi[axis] - o[axis]) / d[axis];
    t0 = std::max(t0, std::min(a, b));
    t1 = std::min(t1, std::max(a, b));
  }
  return t0 < t1;
}

double ImplicitScene::stride() const {
  // Half of the certified slope is more than the noise ever has; a quarter stays for what the skin hides from
  // afar.
  return skin_slope_ > 0.0 ? std::min(0.75, 1.0 / (1.0 + skin_slope_ * 0.5)) : 1.0;
}

void ImplicitScene::crossings(const Ray& ray, double limit, std::vector<SurfacePoint>& out) const {
  out.clear();
  double t0, t1;
  if (!clip(ray, limit, t0, t1)) return;
  // Nothing in these scenes is thinner than the least step, which keeps rays along walls from crawling.
  const double share = stride(), minimum = 2e-4 * size_;
  Double3 g{};
  double before = 0.0, t_before = t0;
  bool have_before = false;
  for (double t = t0; t <= t1;) {
    const double f = field(ray.origin + ray.direction * t, g);
    if (have_before && (f < 0.0) != (before < 0.0)) {
      double a = t_before, b = t;
      for (int k = 0; k < 12; ++k) {
        const double m = 0.5 * (a + b);
        ((field(ray.origin + ray.direction * m, g) < 0.0) == (before < 0.0) ? a : b) = m;
      }
      Double3 q = ray.origin + ray.direction * (0.5 * (a + b)), normal{};
      if (project(q, normal)) out.push_back({q, normal});
    }
    have_before = true;
    before = f;
    t_before = t;
    t += std::max(std::fabs(f) * share, minimum);
  }
}

bool ImplicitScene::intersect(const Ray& ray, double limit, RayHit& hit) const {
  double t0, t1;
  if (!clip(ray, limit, t0, t1)) return false;
  const double shrink = stride();
  const double close = 1e-6 * size_;
  Double3 g{};
  double t = t0;
  for (int step = 0; step < 1000 && t <= t1; ++step) {
    const Double3 p = ray.origin + ray.direction * t;
    const double f = field(p, g);
    if (f < close) {
      if (f < -close && step == 0) return false;  // starts inside
      // Near enough for Newton along the ray where it meets the surface, else straight down on a grazing hit.
      double s = t;
      for (int k = 0; k < 8; ++k) {
        const double fs = field(ray.origin + ray.direction * s, g);
        const double slope = dot(g, ray.direction);
        if (std::fabs(fs) < 1e-13 * size_ || slope > -1e-3) break;
        s = std::clamp(s - fs / slope, t - 100.0 * close, t + 100.0 * close);
      }
      Double3 q = ray.origin + ray.direction * s, normal{};
      if (!project(q, normal) || !(s > 0.0) || s > t1) return false;
      hit = {s, {q, normal}};
      return true;
    }
    t += std::max(f * shrink, 20.0 * close);
  }
  return false;
}

std::uint32_t ImplicitScene::colour(const SurfacePoint& p) const {
  Double3 g{};
  std::uint32_t paint = 0xffb4b4b4u;
  field(p.position, g, &paint);
  return paint;
}

}  // namespace tessera::synth
