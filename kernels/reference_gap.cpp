#include "kernels/reference_gap.h"

#include <bit>
#include <cmath>

namespace tessera {
namespace {

using synth::Vec3;

constexpr double cross2(double ax, double ay, double bx, double by) {
  return ax * by - ay * bx;
}

}  // namespace

ReferenceGap::ReferenceGap(const CollapseMesh& reference)
    : reference_(reference),
      vertex_stamp_(reference.position.size(), 0),
      vertex_slot_(reference.position.size(), 0),
      face_stamp_(reference.face_state.size(), 0) {}

/// The height of the star above or below p. \return false outside the polygon
bool ReferenceGap::inside(const Point& p, double& height) const {
  for (std::size_t i = 1; i + 1 < size_; ++i) {
    if (!(p.spokes >> i & 1) || (p.spokes >> (i + 1) & 1) || !(p.rims >> i & 1)) continue;
    const double before = cross2(x_[i], y_[i], p.x, p.y), after = cross2(p.x, p.y, x_[i + 1], y_[i + 1]);
    const double full = cross2(x_[i], y_[i], x_[i + 1], y_[i + 1]);
    height = (z_[i] * after + z_[i + 1] * before) / full;
    return true;
  }
  return false;
}

/// \return false above the limit
bool ReferenceGap::place(std::uint32_t vertex, std::uint32_t& slot) {
  if (vertex_stamp_[vertex] == stamp_) {
    slot = vertex_slot_[vertex];
    return true;
  }
  vertex_stamp_[vertex] = stamp_;
  slot = vertex_slot_[vertex] = static_cast<std::uint32_t>(points_.size());
  const Double3& q = reference_.position[vertex];
  const Vec3 r = Vec3{q[0], q[1], q[2]} - origin_;
  Point p{dot(r, ex_), dot(r, ey_), dot(r, n_), 0, 0, false};
  for (std::size_t j = 1; j < size_; ++j) {
    const std::size_t k = j + 1 < size_ ? j + 1 : 0;
    if (cross2(x_[j], y_[j], p.x, p.y) >= 0.0) p.spokes |= std::uint64_t{1} << j;
    if (cross2(x_[k] - x_[j], y_[k] - y_[j], p.x - x_[j], p.y - y_[j]) >= 0.0)
      p.rims |= std::uint64_t{1} << j;
  }
  if (cross2(x_[1], y_[1], p.x, p.y) >= 0.0) p.rims |= 1;
  double height = 0.0;
  p.inside = inside(p, height);
  points_.push_back(p);
  if (p.inside) {
    gap_ = std::fmax(gap_, std::fabs(p.z - height));
    if (gap_ > limit_) return false;
  }
  return true;
}

/// Whether the segment, with both ends outside, crosses the polygon.
bool ReferenceGap::meets_polygon(const Point& a, const Point& b) const {
  std::uint64_t cut = a.rims ^ b.rims;
  while (cut != 0) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    cut &= cut - 1;
    const std::size_t k = j + 1 < size_ ? j + 1 : 0;
    const double sj = cross2(b.x - a.x, b.y - a.y, x_[j] - a.x, y_[j] - a.y);
    const double sk = cross2(b.x - a.x, b.y - a.y, x_[k] - a.x, y_[k] - a.y);
    if ((sj > rounding_ && sk < -rounding_) || (sj < -rounding_ && sk > rounding_)) return true;
  }
  return false;
}

/// Crossings of the segment with spokes and rim edges. \return false above the limit
bool ReferenceGap::cross_edges(const Point& a, const Point& b) {
  const double dx = b.x - a.x, dy = b.y - a.y, dz = b.z - a.z;
  const auto cross = [&](double px, double py, double pz, double ux, double uy, double uz) {
    // a + t d = p + s u
    const double turn = cross2(dx, dy, ux, uy);
    const double t = cross2(px - a.x, py - a.y, ux, uy) / turn, s = cross2(px - a.x, py - a.y, dx, dy) / turn;
    if (s >= 0.0 && s <= 1.0 && t >= 0.0 && t <= 1.0)
      gap_ = std::fmax(gap_, std::fabs(a.z + t * dz - pz - s * uz));
  };
  for (std::uint64_t cut = a.spokes ^ b.spokes; cut != 0; cut &= cut - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    if (j >= 2 && j + 1 < size_) cross(0.0, 0.0, 0.0, x_[j], y_[j], z_[j]);
  }
  for (std::uint64_t cut = a.rims ^ b.rims; cut != 0; cut &= cut - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    const std::size_t k = j + 1 < size_ ? j + 1 : 0;
    cross(x_[j], y_[j], z_[j], x_[k] - x_[j], y_[k] - y_[j], z_[k] - z_[j]);
  }
  return gap_ <= limit_;
}

bool ReferenceGap::measure(const RimLoop& loop, const Vec3& origin, std::uint32_t seed, double limit,
                           double& gap) {
  size_ = loop.size;
  if (size_ < 3 || size_ > 62) return false;
  Vec3 area{0, 0, 0};
  for (std::size_t i = 1; i + 1 < size_; ++i) area = area + cross(loop.at[i], loop.at[i + 1]);
  const double length2 = dot(area, area);
  if (!(length2 > 0.0)) return false;
  n_ = area * (1.0 / std::sqrt(length2));
  ex_ = synth::any_orthogonal(n_);
  ey_ = cross(n_, ex_);
  origin_ = origin;
  for (std::size_t i = 0; i < size_; ++i) {
    x_[i] = dot(loop.at[i], ex_);
    y_[i] = dot(loop.at[i], ey_);
    z_[i] = dot(loop.at[i], n_);
  }
  gap_ = 0.0;
  limit_ = limit;
  rounding_ = 1e-12 * std::sqrt(length2);
  points_.clear();
  stack_.clear();
  // Stamps: even on the stack, odd done.
  stamp_ += 2;
  const std::uint32_t first = reference_.corner[seed];
  std::uint32_t c = first;
  for (;;) {
    stack_.push_back(c / 3);
    face_stamp_[c / 3] = stamp_;
    const std::uint32_t o = reference_.opposite[next_corner(c)];
    if (o == kNoCorner) return false;
    c = next_corner(o);
    if (c == first) break;
  }
  while (!stack_.empty()) {
    const std::uint32_t f = stack_.back();
    stack_.pop_back();
    face_stamp_[f] = stamp_ + 1;
    ++walked_;
    std::array<std::uint32_t, 3> slot;
    for (std::size_t i = 0; i < 3; ++i)
      if (!place(reference_.vertex[3 * f + i], slot[i])) return false;
    const Point p[3] = {points_[slot[0]], points_[slot[1]], points_[slot[2]]};
    if (cross2(p[1].x - p[0].x, p[1].y - p[0].y, p[2].x - p[0].x, p[2].y - p[0].y) < -rounding_) return false;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t o = reference_.opposite[3 * f + i];
      if (o != kNoCorner && face_stamp_[o / 3] == stamp_ + 1) continue;  // seen from there
      const Point &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
      if (!a.inside && !b.inside && !meets_polygon(a, b)) continue;
      if (o == kNoCorner) return false;
      if (!cross_edges(a, b)) return false;
      if (face_stamp_[o / 3] != stamp_) {
        face_stamp_[o / 3] = stamp_;
        stack_.push_back(o / 3);
      }
    }
  }
  gap = gap_;
  return true;
}

}  // namespace tessera
