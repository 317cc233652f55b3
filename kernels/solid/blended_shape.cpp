#include "kernels/solid/blended_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/solid/sign_change.h"

namespace tessera {
namespace {

constexpr int kMaxSteps = 40;       ///< of Newton's; two planes take one
constexpr double kMinSlope = 0.25;  ///< of what a step along the curve of centres gains
constexpr double kTouches = 1e-7;   ///< of the radius: how well the ball does once steps gain nothing more
constexpr double kExact = 1e-13;
constexpr double kRoot = 1e-9;         ///< of an edge
constexpr double kUnderRound = 1e-6;   ///< of the radius: least value, where a round may pass
constexpr double kMinOpening = 1e-10;  ///< squared sine between normals: below it both are one surface

class BlendedShape : public SolidShape {
 public:
  BlendedShape(std::unique_ptr<SolidShape> a, std::unique_ptr<SolidShape> b, SolidTree::Join join,
               double radius)
      : a_(std::move(a)),
        b_(std::move(b)),
        join_(join),
        radius_(radius),
        of_a_(join == SolidTree::Join::kUnite ? 1.0 : -1.0),
        of_b_(join == SolidTree::Join::kIntersect ? -1.0 : 1.0),
        of_both_(join == SolidTree::Join::kUnite ? 1.0 : -1.0) {}

  double distance(const Double3& p) const override { return of_both_ * united(p).value; }
  Double3 away(const Double3& p) const override { return united(p).direction * of_both_; }
  bool holds(const Double3& p) const override { return of_both_ * united(p).value < 0.0; }
  Double3 direction(const Double3& p) const override { return away(p); }

  /// Never farther from zero than any surface is, wherever a ball fits or does not: a round lies outside of both, within its
  /// radius of one and twice of the other.
  double value(const Double3& p) const override {
    Part a, b;
    const double round = united(p, &a, &b).value, near = std::min(a.value, b.value);
    const double beyond = std::max(near - radius_, std::max(a.value, b.value) - 2.0 * radius_);
    const double maximum = near < 0.0 ? -near : std::min(near, std::max(beyond, 0.0));
    const double far = radius_ > 0.0 ? std::max(maximum, kUnderRound * radius_) : maximum;
    return of_both_ * (round < 0.0 ? -far : far);
  }

  /// By what is behind value(), which rounds off no sign.
  double surface_between(const Double3& from, const Double3& to, bool starts_inside) const override {
    const Double3 delta = to - from;
    return find_sign_change(starts_inside, kRoot, 0.0, [&](double t) { return distance(from + delta * t); });
  }

  bool bounds(Double3& low, Double3& high) const override {
    if (join_ == SolidTree::Join::kSubtract) return a_->bounds(low, high);
    Double3 other_low, other_high;
    const bool a = a_->bounds(low, high), b = b_->bounds(other_low, other_high);
    if (join_ == SolidTree::Join::kUnite) {
      // A round fills no more than the hull of its parts.
      for (std::size_t k = 0; k < 3; ++k)
        low[k] = std::min(low[k], other_low[k]), high[k] = std::max(high[k], other_high[k]);
      return a && b;
    }
    if (!a) low = other_low, high = other_high;
    if (a && b)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::max(low[k], other_low[k]);
        high[k] = std::max(low[k], std::min(high[k], other_high[k]));
      }
    return a || b;
  }

 private:
  struct Part {
    double value = 0.0;
    Double3 direction{};
  };

  Part of_a(const Double3& p) const { return {of_a_ * a_->distance(p), unit_or_zero(a_->away(p)) * of_a_}; }
  Part of_b(const Double3& p) const { return {of_b_ * b_->distance(p), unit_or_zero(b_->away(p)) * of_b_}; }

  /// Of the union of both, turned inside out where that makes the joint one.
  /// \param[out] first, second  what was joined, turned as well
  Part united(const Double3& p, Part* first = nullptr, Part* second = nullptr) const {
    const Part a = of_a(p), b = of_b(p);
    const Part& plain = b.value < a.value ? b : a;
    if (first) *first = a, *second = b;
    if (radius_ == 0.0 || plain.value >= radius_) return plain;
    Double3 centre;
    if (!find_centre(p, a, b, centre)) return plain;
    const Double3 delta = centre - p;
    const double far = norm(delta);
    return far > 0.0 ? Part{radius_ - far, delta / far} : Part{radius_, plain.direction};
  }

  /// Where the ball nearest to a point lies. \returns false where there is none, or the point is not between its contacts
  bool find_centre(const Double3& p, Part a, Part b, Double3& centre) const {
    centre = p;
    const bool outside = a.value > 0.0 && b.value > 0.0;
    Double3 before = p;
    double last = std::numeric_limits<double>::infinity(), rt_before = 0.0;
    for (int step = 0; step < kMaxSteps; ++step) {
      const double g = dot(a.direction, b.direction), free = 1.0 - g * g;
      if (!(free > kMinOpening)) return false;
      const Double3 along = cross(a.direction, b.direction) / std::sqrt(free);
      const double ra = radius_ - a.value, rb = radius_ - b.value, rt = dot(p - centre, along);
      const double off = std::max({std::fabs(ra), std::fabs(rb), std::fabs(rt)});
      // Parts that are rounded themselves have values as exact as their own centres: no bound is small enough for all.
      if (off <= kTouches * radius_ && (off <= kExact * radius_ || off >= 0.5 * last)) {
        // From the centre to the point, in shares of both normals.
        const Double3 to = centre - p;
        const double u = dot(to, a.direction), v = dot(to, b.direction);
        if (!(u > g * v && v > g * u)) return false;
        // A point outside of both that lies far behind a plane of contact is on another side of a thin part.
        return !(outside && std::max(u, v) > 2.0 * radius_);
      }
      last = off;
      const double da = (ra - g * rb) / free, db = (rb - g * ra) / free;
      // Along the curve of centres towards the point: it bends, so what was gained by the last step tells the length of this one.
      const double moved = dot(centre - before, along);
      double slope = 1.0;
      if (step > 0 && std::fabs(moved) > kTouches * radius_)
        slope = std::max(std::fabs((rt - rt_before) / moved), kMinSlope);
      before = centre;
      rt_before = rt;
      const double dt = std::clamp(rt / slope, -radius_, radius_);
      centre = centre + a.direction * da + b.direction * db + along * dt;
      a = of_a(centre);
      b = of_b(centre);
    }
    return false;
  }

  std::unique_ptr<SolidShape> a_, b_;
  SolidTree::Join join_;
  double radius_;
  double of_a_, of_b_, of_both_;
};

}  // namespace

std::unique_ptr<SolidShape> blend_shapes(std::unique_ptr<SolidShape> a, std::unique_ptr<SolidShape> b,
                                         SolidTree::Join join, double radius) {
  return std::make_unique<BlendedShape>(std::move(a), std::move(b), join, radius);
}

}  // namespace tessera
