#include "kernels/scene/solid.h"

#include <limits>

namespace tessera::synth {
namespace {

class PlaneFace final : public SolidFace {
 public:
  PlaneFace(const Double3& origin, const Double3& u, const Double3& v, Trim trim)
      : origin_(origin), u_(u), v_(v), trim_(std::move(trim)) {
    const Double3 n = cross(u, v);
    area_ = norm(n);
    normal_ = n * (1.0 / area_);
    // Dual basis: parameters of a point of the plane by two dot products.
    dual_u_ = cross(v_, normal_) * (1.0 / dot(u_, cross(v_, normal_)));
    dual_v_ = cross(normal_, u_) * (1.0 / dot(v_, cross(normal_, u_)));
  }
  double length_u() const override { return norm(u_); }
  double length_v() const override { return norm(v_); }
  double density(double, double) const override { return area_; }
  bool trimmed() const override { return static_cast<bool>(trim_); }
  bool inside(double u, double v) const override { return !trim_ || trim_(origin_ + u_ * u + v_ * v); }
  void evaluate(std::span<const double> u, std::span<const double> v, SurfaceBatch& out) const override {
    out.resize(u.size());
    for (std::size_t i = 0; i < u.size(); ++i) {
      const Double3 p = origin_ + u_ * u[i] + v_ * v[i];
      out.x[i] = p[0], out.y[i] = p[1], out.z[i] = p[2];
      out.nx[i] = normal_[0], out.ny[i] = normal_[1], out.nz[i] = normal_[2];
    }
  }
  bool foot(const Double3& p, SurfacePoint& out) const override {
    const Double3 q = p - normal_ * dot(p - origin_, normal_);
    const Double3 r = q - origin_;
    const double a = dot(r, dual_u_), b = dot(r, dual_v_);
    if (!(a >= 0.0 && a <= 1.0 && b >= 0.0 && b <= 1.0)) return false;
    if (trim_ && !trim_(q)) return false;
    out = {q, normal_};
    return true;
  }
  void intersect(const Ray& ray, RayHit& hit) const override {
    const double slope = dot(ray.direction, normal_);
    if (slope == 0.0) return;
    const double t = dot(origin_ - ray.origin, normal_) / slope;
    SurfacePoint point;
    if (t > 0.0 && t < hit.range && foot(ray.origin + ray.direction * t, point)) hit = {t, point};
  }

 private:
  Double3 origin_{}, u_{}, v_{}, normal_{}, dual_u_{}, dual_v_{};
  double area_;
  Trim trim_;
};

class CylinderFace final : public SolidFace {
 public:
  explicit CylinderFace(const CylinderShape& shape) : s_(shape), y_(cross(shape.axis, shape.x)) {
    const SinCos middle = sin_cos(0.5 * (s_.from + s_.to));
    middle_ = s_.x * middle.cos + y_ * middle.sin;
    // An angle is in range when it is near enough to the middle one; a full turn lets everything pass.
    const double half = 0.5 * (s_.to - s_.from);
    min_cosine_ = half >= kPi - 1e-9 ? -2.0 : sin_cos(half).cos - 1e-12;
  }
  double length_u() const override { return s_.radius * (s_.to - s_.from); }
  double length_v() const override { return s_.top_height - s_.low; }
  double density(double u, double) const override { return length_u() * (top(outward(u)) - s_.low); }
  bool trimmed() const override { return static_cast<bool>(s_.trim); }
  bool inside(double u, double v) const override { return !s_.trim || s_.trim(point(u, v)); }
  void evaluate(std::span<const double> u, std::span<const double> v, SurfaceBatch& out) const override {
    out.resize(u.size());
    for (std::size_t i = 0; i < u.size(); ++i) {
      const Double3 n = outward(u[i]);
      const Double3 p = s_.centre + n * s_.radius + s_.axis * (s_.low + v[i] * (top(n) - s_.low));
      const double sign = s_.inward ? -1.0 : 1.0;
      out.x[i] = p[0], out.y[i] = p[1], out.z[i] = p[2];
      out.nx[i] = sign * n[0], out.ny[i] = sign * n[1], out.nz[i] = sign * n[2];
    }
  }
  bool foot(const Double3& p, SurfacePoint& out) const override {
    const Double3 r = p - s_.centre;
    const double height = dot(r, s_.axis);
    const Double3 spoke = r - s_.axis * height;
    const double rho = norm(spoke);
    if (!(rho > 0.0))
      return false;  // on the axis every direction is as near: a crease or another face answers
    const Double3 n = spoke * (1.0 / rho);
    if (dot(n, middle_) < min_cosine_) return false;
    if (!(height >= s_.low && height <= top(n))) return false;
    const Double3 q = s_.centre + n * s_.radius + s_.axis * height;
    if (s_.trim && !s_.trim(q)) return false;
    out = {q, s_.inward ? -n : n};
    return true;
  }
  void intersect(const Ray& ray, RayHit& hit) const override {
    const Double3 o = ray.origin - s_.centre;
    const Double3 d = ray.direction - s_.axis * dot(ray.direction, s_.axis);
    const Double3 e = o - s_.axis * dot(o, s_.axis);
    const double a = dot(d, d), b = dot(d, e), c = dot(e, e) - s_.radius * s_.radius;
    const double disc = b * b - a * c;
    if (a == 0.0 || disc <= 0.0) return;
    const double root = std::sqrt(disc);
    for (const double t : {(-b - root) / a, (-b + root) / a}) {
      SurfacePoint point;
      if (t > 0.0 && t < hit.range && foot(ray.origin + ray.direction * t, point)) {
        hit = {t, point};
        return;
      }
    }
  }

