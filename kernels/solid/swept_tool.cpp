#include "kernels/solid/swept_tool.h"
#include "octree/box_levels.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

constexpr std::size_t kLeafSegments = 4;
constexpr std::size_t kChildren = 4;
constexpr int kMaxHalvings = 40;
constexpr double kSegmentExactness =
    1e-9;                         ///< of the tool's radius: how exactly its place on a segment is found
constexpr double kLevel = 1e-10;  ///< slope along a segment, per length, that counts as none
constexpr int kMaxPasses = 1000, kMaxDistanceSteps = 60;
constexpr double kExactRoot = 1e-9;  ///< of the way between two nodes
constexpr double kArrived = 1e-3;    ///< of that: steps are over
constexpr auto kNone = static_cast<std::size_t>(-1);

/// Distance from a tool without a top; it grows with the distance from the axis and falls with height.
inline double of_nose(const MillingTool& tool, double across, double above_tip) {
  const double wide = across - (tool.radius - tool.corner_radius), low = tool.corner_radius - above_tip;
  return (wide <= 0.0 || low <= 0.0 ? std::max(wide, low) : std::sqrt(wide * wide + low * low)) -
         tool.corner_radius;
}

/// Value and outward direction of a tool, from its tip.
inline void of_tool(const MillingTool& tool, const Double3& q, double& value, Double3& direction) {
  const double across = std::sqrt(q[0] * q[0] + q[1] * q[1]);
  const Double3 out = across > 0.0 ? Double3{q[0] / across, q[1] / across, 0.0} : Double3{1, 0, 0};
  const double wide = across - (tool.radius - tool.corner_radius), low = tool.corner_radius - q[2];
  if (wide <= 0.0 || low <= 0.0) {
    value = std::max(wide, low) - tool.corner_radius;
    direction = wide > low ? out : Double3{0, 0, -1};
  } else {
    const double away = std::sqrt(wide * wide + low * low);
    value = away - tool.corner_radius;
    direction = out * (wide / away) + Double3{0, 0, -low / away};
  }
  if (const double above = q[2] - tool.length; above > value) value = above, direction = {0, 0, 1};
}

/// The t in [0, 1] at which a + t way is nearest to p.
inline double foot_on(const Double3& from_a, const Double3& delta) {
  const double square = dot(delta, delta);
  return square > 0.0 ? std::clamp(dot(from_a, delta) / square, 0.0, 1.0) : 0.0;
}

}  // namespace

bool is_similarity(const Placement& placement) {
  const auto& m = placement.matrix;
  const Double3 x = {m[0], m[3], m[6]}, y = {m[1], m[4], m[7]}, z = {m[2], m[5], m[8]};
  const double size = dot(x, x);
  double off = std::max({std::fabs(dot(x, y)), std::fabs(dot(y, z)), std::fabs(dot(z, x))});
  off = std::max({off, std::fabs(dot(y, y) - size), std::fabs(dot(z, z) - size)});
  return size > 0.0 && off < 1e-9 * size;
}

SweptTool::SweptTool(const MillingTool& tool, const std::vector<Double3>& path, const Placement& placement)
    : tool_(tool),
      placement_(placement),
      inverse_(placement.inverse()),
      scale_(norm(Double3{placement.matrix[0], placement.matrix[3], placement.matrix[6]})) {
  segments_.reserve(std::max<std::size_t>(1, path.size() - 1));
  if (path.size() == 1) segments_.push_back({path[0], path[0]});
  for (std::size_t i = 1; i < path.size(); ++i) segments_.push_back({path[i - 1], path[i]});
  double farthest = tool_.length + tool_.radius;
  for (const Double3& p : path)
    for (const double c : p) farthest = std::max(farthest, std::fabs(c));
  rounding_ = 1e-13 * farthest;
  order(0, segments_.size());
  build();
}

SweptTool::SweptTool(const SweptTool& whole, std::vector<Segment>&& segments)
    : tool_(whole.tool_),
      segments_(std::move(segments)),
      placement_(whole.placement_),
      inverse_(whole.inverse_),
      scale_(whole.scale_),
      rounding_(whole.rounding_),
      remembers_(true) {
  if (!segments_.empty()) build();
}

/// Halves by the middles of the segments, along the longest side, at whole leaves of the tree.
void SweptTool::order(std::size_t first, std::size_t end) {
  const std::size_t leaves = (end - first + kLeafSegments - 1) / kLeafSegments;
  if (leaves < 2) return;
  Double3 low = segments_[first].a + segments_[first].b, high = low;
  for (std::size_t s = first; s < end; ++s) {
    const Double3 middle = segments_[s].a + segments_[s].b;
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], middle[k]);
      high[k] = std::max(high[k], middle[k]);
    }
  }
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k)
    if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
  // Left of the middle is a full tree, so that what shares a box is what was halved last.
  std::size_t left = 1;
  while (2 * left < leaves) left *= 2;
  const std::size_t middle = first + left * kLeafSegments;
  std::nth_element(segments_.begin() + static_cast<std::ptrdiff_t>(first),
                   segments_.begin() + static_cast<std::ptrdiff_t>(middle),
                   segments_.begin() + static_cast<std::ptrdiff_t>(end),
                   [axis](const Segment& l, const Segment& r) {
                     const double x = l.a[axis] + l.b[axis], y = r.a[axis] + r.b[axis];
                     return x != y ? x < y : l.a != r.a ? l.a < r.a : l.b < r.b;
                   });
  order(first, middle);
  order(middle, end);
}

