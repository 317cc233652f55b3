#include "kernels/reference_gap.h"

#include <immintrin.h>

#include <bit>
#include <cmath>
#include <utility>

namespace tessera {
namespace {

using synth::Vec3;

constexpr float cross2(float ax, float ay, float bx, float by) {
  return ax * by - ay * bx;
}
constexpr double cross2(double ax, double ay, double bx, double by) {
  return ax * by - ay * bx;
}

}  // namespace

ReferenceGap::ReferenceGap(const CollapseMesh& reference) {
  faces_.resize(reference.faces().size());
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    const CollapseFace& from = reference.face(f);
    faces_[f] = {{from.vertex[0], from.vertex[1], from.vertex[2]},
                 0,
                 {from.opposite[0], from.opposite[1], from.opposite[2]},
                 0};
  }
  vertices_.resize(reference.vertices());
  corner_.resize(reference.vertices());
  for (std::uint32_t v = 0; v < vertices_.size(); ++v) {
    vertices_[v] = {reference.at(v), 0, 0};
    corner_[v] = reference.corner(v);
  }
  points_.reserve(1024);
  stack_.reserve(1024);
}

bool ReferenceGap::set_polygon(const RimLoop& loop) {
  size_ = loop.size;
  if (size_ < 3 || size_ >= kPadded) return false;
  Vec3 area{0, 0, 0};
  for (std::size_t i = 1; i + 1 < size_; ++i) area = area + cross(loop.at[i], loop.at[i + 1]);
  const double length2 = dot(area, area);
  if (!(length2 > 0.0)) return false;
  n_ = area * (1.0 / std::sqrt(length2));
  ex_ = synth::any_orthogonal(n_);
  ey_ = cross(n_, ex_);
  std::array<double, kPadded> x, y, z;
  double radius = 0.0;
  for (std::size_t i = 0; i < size_; ++i) {
    x[i] = dot(loop.at[i], ex_);
    y[i] = dot(loop.at[i], ey_);
    z[i] = dot(loop.at[i], n_);
    radius = std::fmax(radius, std::fmax(std::fmax(std::fabs(x[i]), std::fabs(y[i])), std::fabs(z[i])));
  }
  for (std::size_t i = 0; i < size_; ++i) {
    const std::size_t j = i + 1 < size_ ? i + 1 : 0;
    x_[i] = static_cast<float>(x[i]), y_[i] = static_cast<float>(y[i]), z_[i] = static_cast<float>(z[i]);
    edge_x_[i] = static_cast<float>(x[j] - x[i]);
    edge_y_[i] = static_cast<float>(y[j] - y[i]);
    edge_c_[i] = static_cast<float>(cross2(x[j] - x[i], y[j] - y[i], x[i], y[i]));
    if (i == 0 || j == 0) continue;
    // z = sx x + sy y through the origin and both corners.
    const double full = cross2(x[i], y[i], x[j], y[j]);
    slope_x_[i] = static_cast<float>((z[i] * y[j] - z[j] * y[i]) / full);
    slope_y_[i] = static_cast<float>((z[j] * x[i] - z[i] * x[j]) / full);
  }
  groups_ = (size_ + kLanes - 1) / kLanes;
  all_ = (std::uint64_t{1} << size_) - 1;
  sectors_ = all_ & ~std::uint64_t{1} & ~(std::uint64_t{1} << (size_ - 1));
  radius_ = static_cast<float>(radius);
  return true;
}

inline void ReferenceGap::classify(Point& p) const {
  const __m256 px = _mm256_set1_ps(p.x), py = _mm256_set1_ps(p.y), zero = _mm256_setzero_ps();
  p.spokes = p.rims = 0;
  for (std::size_t g = 0; g < groups_; ++g) {
    const std::size_t at = g * kLanes;
    const __m256 spoke =
        _mm256_sub_ps(_mm256_mul_ps(_mm256_load_ps(&x_[at]), py), _mm256_mul_ps(_mm256_load_ps(&y_[at]), px));
    const __m256 rim = _mm256_sub_ps(_mm256_sub_ps(_mm256_mul_ps(_mm256_load_ps(&edge_x_[at]), py),
                                                   _mm256_mul_ps(_mm256_load_ps(&edge_y_[at]), px)),
                                     _mm256_load_ps(&edge_c_[at]));
    p.spokes |= static_cast<std::uint64_t>(_mm256_movemask_ps(_mm256_cmp_ps(spoke, zero, _CMP_GE_OQ))) << at;
    p.rims |= static_cast<std::uint64_t>(_mm256_movemask_ps(_mm256_cmp_ps(rim, zero, _CMP_GE_OQ))) << at;
  }
  p.spokes &= all_;
  p.rims &= all_;
  p.inside = (p.spokes & ~(p.spokes >> 1) & p.rims & sectors_) != 0;
}

/// \return false above the limit
inline bool ReferenceGap::place(std::uint32_t vertex, std::uint32_t& slot) {
  Vertex& v = vertices_[vertex];
  if (v.stamp == stamp_) {
    slot = v.slot;
    return true;
  }
  v.stamp = stamp_;
  slot = v.slot = static_cast<std::uint32_t>(points_.size());
  const Vec3 r = v.at - origin_;
  Point p;
  p.x = static_cast<float>(dot(r, ex_)), p.y = static_cast<float>(dot(r, ey_)),
  p.z = static_cast<float>(dot(r, n_));
  classify(p);
  points_.push_back(p);
  if (!p.inside) return true;
  const auto i = static_cast<std::size_t>(std::countr_zero(p.spokes & ~(p.spokes >> 1) & p.rims & sectors_));
  gap_ = std::fmax(gap_, std::fabs(p.z - slope_x_[i] * p.x - slope_y_[i] * p.y));
  return gap_ <= limit_;
}

