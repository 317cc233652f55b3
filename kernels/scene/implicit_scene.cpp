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
double shape_distance(const Primitive& s, const Vec3& p, Vec3& g) {
  switch (s.shape) {
    case Shape::kBox: {
      const Vec3 q{std::fabs(p.x) - s.size.x + s.round, std::fabs(p.y) - s.size.y + s.round,
                   std::fabs(p.z) - s.size.z + s.round};
      const Vec3 o{std::max(q.x, 0.0), std::max(q.y, 0.0), std::max(q.z, 0.0)};
      const double d2 = dot(o, o);
      if (d2 > 0.0) {
        const double d = std::sqrt(d2);
        g = {sign(p.x) * o.x / d, sign(p.y) * o.y / d, sign(p.z) * o.z / d};
        return d - s.round;
      }
      g = q.x >= q.y && q.x >= q.z ? Vec3{sign(p.x), 0, 0}
          : q.y >= q.z             ? Vec3{0, sign(p.y), 0}
                                   : Vec3{0, 0, sign(p.z)};
      return std::max(q.x, std::max(q.y, q.z)) - s.round;
    }
    case Shape::kCylinder: {
      const double rho = std::sqrt(p.x * p.x + p.y * p.y);
      double gr, gz;
      const double d = rectangle(rho, std::fabs(p.z), s.size.x, s.size.z, s.round, gr, gz);
      g = rho > 0.0 ? Vec3{gr * p.x / rho, gr * p.y / rho, gz * sign(p.z)} : Vec3{gr, 0.0, gz * sign(p.z)};
      return d;
    }
    case Shape::kTorus: {
      const double rho = std::sqrt(p.x * p.x + p.y * p.y);
      const double u = rho - s.size.x;
      const double d = std::sqrt(u * u + p.z * p.z);
      if (!(rho > 0.0) || !(d > 0.0)) {
        g = {0, 0, 1};
      } else {
        g = {u / d * p.x / rho, u / d * p.y / rho, p.z / d};
      }
      return d - s.size.y;
    }
    case Shape::kRoundCone: {
      const double ra = s.size.x, rb = s.size.y, h = s.size.z;
      const double rho = std::sqrt(p.x * p.x + p.y * p.y);
      const double b = h > 0.0 ? (ra - rb) / h : 0.0;
      const double a = std::sqrt(1.0 - b * b);
      const double k = rho * -b + p.z * a;  // position along the slant
      if (h > 0.0 && k >= 0.0 && k <= a * h) {
        g = rho > 0.0 ? Vec3{a * p.x / rho, a * p.y / rho, b} : Vec3{a, 0, b};
        return rho * a + p.z * b - ra;
      }
      const bool upper = h > 0.0 && k > 0.0;
      const Vec3 q{p.x, p.y, upper ? p.z - h : p.z};
      const double d = length(q);
      g = d > 0.0 ? q * (1.0 / d) : Vec3{0, 0, 1};
      return d - (upper ? rb : ra);
    }
  }
  return 0.0;
}

double primitive_distance(const Primitive& s, const Vec3& p, Vec3& gradient) {
  const Vec3 r = p - s.centre;
  Vec3 local;
  const double d = shape_distance(s, {dot(r, s.x), dot(r, s.y), dot(r, s.z)}, local);
  gradient = s.x * local.x + s.y * local.y + s.z * local.z;
  return d;
}