void SweptTool::build() {
  std::vector<Box> boxes((segments_.size() + kLeafSegments - 1) / kLeafSegments);
  for (std::size_t s = 0; s < segments_.size(); ++s) {
    Box& box = boxes[s / kLeafSegments];
    if (s % kLeafSegments == 0) box = {segments_[s].a, segments_[s].a};
    for (const Double3& p : {segments_[s].a, segments_[s].b})
      for (std::size_t a = 0; a < 3; ++a) {
        box.low[a] = std::min(box.low[a], p[a]);
        box.high[a] = std::max(box.high[a], p[a]);
      }
  }
  levels_ = box_levels(std::move(boxes), kChildren);
}

/// No value of a tool with its tip in the box is lower.
double SweptTool::bound(const Double3& p, const Box& box) const {
  const double dx = std::max({0.0, box.low[0] - p[0], p[0] - box.high[0]}),
               dy = std::max({0.0, box.low[1] - p[1], p[1] - box.high[1]});
  return std::max(of_nose(tool_, std::sqrt(dx * dx + dy * dy), p[2] - box.low[2]),
                  p[2] - box.high[2] - tool_.length) -
         rounding_;
}

/// The value is convex along a segment, so where it does not fall to either side is the least.
SweptTool::Nearest SweptTool::of_segment(const Double3& p, std::size_t segment, double below) const {
  const Double3 &a = segments_[segment].a, &b = segments_[segment].b;
  const Double3 delta = b - a, from_a = p - a;
  // Most lie too far aside.
  const double lateral_foot = foot_on({from_a[0], from_a[1], 0.0}, {delta[0], delta[1], 0.0});
  const double dx = from_a[0] - delta[0] * lateral_foot, dy = from_a[1] - delta[1] * lateral_foot;
  if (const double minimum =
          of_nose(tool_, std::sqrt(dx * dx + dy * dy), std::max(from_a[2], p[2] - b[2])) - rounding_;
      minimum >= below)
    return {minimum, {}, segment};
  const double length = norm(delta);
  const auto at = [&](double t) {
    Nearest n;
    of_tool(tool_, t == 1.0 ? p - b : from_a - delta * t, n.value, n.direction);
    n.segment = segment;
    return n;
  };
  // Most often it is where the middle of a ball passes, or the axis.
  const double around = foot_on({from_a[0], from_a[1], from_a[2] - tool_.corner_radius}, delta);
  double low = 0.0, high = 1.0;
  Nearest best;
  best.value = std::numeric_limits<double>::infinity();
  for (const double t : {around, lateral_foot, 0.0, 1.0}) {
    const Nearest n = at(t);
    const double fall = dot(n.direction, delta), level = kLevel * length;
    const bool falls_on = fall > level && t < 1.0, falls_back = fall < -level && t > 0.0;
    if (!falls_back && !falls_on) return n;
    // Values change no faster than the tool moves.
    if (n.value - length * std::max(t, 1.0 - t) - rounding_ >= below) return n;
    if (n.value < best.value) best = n;
    if (falls_back) high = std::min(high, t);
    if (falls_on) low = std::max(low, t);
  }
  for (int i = 0; i < kMaxHalvings && (high - low) * length > kSegmentExactness * tool_.radius; ++i) {
    const double t = 0.5 * (low + high);
    const Nearest n = at(t);
    if (n.value < best.value) best = n;
    (dot(n.direction, delta) > 0.0 ? low : high) = t;
  }
  return best;
}

std::size_t SweptTool::leaf_end(std::size_t leaf) const {
  return std::min(segments_.size(), (leaf + 1) * kLeafSegments);
}

SweptTool::Nearest SweptTool::nearest(const Double3& p) const {
  Nearest best;
  best.value = std::numeric_limits<double>::infinity();
  if (segments_.empty()) return best;
  if (remembers_) best = of_segment(p, last_, best.value);
  visit_nearest_boxes(
      levels_, kChildren, [&](const Box& box) { return bound(p, box); },
      [&](double bound) { return bound < best.value; },
      [&](std::size_t leaf) {
        for (std::size_t s = leaf * kLeafSegments; s < leaf_end(leaf); ++s) {
          const Nearest n = of_segment(p, s, best.value);
          // Of two that are as near, one is chosen by what it is, not by when it came.
          if (n.value < best.value || (n.value == best.value && n.direction < best.direction)) best = n;
        }
      });
  if (remembers_) last_ = best.segment;
  return best;
}

