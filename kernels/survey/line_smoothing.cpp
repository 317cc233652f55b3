#include "kernels/survey/line_smoothing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

constexpr int kRounds = 48;          ///< of moves to the middle; smooths over some ten points
constexpr int kTries = 5;            ///< to mend a line that crosses itself
constexpr std::size_t kAround = 12;  ///< points on either side of a crossing that stay where they were
constexpr double kPieces = 4.0;      ///< pieces of segments are about so many tolerances long,
constexpr double kMaxPieces = 8.0;   ///< but no segment gets more of them

double squared(const Double2& v) {
  return v[0] * v[0] + v[1] * v[1];
}
Double2 minus(const Double2& a, const Double2& b) {
  return {a[0] - b[0], a[1] - b[1]};
}

double point_distance2(const Double2& p, const Double2& a, const Double2& b) {
  const Double2 u = minus(b, a), v = minus(p, a);
  const double length2 = squared(u);
  const double t = length2 > 0.0 ? std::clamp((u[0] * v[0] + u[1] * v[1]) / length2, 0.0, 1.0) : 0.0;
  return squared({v[0] - t * u[0], v[1] - t * u[1]});
}

bool boxes_meet(const Double2& a, const Double2& b, const Double2& c, const Double2& d) {
  for (std::size_t k = 0; k < 2; ++k)
    if (std::max(a[k], b[k]) < std::min(c[k], d[k]) || std::max(c[k], d[k]) < std::min(a[k], b[k]))
      return false;
  return true;
}

bool segments_meet(const Double2& a, const Double2& b, const Double2& c, const Double2& d) {
  return boxes_meet(a, b, c, d) && orient2d_sign(a, b, c) * orient2d_sign(a, b, d) <= 0 &&
         orient2d_sign(c, d, a) * orient2d_sign(c, d, b) <= 0;
}

/// A line with points added.
struct FineLine {
  std::vector<Double2> at;
  std::vector<double> limit;  ///< by point
};

FineLine divided(std::span<const Double2> points, bool closed, std::span<const double> limit,
                 double tolerance) {
  FineLine fine;
  const std::size_t n = points.size(), segments = closed ? n : n - 1;
  for (std::size_t k = 0; k < n; ++k) {
    const bool first = !closed && k == 0, last = !closed && k + 1 == n;
    fine.at.push_back(points[k]);
    fine.limit.push_back(first || last ? 0.0 : std::min(limit[k], limit[(k + segments - 1) % segments]));
    if (k >= segments) continue;
    const Double2 &a = points[k], &b = points[(k + 1) % n];
    const auto pieces = static_cast<int>(
        std::clamp(std::ceil(std::sqrt(squared(minus(b, a))) / (kPieces * tolerance)), 2.0, kMaxPieces));
    for (int i = 1; i < pieces; ++i) {
      const double t = static_cast<double>(i) / pieces;
      fine.at.push_back({a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])});
      fine.limit.push_back(limit[k]);
    }
  }
  return fine;
}

std::vector<Double2> relaxed(const FineLine& line, bool closed) {
  const std::size_t n = line.at.size();
  std::vector<Double2> now = line.at, next = now;
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t k = 0; k < n; ++k) {
      if (line.limit[k] == 0.0 || (!closed && (k == 0 || k + 1 == n))) continue;
      const Double2 &a = now[(k + n - 1) % n], &b = now[(k + 1) % n];
      Double2 off;
      for (std::size_t c = 0; c < 2; ++c) off[c] = 0.5 * now[k][c] + 0.25 * (a[c] + b[c]) - line.at[k][c];
      const double length = std::sqrt(squared(off));
      const double scale = length > line.limit[k] ? line.limit[k] / length : 1.0;
      next[k] = {line.at[k][0] + scale * off[0], line.at[k][1] + scale * off[1]};
    }
    std::swap(now, next);
  }
  return now;
}

double ring_area(std::span<const Double2> ring) {
  double sum = 0.0;
  for (std::size_t k = 2; k < ring.size(); ++k) {
    const Double2 u = minus(ring[k - 1], ring[0]), v = minus(ring[k], ring[0]);
    sum += u[0] * v[1] - u[1] * v[0];
  }
  return sum;
}

}  // namespace