 private:
  Double3 outward(double u) const {
    const SinCos t = sin_cos(s_.from + u * (s_.to - s_.from));
    return s_.x * t.cos + y_ * t.sin;
  }
  double top(const Double3& n) const { return s_.top_height + s_.radius * dot(s_.top_slope, n); }
  Double3 point(double u, double v) const {
    const Double3 n = outward(u);
    return s_.centre + n * s_.radius + s_.axis * (s_.low + v * (top(n) - s_.low));
  }

  CylinderShape s_;
  Double3 y_{}, middle_{};
  double min_cosine_;
};

double squared(const Double3& v) {
  return dot(v, v);
}

constexpr int kScanSteps = 48;

/// Whether a crease may come nearer to p than sqrt(d).
bool may_beat(const Crease& crease, const Double3& p, double d) {
  const double distance = norm(p - crease.middle) - crease.radius;
  return distance <= 0.0 || distance * distance < d;
}

}  // namespace

std::unique_ptr<SolidFace> plane_face(const Double3& origin, const Double3& u, const Double3& v, Trim trim) {
  return std::make_unique<PlaneFace>(origin, u, v, std::move(trim));
}

std::unique_ptr<SolidFace> cylinder_face(const CylinderShape& shape) {
  return std::make_unique<CylinderFace>(shape);
}

Crease Crease::line(const Double3& from, const Double3& to) {
  Crease c;
  c.centre = from, c.a = to - from, c.to = 1.0, c.straight = true;
  return c;
}

Crease Crease::arc(const Double3& centre, const Double3& a, const Double3& b, double from, double to) {
  Crease c;
  c.centre = centre, c.a = a, c.b = b, c.from = from, c.to = to;
  return c;
}

Double3 Crease::at(double t) const {
  if (straight) return centre + a * t;
  const SinCos angle = sin_cos(t);
  return centre + a * angle.cos + b * angle.sin;
}

Double3 Crease::closest(const Double3& p) const {
  if (straight) return centre + a * std::clamp(dot(p - centre, a) / dot(a, a), 0.0, 1.0);
  // Coarse scan for the valley, then bisection on the derivative of the squared distance inside its bracket:
  // an ellipse has at most two valleys, wider apart than a step.
  const double step = (to - from) / kScanSteps;
  int best = 0;
  double best_d = std::numeric_limits<double>::max();
  for (int k = 0; k <= kScanSteps; ++k) {
    const double d = squared(p - scan[static_cast<std::size_t>(k)]);
    if (d < best_d) {
      best_d = d;
      best = k;
    }
  }
  double lo = from + (best > 0 ? best - 1 : 0) * step,
         hi = from + (best < kScanSteps ? best + 1 : kScanSteps) * step;
  const bool full = to - from > 2.0 * kPi - 1e-9;
  if (full && (best == 0 || best == kScanSteps)) {
    lo = from - step;
    hi = from + step;
  }
  for (int k = 0; k < 52; ++k) {
    const double m = 0.5 * (lo + hi);
    const SinCos angle = sin_cos(m);
    const Double3 here = centre + a * angle.cos + b * angle.sin;
    const Double3 tangent = b * angle.cos - a * angle.sin;
    (dot(here - p, tangent) < 0.0 ? lo : hi) = m;
  }
  return at(0.5 * (lo + hi));
}

void Solid::add(Crease crease) {
  for (int k = 0; k <= kScanSteps; ++k) {
    crease.scan.push_back(crease.at(crease.from + (crease.to - crease.from) * k / kScanSteps));
  }
  Double3 sum{};
  for (const Double3& p : crease.scan) sum = sum + p;
  crease.middle = sum * (1.0 / (kScanSteps + 1));
  for (const Double3& p : crease.scan) {
    const double r = norm(p - crease.middle);
    if (r > crease.radius) crease.radius = r;
  }
  // An arc bulges between scan points by less than its step's share of its size.
  crease.radius *= 1.02;
  creases_.push_back(std::move(crease));
}

std::vector<Double3> Solid::crease_points(double step) const {
  std::vector<Double3> out;
  for (const auto& crease : creases_) {
    double arc_length = 0.0;
    for (std::size_t k = 1; k < crease.scan.size(); ++k)
      arc_length += norm(crease.scan[k] - crease.scan[k - 1]);
    const double n = std::floor(arc_length * 1.01 / step) + 1.0;
    for (double k = 0.5; k < n; k += 1.0)
      out.push_back(crease.at(crease.from + (crease.to - crease.from) * k / n));
  }
  return out;
}

SurfacePoint Solid::closest(const Double3& p) const {
  SurfacePoint best;
  double best_d = std::numeric_limits<double>::max();
  for (const auto& face : faces_) {
    SurfacePoint candidate;
    if (!face->foot(p, candidate)) continue;
    const double d = squared(p - candidate.position);
    if (d < best_d) {
      best_d = d;
      best = candidate;
    }
  }
  // Where no face has its foot nearest, a crease does; the normal is then the direction from it.
  for (const auto& crease : creases_) {
    if (!may_beat(crease, p, best_d)) continue;
    const Double3 q = crease.closest(p);
    const double d = squared(p - q);
    if (d < best_d) {
      best_d = d;
      best = {q, d > 0.0 ? unit(p - q) : Double3{0, 0, 1}};
    }
  }
  return best;
}

bool Solid::intersect(const Ray& ray, double limit, RayHit& hit) const {
  RayHit first;
  first.range = limit;
  bool found = false;
  for (const auto& face : faces_) {
    const double before = first.range;
    face->intersect(ray, first);
    found = found || first.range < before;
  }
  if (found) hit = first;
  return found;
}

std::vector<const SurfacePatch*> Solid::patches() const {
  std::vector<const SurfacePatch*> out;
  for (const auto& face : faces_) out.push_back(face.get());
  return out;
}

bool Solid::nearest_crease(const Double3& p, SharpFeature& out) const {
  double best = std::numeric_limits<double>::max();
  for (const auto& crease : creases_) {
    if (!may_beat(crease, p, best)) continue;
    const Double3 q = crease.closest(p);
    const double d = squared(p - q);
    if (d < best) {
      best = d;
      out = {false, std::sqrt(d), q};
    }
  }
  return !creases_.empty();
}

bool Solid::nearest_corner(const Double3& p, SharpFeature& out) const {
  double best = std::numeric_limits<double>::max();
  for (const auto& corner : corners_) {
    const double d = squared(p - corner);
    if (d < best) {
      best = d;
      out = {true, std::sqrt(d), corner};
    }
  }
  return !corners_.empty();
}

}  // namespace tessera::synth