/// Whether the segment, with both ends outside, meets the inside of the polygon.
bool ReferenceGap::meets_polygon(const Point& a, const Point& b) const {
  for (std::uint64_t cut = a.rims ^ b.rims; cut != 0; cut &= cut - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    const std::size_t k = j + 1 < size_ ? j + 1 : 0;
    const float sj = cross2(b.x - a.x, b.y - a.y, x_[j] - a.x, y_[j] - a.y);
    const float sk = cross2(b.x - a.x, b.y - a.y, x_[k] - a.x, y_[k] - a.y);
    if ((sj > 0.0f && sk < 0.0f) || (sj < 0.0f && sk > 0.0f)) return true;
  }
  // From one corner of the polygon to another.
  Point middle{0.5f * (a.x + b.x), 0.5f * (a.y + b.y), 0.0f, false, 0, 0};
  classify(middle);
  return middle.inside;
}

/// Crossings of the segment with spokes and rim edges. \return false above the limit
bool ReferenceGap::cross_edges(const Point& a, const Point& b) {
  const float dx = b.x - a.x, dy = b.y - a.y, dz = b.z - a.z;
  const auto cross = [&](float px, float py, float pz, float ux, float uy, float uz) {
    // a + t d = p + s u
    const float turn = cross2(dx, dy, ux, uy);
    const float t = cross2(px - a.x, py - a.y, ux, uy) / turn, s = cross2(px - a.x, py - a.y, dx, dy) / turn;
    if (s >= 0.0f && s <= 1.0f && t >= 0.0f && t <= 1.0f)
      gap_ = std::fmax(gap_, std::fabs(a.z + t * dz - pz - s * uz));
  };
  for (std::uint64_t cut = (a.spokes ^ b.spokes) & sectors_ & ~std::uint64_t{2}; cut != 0; cut &= cut - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    cross(0.0f, 0.0f, 0.0f, x_[j], y_[j], z_[j]);
  }
  for (std::uint64_t cut = a.rims ^ b.rims; cut != 0; cut &= cut - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    const std::size_t k = j + 1 < size_ ? j + 1 : 0;
    cross(x_[j], y_[j], z_[j], edge_x_[j], edge_y_[j], z_[k] - z_[j]);
  }
  return gap_ <= limit_;
}

bool ReferenceGap::measure(const RimLoop& loop, const Vec3& origin, std::uint32_t seed, double limit,
                           double& gap) {
  if (!set_polygon(loop)) return false;
  origin_ = origin;
  const float slack = 16.0f * 0x1p-24f * radius_;
  gap_ = 0.0f;
  limit_ = static_cast<float>(limit) * (1.0f - 0x1p-22f) - slack;
  points_.clear();
  stack_.clear();
  // Stamps: even on the stack, odd done.
  stamp_ += 2;
  const std::uint32_t first = corner_[seed];
  for (std::uint32_t c = first;;) {
    stack_.push_back(c >> 2);
    faces_[c >> 2].stamp = stamp_;
    const std::uint32_t o = faces_[c >> 2].opposite[next_corner(c) & 3u];
    if (o == kNoCorner) return false;
    c = next_corner(o);
    if (c == first) break;
  }
  while (!stack_.empty()) {
    Face& f = faces_[stack_.back()];
    stack_.pop_back();
    f.stamp = stamp_ + 1;
    ++walked_;
    std::array<std::uint32_t, 3> slot;
    for (std::size_t i = 0; i < 3; ++i)
      if (!place(f.vertex[i], slot[i])) return false;
    const Point p[3] = {points_[slot[0]], points_[slot[1]], points_[slot[2]]};
    const float ax = p[1].x - p[0].x, ay = p[1].y - p[0].y, bx = p[2].x - p[0].x, by = p[2].y - p[0].y;
    if (cross2(ax, ay, bx, by) < -slack * (std::fabs(ax) + std::fabs(ay) + std::fabs(bx) + std::fabs(by)))
      return false;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t o = f.opposite[i];
      if (o != kNoCorner && faces_[o >> 2].stamp == stamp_ + 1) continue;  // seen from there
      const Point *from = &p[i == 2 ? 0 : i + 1], *to = &p[i == 0 ? 2 : i - 1];
      if (to->x < from->x) std::swap(from, to);  // the same bits from either side
      const Point &a = *from, &b = *to;
      if (!a.inside && !b.inside && !meets_polygon(a, b)) continue;
      if (o == kNoCorner) return false;
      if ((a.spokes ^ b.spokes) != 0 || (a.rims ^ b.rims) != 0) {
        if (!cross_edges(a, b)) return false;
      }
      Face& across = faces_[o >> 2];
      if (across.stamp != stamp_) {
        across.stamp = stamp_;
        stack_.push_back(o >> 2);
      }
    }
  }
  gap = static_cast<double>(gap_) * (1.0 + 0x1p-22) + static_cast<double>(slack);
  return true;
}

}  // namespace tessera