/// Some place of the tool is enough.
bool SweptTool::cuts(const Double3& p, std::size_t segment, double below) const {
  const Double3& a = segments_[segment].a;
  const Double3 delta = segments_[segment].b - a, from_a = p - a;
  const double lateral_foot = foot_on({from_a[0], from_a[1], 0.0}, {delta[0], delta[1], 0.0});
  const double dx = from_a[0] - delta[0] * lateral_foot, dy = from_a[1] - delta[1] * lateral_foot;
  const double across = std::sqrt(dx * dx + dy * dy);
  if (of_nose(tool_, across, from_a[2] - std::min(0.0, delta[2])) - rounding_ >= below) return false;
  const double above = from_a[2] - delta[2] * lateral_foot;
  if (std::max(of_nose(tool_, across, above), above - tool_.length) < below) return true;
  return delta[2] != 0.0 && of_segment(p, segment, below).value < below;
}

std::size_t SweptTool::cutting(const Double3& p, double below) const {
  if (segments_.empty()) return kNone;
  if (remembers_ && cuts(p, last_, below)) return last_;
  std::size_t found = kNone;
  visit_boxes(
      levels_, kChildren, BoxOrder::kDescending, [&](const Box& box) { return bound(p, box) < below; },
      [&](std::size_t leaf) {
        for (std::size_t s = leaf * kLeafSegments; s < leaf_end(leaf) && found == kNone; ++s)
          if (cuts(p, s, below)) found = s;
        return found == kNone;
      });
  if (remembers_ && found != kNone) last_ = found;
  return found;
}

bool SweptTool::holds(const Double3& p) const {
  return cutting(inverse_.apply(p), 0.0) != kNone;
}

double SweptTool::surface_between(const Double3& from, const Double3& to, bool starts_inside) const {
  const Double3 p = inverse_.apply(starts_inside ? from : to),
                delta = inverse_.apply(starts_inside ? to : from) - p;
  const double exact = kExactRoot * norm(delta) + rounding_;
  double t = 0.0;
  std::size_t segment = cutting(p, 0.0);
  for (int pass = 0; pass < kMaxPasses && segment != kNone; ++pass) {
    // Out of the tool on this segment: a convex body, so Newton's method from beyond comes down to its surface.
    double out = 1.0;
    for (int step = 0; step < kMaxDistanceSteps; ++step) {
      const Nearest n = of_segment(p + delta * out, segment, std::numeric_limits<double>::infinity());
      const double slope = dot(n.direction, delta);
      if (!(n.value > 0.0) || !(slope > 0.0)) break;
      const double next = out - n.value / slope;
      if (!(next > t)) break;
      out = next;
      if (n.value <= kArrived * exact) break;
    }
    t = out;
    segment = cutting(p + delta * t, -exact);
  }
  return starts_inside ? t : 1.0 - t;
}

std::unique_ptr<SolidShape> SweptTool::near(const Double3& middle, double radius, double margin) const {
  const Double3 p = inverse_.apply(middle);
  const double limit = (radius + margin) / scale_ * (1.0 + 1e-9) + rounding_;
  std::vector<Segment> found;
  if (!segments_.empty())
    visit_boxes(
        levels_, kChildren, BoxOrder::kAscending, [&](const Box& box) { return bound(p, box) <= limit; },
        [&](std::size_t leaf) {
          for (std::size_t s = leaf * kLeafSegments; s < leaf_end(leaf); ++s)
            if (!(of_segment(p, s, limit).value > limit)) found.push_back(segments_[s]);
          return found.size() <= kMaxNear;
        });
  if (found.size() > kMaxNear) return nullptr;
  return std::unique_ptr<SolidShape>(new SweptTool(*this, std::move(found)));
}

double SweptTool::value(const Double3& p) const {
  return nearest(inverse_.apply(p)).value * scale_;
}

Double3 SweptTool::direction(const Double3& p) const {
  return placement_.apply_linear(nearest(inverse_.apply(p)).direction);
}

bool SweptTool::bounds(Double3& low, Double3& high) const {
  Box box = levels_.back()[0];
  for (std::size_t a = 0; a < 2; ++a) box.low[a] -= tool_.radius, box.high[a] += tool_.radius;
  box.high[2] += tool_.length;
  for (int corner = 0; corner < 8; ++corner) {
    const Double3 p =
        placement_.apply({corner & 1 ? box.high[0] : box.low[0], corner & 2 ? box.high[1] : box.low[1],
                          corner & 4 ? box.high[2] : box.low[2]});
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = corner == 0 ? p[a] : std::min(low[a], p[a]);
      high[a] = corner == 0 ? p[a] : std::max(high[a], p[a]);
    }
  }
  return true;
}

}  // namespace tessera
