#include "stream/check/truth_features.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

namespace tessera {

double squared_distance(const Double3& p, const Double3& a, const Double3& b, const Double3& c) {
  const auto to_segment = [&p](const Double3& s, const Double3& e) {
    const Double3 d = e - s;
    const double dd = dot(d, d);
    const double t = dd > 0.0 ? std::clamp(dot(p - s, d) / dd, 0.0, 1.0) : 0.0;
    const Double3 r = p - (s + d * t);
    return dot(r, r);
  };
  const Double3 n = cross(b - a, c - a);
  const double nn = dot(n, n);
  if (nn > 0.0) {
    const bool inside = dot(cross(b - a, p - a), n) >= 0.0 && dot(cross(c - b, p - b), n) >= 0.0 &&
                        dot(cross(a - c, p - c), n) >= 0.0;
    const double height = dot(p - a, n);
    if (inside) return height * height / nn;
  }
  return std::min({to_segment(a, b), to_segment(b, c), to_segment(c, a)});
}

NearestTracker::NearestTracker(std::vector<Double3> points, double max_distance)
    : max_distance_(max_distance) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  lo_ = {kInf, kInf, kInf};
  hi_ = {-kInf, -kInf, -kInf};
  for (const Double3& p : points) {
    lo_ = {std::min(lo_[0], p[0]), std::min(lo_[1], p[1]), std::min(lo_[2], p[2])};
    hi_ = {std::max(hi_[0], p[0]), std::max(hi_[1], p[1]), std::max(hi_[2], p[2])};
  }
  if (points.empty()) lo_ = hi_ = {};
  const Double3 extent = hi_ - lo_;
  // 20 bits an axis are enough: cells no smaller than a millionth of the extent.
  cell_ = std::max({max_distance, extent[0] * 1e-6, extent[1] * 1e-6, extent[2] * 1e-6});
  if (!(cell_ > 0.0)) cell_ = 1.0;
  std::vector<std::pair<std::uint64_t, std::size_t>> order;
  const auto index = [this](double v, double lo) {
    return static_cast<std::int64_t>(std::floor((v - lo) / cell_));
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Double3& p = points[i];
    order.emplace_back(key(index(p[0], lo_[0]), index(p[1], lo_[1]), index(p[2], lo_[2])), i);
  }
  std::sort(order.begin(), order.end());
  for (const auto& [k, i] : order) {
    keys_.push_back(k);
    points_.push_back(points[i]);
  }
  squared_.assign(points_.size(), max_distance * max_distance);
}

std::uint64_t NearestTracker::key(std::int64_t i, std::int64_t j, std::int64_t k) const {
  return static_cast<std::uint64_t>(k) << 42 | static_cast<std::uint64_t>(j) << 21 |
         static_cast<std::uint64_t>(i);
}

void NearestTracker::take(const Double3& a, const Double3& b, const Double3& c) {
  if (points_.empty()) return;
  const auto range = [this](double u, double v, double w, double lo, double hi, std::int64_t& from,
                            std::int64_t& to) {
    const double minimum = std::max(std::min({u, v, w}) - max_distance_, lo),
                 maximum = std::min(std::max({u, v, w}) + max_distance_, hi);
    if (!(minimum <= maximum)) return false;
    from = static_cast<std::int64_t>(std::floor((minimum - lo) / cell_));
    to = static_cast<std::int64_t>(std::floor((maximum - lo) / cell_));
    return true;
  };
  std::int64_t i0, i1, j0, j1, k0, k1;
  if (!range(a[0], b[0], c[0], lo_[0], hi_[0], i0, i1) || !range(a[1], b[1], c[1], lo_[1], hi_[1], j0, j1) ||
      !range(a[2], b[2], c[2], lo_[2], hi_[2], k0, k1)) {
    return;
  }
  for (std::int64_t k = k0; k <= k1; ++k) {
    for (std::int64_t j = j0; j <= j1; ++j) {
      // A row of cells is a run of keys.
      const auto first = std::lower_bound(keys_.begin(), keys_.end(), key(i0, j, k));
      const std::uint64_t last = key(i1, j, k);
      for (auto at = first; at != keys_.end() && *at <= last; ++at) {
        const auto i = static_cast<std::size_t>(at - keys_.begin());
        squared_[i] = std::min(squared_[i], squared_distance(points_[i], a, b, c));
      }
    }
  }
}

double NearestTracker::distance(std::size_t i) const {
  return std::sqrt(squared_[i]);
}

void SharpEdges::add(const std::uint64_t (&corners)[3], const Double3& normal) {
  for (int e = 0; e < 3; ++e) {
    const std::uint64_t a = corners[e], b = corners[(e + 1) % 3];
    sides_.push_back(
        {std::min(a, b),
         std::max(a, b),
         {static_cast<float>(normal[0]), static_cast<float>(normal[1]), static_cast<float>(normal[2])}});
  }
}

std::vector<SharpEdges::Edge> SharpEdges::find() {
  const auto name = [](const Side& s) { return std::tie(s.a, s.b, s.n[0], s.n[1], s.n[2]); };
  std::sort(sides_.begin(), sides_.end(), [&](const Side& x, const Side& y) { return name(x) < name(y); });
  std::vector<Edge> sharp;
  for (std::size_t i = 0; i < sides_.size();) {
    std::size_t end = i + 1;
    while (end < sides_.size() && sides_[end].a == sides_[i].a && sides_[end].b == sides_[i].b) ++end;
    if (end - i == 2) {
      double cosine = 0.0;
      for (int axis = 0; axis < 3; ++axis)
        cosine += double{sides_[i].n[axis]} * double{sides_[i + 1].n[axis]};
      if (cosine < min_cosine_) sharp.push_back({sides_[i].a, sides_[i].b});
    }
    i = end;
  }
  return sharp;
}

}  // namespace tessera
