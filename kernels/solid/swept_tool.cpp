#include "kernels/solid/swept_tool.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

constexpr std::size_t kLeafSegments = 4;
constexpr std::size_t kChildren = 4;
constexpr int kMostHalvings = 40;
constexpr double kExact = 1e-5;  ///< of the tool's radius: how exactly its place on a segment is found
constexpr std::size_t kStack = 128;

}  // namespace

bool is_similarity(const Placement& placement) {
  const auto& m = placement.matrix;
  const Double3 x = {m[0], m[3], m[6]}, y = {m[1], m[4], m[7]}, z = {m[2], m[5], m[8]};
  const double size = dot(x, x);
  double off = std::max({std::fabs(dot(x, y)), std::fabs(dot(y, z)), std::fabs(dot(z, x))});
  off = std::max({off, std::fabs(dot(y, y) - size), std::fabs(dot(z, z) - size)});
  return size > 0.0 && off < 1e-9 * size;
}

SweptTool::SweptTool(const MillingTool& tool, std::vector<Double3> path, const Placement& placement)
    : tool_(tool),
      path_(std::move(path)),
      segments_(std::max<std::size_t>(1, path_.size() - 1)),
      placement_(placement),
      inverse_(placement.inverse()),
      scale_(norm(Double3{placement.matrix[0], placement.matrix[3], placement.matrix[6]})) {
  std::vector<Box> boxes((segments_ + kLeafSegments - 1) / kLeafSegments);
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    Box& box = boxes[b];
    box.low = box.high = path_[b * kLeafSegments];
    const std::size_t last = std::min(path_.size() - 1, (b + 1) * kLeafSegments);
    for (std::size_t i = b * kLeafSegments; i <= last; ++i)
      for (std::size_t a = 0; a < 3; ++a) {
        box.low[a] = std::min(box.low[a], path_[i][a]);
        box.high[a] = std::max(box.high[a], path_[i][a]);
      }
    for (std::size_t a = 0; a < 2; ++a) box.low[a] -= tool_.radius, box.high[a] += tool_.radius;
    box.high[2] += tool_.length;
  }
  levels_.push_back(std::move(boxes));
  while (levels_.back().size() > 1) {
    const std::vector<Box>& below = levels_.back();
    std::vector<Box> next((below.size() + kChildren - 1) / kChildren);
    for (std::size_t b = 0; b < below.size(); ++b) {
      Box& box = next[b / kChildren];
      if (b % kChildren == 0) box = below[b];
      for (std::size_t a = 0; a < 3; ++a) {
        box.low[a] = std::min(box.low[a], below[b].low[a]);
        box.high[a] = std::max(box.high[a], below[b].high[a]);
      }
    }
    levels_.push_back(std::move(next));
  }
}

/// No value of a tool within the box is lower: outside it is the distance, inside how deep the box is.
double SweptTool::bound(const Double3& p, const Box& box) const {
  Double3 beyond{};
  double deepest = -std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < 3; ++a) {
    const double over = std::max(box.low[a] - p[a], p[a] - box.high[a]);
    beyond[a] = std::max(0.0, over);
    deepest = std::max(deepest, over);
  }
  return deepest > 0.0 ? norm(beyond) : deepest;
}

SweptTool::Nearest SweptTool::of_tool(const Double3& q) const {
  const double across = std::sqrt(q[0] * q[0] + q[1] * q[1]);
  const Double3 out = across > 0.0 ? Double3{q[0] / across, q[1] / across, 0.0} : Double3{1, 0, 0};
  const double wide = across - (tool_.radius - tool_.rim), low = tool_.rim - q[2];
  Nearest n;
  if (wide <= 0.0 || low <= 0.0) {
    n.value = std::max(wide, low) - tool_.rim;
    n.direction = wide > low ? out : Double3{0, 0, -1};
  } else {
    const double away = std::sqrt(wide * wide + low * low);
    n.value = away - tool_.rim;
    n.direction = out * (wide / away) + Double3{0, 0, -low / away};
  }
  if (const double above = q[2] - tool_.length; above > n.value) n = {above, {0, 0, 1}};
  return n;
}

SweptTool::Nearest SweptTool::of_segment(const Double3& p, std::size_t segment, double below) const {
  const Double3 &a = path_[segment], &b = path_[std::min(segment + 1, path_.size() - 1)];
  const Double3 way = b - a;
  const double length = norm(way);
  const Nearest first = of_tool(p - a);
  if (first.value - length >= below) return first;  // values change no faster than the tool moves
  if (!(length > 0.0) || dot(first.direction, way) <= 0.0) return first;  // it only goes away
  const Nearest last = of_tool(p - b);
  if (0.5 * (first.value + last.value - length) >= below) return last;
  if (dot(last.direction, way) >= 0.0) return last;
  double low = 0.0, high = 1.0;
  Nearest best = first.value < last.value ? first : last;
  for (int i = 0; i < kMostHalvings && (high - low) * length > kExact * tool_.radius; ++i) {
    const double t = 0.5 * (low + high);
    const Nearest n = of_tool(p - (a + way * t));
    if (n.value < best.value) best = n;
    (dot(n.direction, way) > 0.0 ? low : high) = t;
  }
  return best;
}

SweptTool::Nearest SweptTool::nearest(const Double3& p) const {
  struct Entry {
    double bound;
    std::size_t level, index;
  };
  std::array<Entry, kStack> stack;
  std::size_t top = 0;
  stack[top++] = {bound(p, levels_.back()[0]), levels_.size() - 1, 0};
  Nearest best;
  best.value = std::numeric_limits<double>::infinity();
  while (top > 0) {
    const Entry e = stack[--top];
    if (e.bound >= best.value) continue;
    if (e.level == 0) {
      const std::size_t end = std::min(segments_, (e.index + 1) * kLeafSegments);
      for (std::size_t s = e.index * kLeafSegments; s < end; ++s)
        if (const Nearest n = of_segment(p, s, best.value); n.value < best.value) best = n;
      continue;
    }
    const std::vector<Box>& below = levels_[e.level - 1];
    const std::size_t first = top, end = std::min(below.size(), (e.index + 1) * kChildren);
    for (std::size_t c = e.index * kChildren; c < end; ++c) {
      const Entry child = {bound(p, below[c]), e.level - 1, c};
      if (child.bound >= best.value) continue;
      std::size_t at = top++;  // the nearest on top
      for (; at > first && stack[at - 1].bound < child.bound; --at) stack[at] = stack[at - 1];
      stack[at] = child;
    }
  }
  return best;
}

double SweptTool::value(const Double3& p) const {
  return nearest(inverse_.apply(p)).value * scale_;
}

Double3 SweptTool::direction(const Double3& p) const {
  return placement_.turn(nearest(inverse_.apply(p)).direction);
}

bool SweptTool::bounds(Double3& low, Double3& high) const {
  const Box& box = levels_.back()[0];
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