double segment_distance(const Double2& a, const Double2& b, const Double2& c, const Double2& d) {
  if (segments_meet(a, b, c, d)) return 0.0;
  return std::sqrt(std::min({point_distance2(a, c, d), point_distance2(b, c, d), point_distance2(c, a, b),
                             point_distance2(d, a, b)}));
}

std::vector<std::size_t> self_crossings(std::span<const Double2> points, bool closed) {
  const std::size_t n = points.size(), segments = closed ? n : n - 1;
  std::vector<std::size_t> crossing;
  if (n < 3) return crossing;
  const auto end_of = [&](std::size_t k) { return k + 1 < n ? k + 1 : 0; };
  // By cells of a grid about as wide as segments are long.
  Double2 low = points[0], high = points[0];
  double length = 0.0;
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t c = 0; c < 2; ++c) {
      low[c] = std::min(low[c], points[k][c]), high[c] = std::max(high[c], points[k][c]);
      if (k < segments) length += std::abs(points[end_of(k)][c] - points[k][c]);
    }
  const double width = std::max(high[0] - low[0], high[1] - low[1]);
  const double cell = std::max({2.0 * length / static_cast<double>(segments), width / 65536.0, 1e-300});
  struct Entry {
    std::int64_t cell;
    std::size_t segment;
    bool operator<(const Entry& o) const { return cell != o.cell ? cell < o.cell : segment < o.segment; }
  };
  std::vector<Entry> entries;
  const auto index = [&](double at, std::size_t c) {
    return static_cast<std::int64_t>((at - low[c]) / cell);
  };
  for (std::size_t k = 0; k < segments; ++k) {
    const Double2 &a = points[k], &b = points[end_of(k)];
    for (std::int64_t y = index(std::min(a[1], b[1]), 1); y <= index(std::max(a[1], b[1]), 1); ++y)
      for (std::int64_t x = index(std::min(a[0], b[0]), 0); x <= index(std::max(a[0], b[0]), 0); ++x)
        entries.push_back({y * (std::int64_t{1} << 20) + x, k});
  }
  std::sort(entries.begin(), entries.end());
  for (std::size_t i = 0; i < entries.size(); ++i)
    for (std::size_t j = i + 1; j < entries.size() && entries[j].cell == entries[i].cell; ++j) {
      const std::size_t s = entries[i].segment, t = entries[j].segment;
      const Double2 &a = points[s], &b = points[end_of(s)], &c = points[t], &d = points[end_of(t)];
      bool meet = false;
      if (end_of(s) == t || end_of(t) == s) {
        // Neighbours share a point; they fold onto each other where they run back along one line.
        const Double2 &far = end_of(s) == t ? a : b, &joint = end_of(s) == t ? b : a,
                      &other = end_of(s) == t ? d : c;
        const Double2 u = minus(far, joint), v = minus(other, joint);
        meet = orient2d_sign(far, joint, other) == 0 && u[0] * v[0] + u[1] * v[1] > 0.0;
      } else {
        meet = segments_meet(a, b, c, d);
      }
      if (meet) crossing.push_back(s), crossing.push_back(t);
    }
  std::sort(crossing.begin(), crossing.end());
  crossing.erase(std::unique(crossing.begin(), crossing.end()), crossing.end());
  return crossing;
}

std::vector<Double2> smooth_line(std::span<const Double2> points, bool closed, std::span<const double> limit,
                                 double tolerance) {
  std::vector<Double2> same(points.begin(), points.end());
  if (points.size() < (closed ? 4U : 3U)) return same;
  FineLine line = divided(points, closed, limit, tolerance);
  const std::size_t n = line.at.size();
  const double area = closed ? ring_area(points) : 0.0;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    std::vector<Double2> smooth = relaxed(line, closed);
    const std::vector<std::size_t> crossing = self_crossings(smooth, closed);
    if (crossing.empty()) {
      // A loop that shrank to nothing, or turned over.
      if (closed && !(ring_area(smooth) * area > 0.0)) break;
      return smooth;
    }
    for (const std::size_t s : crossing)
      for (std::size_t k = 0; k <= 2 * kAround + 1; ++k) {
        const std::size_t v = s + k;
        if (!closed && (v < kAround || v - kAround >= n)) continue;
        line.limit[(v + n - kAround % n) % n] = 0.0;
      }
  }
  return same;
}

}  // namespace tessera