/// Quadratic smooth minimum: a circular-like blend, gradient a convex combination (so still 1-Lipschitz).
double smooth_min(double a, double b, double k, Vec3& ga, const Vec3& gb) {
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

Primitive& Primitive::turned(double angle) {
  const SinCos t = sin_cos(angle);
  const auto turn = [&t](const Vec3& v) {
    return Vec3{v.x * t.cos - v.y * t.sin, v.x * t.sin + v.y * t.cos, v.z};
  };
  x = turn(x), y = turn(y), z = turn(z);
  return *this;
}
Primitive& Primitive::along(const Vec3& direction) {
  z = normalized(direction);
  x = any_orthogonal(z);
  y = cross(z, x);
  return *this;
}
Primitive& Primitive::painted(int r, int g, int b) {
  colour = static_cast<std::uint32_t>(r) | static_cast<std::uint32_t>(g) << 8 |
           static_cast<std::uint32_t>(b) << 16 | 0xff000000u;
  return *this;
}
Primitive box(const Vec3& centre, const Vec3& half, double round, double blend) {
  Primitive p;
  p.shape = Shape::kBox, p.centre = centre, p.size = half, p.round = round, p.blend = blend;
  return p;
}
Primitive cylinder(const Vec3& centre, double radius, double half_height, double round, double blend) {
  Primitive p;
  p.shape = Shape::kCylinder, p.centre = centre, p.size = {radius, radius, half_height}, p.round = round;
  p.blend = blend;
  return p;
}
Primitive torus(const Vec3& centre, double major, double minor, double blend) {
  Primitive p;
  p.shape = Shape::kTorus, p.centre = centre, p.size = {major, minor, 0}, p.blend = blend;
  return p;
}
Primitive round_cone(const Vec3& a, const Vec3& b, double ra, double rb, double blend) {
  Primitive p;
  p.shape = Shape::kRoundCone, p.centre = a, p.blend = blend;
  p.size = {ra, rb, length(b - a)};
  if (p.size.z > 0.0) p.along(b - a);
  return p;
}
Primitive ball(const Vec3& centre, double radius, double blend) {
  return round_cone(centre, centre, radius, radius, blend);
}

// ---------------------------------------------------------------------------------------------- field

ImplicitScene::ImplicitScene(ImplicitModel model) : model_(std::move(model)) {
  assert(model_.primitives.size() < 65536);
  size_ = length(model_.bounds.hi - model_.bounds.lo);
  if (model_.skin.amplitude != 0.0) skin_slope_ = fractal_volume_slope_bound(model_.skin);
  if (model_.ground) {
    const double slope = fractal_slope_bound(model_.relief);
    ground_factor_ = 1.0 / std::sqrt(1.0 + slope * slope);
  }
  build_grid();
}

void ImplicitScene::build_grid() {
  const Vec3 margin = (model_.bounds.hi - model_.bounds.lo) * 0.02;
  grid_lo_ = model_.bounds.lo - margin;
  grid_hi_ = model_.bounds.hi + margin;
  const Vec3 extent = grid_hi_ - grid_lo_;
  const double widest = std::max(extent.x, std::max(extent.y, extent.z));
  const double e[3] = {extent.x, extent.y, extent.z};
  for (int a = 0; a < 3; ++a)
    cells_[a] = static_cast<int>(clamp(std::floor(40.0 * e[a] / widest + 0.5), 4.0, 40.0));
  per_cell_ = {cells_[0] / extent.x, cells_[1] / extent.y, cells_[2] / extent.z};
  const Vec3 cell{1.0 / per_cell_.x, 1.0 / per_cell_.y, 1.0 / per_cell_.z};
  const double radius = 0.5 * length(cell);
  double blend = 0.0;
  for (const auto& s : model_.primitives) blend = std::max(blend, s.blend);
  std::vector<double> distance(model_.primitives.size());
  for (int k = 0; k < cells_[2]; ++k) {
    for (int j = 0; j < cells_[1]; ++j) {
      for (int i = 0; i < cells_[0]; ++i) {
        const Vec3 centre = grid_lo_ + Vec3{(i + 0.5) * cell.x, (j + 0.5) * cell.y, (k + 0.5) * cell.z};
        first_.push_back(static_cast<std::uint32_t>(ids_.size()));
        double nearest = kFar;
        Vec3 unused;
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
double ImplicitScene::join(const Ids& ids, const Vec3& p, Vec3& gradient, std::uint32_t* paint) const {
  double f = kFar;
  gradient = {0, 0, 1};
  double nearest = kFar;
  for (const auto id : ids) {
    const Primitive& s = model_.primitives[id];
    Vec3 g;
    double d = primitive_distance(s, p, g);
    if (s.join == Join::kSubtract) {
      // max(f, -d) = -min(-f, d)
      Vec3 negative = -gradient;
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

double ImplicitScene::ground(const Vec3& p, Vec3& gradient) const {
  double z, sx, sy;
  fractal_heights(model_.relief, {&p.x, 1}, {&p.y, 1}, {&z, 1}, {&sx, 1}, {&sy, 1});
  gradient = Vec3{-sx, -sy, 1.0} * ground_factor_;
  return (p.z - z) * ground_factor_;
}

double ImplicitScene::field(const Vec3& p, Vec3& gradient, std::uint32_t* paint) const {
  const Vec3 q{(p.x - grid_lo_.x) * per_cell_.x, (p.y - grid_lo_.y) * per_cell_.y,
               (p.z - grid_lo_.z) * per_cell_.z};
  double f;
  if (q.x >= 0.0 && q.y >= 0.0 && q.z >= 0.0 && q.x < cells_[0] && q.y < cells_[1] && q.z < cells_[2]) {
    const auto cell = (static_cast<std::size_t>(q.z) * static_cast<std::size_t>(cells_[1]) +
                       static_cast<std::size_t>(q.y)) *
                          static_cast<std::size_t>(cells_[0]) +
                      static_cast<std::size_t>(q.x);
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
    const double reach = 4.0 * std::fabs(model_.skin.amplitude);
    if (std::fabs(f) < reach) {
      Vec3 g;
      const double bump = fractal_volume(model_.skin, p, g);
      const double t = f / reach, fade = (1.0 - t * t) * (1.0 - t * t);
      const double fade_slope = -4.0 * t * (1.0 - t * t) / reach;
      gradient = gradient * (1.0 + fade_slope * bump) + g * fade;
      f += fade * bump;
    }
  }
  if (model_.ground) {
    Vec3 g;
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

bool ImplicitScene::settle(Vec3& q, Vec3& normal) const {
  Vec3 g;
  for (int k = 0; k < 30; ++k) {
    const double f = field(q, g);
    const double slope = length(g);
    if (!(slope > 1e-9)) return false;
    normal = g * (1.0 / slope);
    if (std::fabs(f) < 1e-13 * size_) return true;
    q = q - normal * (f / slope);
  }
  return std::fabs(field(q, g)) < 1e-10 * size_;
}

SurfacePoint ImplicitScene::closest(const Vec3& p) const {
  SurfacePoint best;
  double best_d = std::numeric_limits<double>::max();
  Vec3 q = p, normal{0, 0, 1};
  for (int round = 0; round < 24; ++round) {
    if (!settle(q, normal)) break;
    const double d = length(p - q);
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
  const double o[3] = {ray.origin.x, ray.origin.y, ray.origin.z};
  const double d[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
  const double lo[3] = {grid_lo_.x, grid_lo_.y, grid_lo_.z}, hi[3] = {grid_hi_.x, grid_hi_.y, grid_hi_.z};
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
  const double share = stride(), least = 2e-4 * size_;
  Vec3 g;
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
      Vec3 q = ray.origin + ray.direction * (0.5 * (a + b)), normal;
      if (settle(q, normal)) out.push_back({q, normal});
    }
    have_before = true;
    before = f;
    t_before = t;
    t += std::max(std::fabs(f) * share, least);
  }
}

bool ImplicitScene::intersect(const Ray& ray, double limit, RayHit& hit) const {
  double t0, t1;
  if (!clip(ray, limit, t0, t1)) return false;
  const double shrink = stride();
  const double close = 1e-6 * size_;
  Vec3 g;
  double t = t0;
  for (int step = 0; step < 1000 && t <= t1; ++step) {
    const Vec3 p = ray.origin + ray.direction * t;
    const double f = field(p, g);
    if (f < close) {
      if (f < -close && step == 0) return false;  // starts inside
      // Near enough for Newton along the ray where it meets the surface, else straight down on a grazing hit.
      double s = t;
      for (int k = 0; k < 8; ++k) {
        const double fs = field(ray.origin + ray.direction * s, g);
        const double slope = dot(g, ray.direction);
        if (std::fabs(fs) < 1e-13 * size_ || slope > -1e-3) break;
        s = clamp(s - fs / slope, t - 100.0 * close, t + 100.0 * close);
      }
      Vec3 q = ray.origin + ray.direction * s, normal;
      if (!settle(q, normal) || !(s > 0.0) || s > t1) return false;
      hit = {s, {q, normal}};
      return true;
    }
    t += std::max(f * shrink, 20.0 * close);
  }
  return false;
}

std::uint32_t ImplicitScene::colour(const SurfacePoint& p) const {
  Vec3 g;
  std::uint32_t paint = 0xffb4b4b4u;
  field(p.position, g, &paint);
  return paint;
}

}  // namespace tessera::synth
