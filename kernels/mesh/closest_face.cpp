#include "kernels/mesh/closest_face.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "octree/vector.h"

namespace tessera {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();
constexpr int kCellBits = 10;  // per axis: one block has no more cells that matter
// What is a needle: longer than so many of its heights, and than a share of all there is.
constexpr double kMinNeedle = 16.0, kLongNeedle = 0.25;

/// Of a triangle: its centroid, relative to all of them.
struct Centre {
  std::array<float, 3> at;
  std::uint32_t face;
};

/// Orders so that every leaf, and every node of the levels over them, is a half of what is above it, cut where centroids
/// spread most: along a curve through space, boxes of as many triangles overlap twice as much.
void order_by_halves(std::span<Centre> centres) {
  const std::size_t leaves = (centres.size() + ClosestFaces::kLanes - 1) / ClosestFaces::kLanes;
  if (leaves < 2) return;
  std::array<float, 3> low = centres[0].at, high = low;
  for (const Centre& c : centres)
    for (std::size_t k = 0; k < 3; ++k)
      low[k] = std::min(low[k], c.at[k]), high[k] = std::max(high[k], c.at[k]);
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k)
    if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
  // The first part is full: a power of two.
  const std::size_t first = std::bit_floor(leaves - 1) * ClosestFaces::kLanes;
  std::nth_element(centres.begin(), centres.begin() + static_cast<std::ptrdiff_t>(first), centres.end(),
                   [axis](const Centre& c, const Centre& d) { return c.at[axis] < d.at[axis]; });
  order_by_halves(centres.first(first));
  order_by_halves(centres.subspan(first));
}

/// The longest side of a triangle as an axis from its lower end, by the coordinate that changes most.
struct NeedleAxis {
  Double3 from{}, to{};
  double height = 0.0;

  explicit NeedleAxis(const std::array<Double3, 3>& corner) {
    double maximum = -1.0;
    std::size_t first = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double square = squared_distance(corner[i], corner[(i + 1) % 3]);
      if (square > maximum) maximum = square, first = i;
    }
    from = corner[first], to = corner[(first + 1) % 3];
    const Double3 u = to - from;
    std::size_t axis = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (std::abs(u[k]) > std::abs(u[axis])) axis = k;
    if (u[axis] < 0.0) std::swap(from, to);
    const double length = std::sqrt(maximum);
    height = length > 0.0 ? norm(cross(u, corner[(first + 2) % 3] - from)) / length : 0.0;
  }
  double length() const { return norm(to - from); }
};

/// Six times ten bits: both ends, interleaved.
std::uint64_t needle_code(const NeedleAxis& axis, const Double3& low, double per_cell) {
  std::uint64_t code = 0;
  std::array<std::uint32_t, 6> cell{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto at = [&](double x) {
      return static_cast<std::uint32_t>(
          std::clamp((x - low[k]) * per_cell, 0.0, static_cast<double>((1 << kCellBits) - 1)));
    };
    cell[k] = at(axis.from[k]), cell[3 + k] = at(axis.to[k]);
  }
  for (int bit = kCellBits - 1; bit >= 0; --bit)
    for (const std::uint32_t c : cell) code = code << 1 | (c >> bit & 1u);
  return code;
}

/// Columns of four triangles or one triangle four times, and of one point or four.
struct Lanes {
  __m256d u[3], v[3], uu, k, per_uu, per_vv, per_ac, per_bc;
};

inline __m256d dot_lanes(const __m256d* a, const __m256d* b) {
  return _mm256_fmadd_pd(a[2], b[2], _mm256_fmadd_pd(a[1], b[1], _mm256_mul_pd(a[0], b[0])));
}

/// | q - s u - t v |^2
inline __m256d residual(const Lanes& f, const __m256d* q, __m256d s, __m256d t) {
  __m256d r[3];
  for (int k = 0; k < 3; ++k) r[k] = _mm256_fnmadd_pd(t, f.v[k], _mm256_fnmadd_pd(s, f.u[k], q[k]));
  return dot_lanes(r, r);
}

inline __m256d clamp01(__m256d t) {
  return _mm256_min_pd(_mm256_max_pd(t, _mm256_setzero_pd()), _mm256_set1_pd(1.0));
}

/// Squared distances; q = point - a. The closest of the three sides and, where its foot is inside, the plane.
inline __m256d square_distance(const Lanes& f, const __m256d* q) {
  const __m256d zero = _mm256_setzero_pd(), one = _mm256_set1_pd(1.0);
  const __m256d d1 = dot_lanes(q, f.u), d2 = dot_lanes(q, f.v);
  const __m256d s = _mm256_mul_pd(d1, f.per_uu), t = _mm256_mul_pd(d2, f.per_vv);
  __m256d best = residual(f, q, clamp01(s), zero);
  const __m256d on_ac = clamp01(_mm256_mul_pd(_mm256_fmadd_pd(f.k, d1, d2), f.per_ac));
  best = _mm256_min_pd(best, residual(f, q, _mm256_mul_pd(on_ac, f.k), on_ac));
  const __m256d less = _mm256_sub_pd(f.k, one);  // c - b = (k - 1) u + v
  const __m256d on_bc = clamp01(_mm256_mul_pd(_mm256_fmadd_pd(less, _mm256_sub_pd(d1, f.uu), d2), f.per_bc));
  best = _mm256_min_pd(best, residual(f, q, _mm256_fmadd_pd(on_bc, less, one), on_bc));
  // Inside: t >= 0, s - t k >= 0 and s - t k + t <= 1.
  const __m256d b = _mm256_fnmadd_pd(t, f.k, s);
  const __m256d outside =
      _mm256_or_pd(_mm256_or_pd(_mm256_cmp_pd(b, zero, _CMP_NGE_UQ), _mm256_cmp_pd(t, zero, _CMP_NGE_UQ)),
                   _mm256_cmp_pd(_mm256_add_pd(b, t), one, _CMP_NLE_UQ));
  return _mm256_min_pd(best, _mm256_blendv_pd(residual(f, q, s, t), best, outside));
}

}  // namespace

ClosestFaces::ClosestFaces(std::span<const Double3> position,
                           std::span<const std::array<std::uint32_t, 3>> faces, const Double3& origin)
    : origin_(origin), count_(faces.size()) {
  assert(faces.size() < kNone);
  if (faces.empty()) return;
  Double3 low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (const auto& face : faces)
    for (const std::uint32_t v : face)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], position[v][k] - origin[k]);
        high[k] = std::max(high[k], position[v][k] - origin[k]);
      }
  double extent = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    extent = std::max(extent, high[k] - low[k]);
    largest_ = std::max({largest_, std::abs(low[k]), std::abs(high[k])});
  }
  const double per_cell = extent > 0.0 ? ((1 << kCellBits) - 1) / extent : 0.0;
  const auto corners_of = [&](std::uint32_t i) {
    std::array<Double3, 3> corner;
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 0; k < 3; ++k) corner[c][k] = position[faces[i][c]][k] - origin[k];
    return corner;
  };
  std::vector<Centre> plain;
  plain.reserve(count_);
  std::vector<std::pair<std::uint64_t, std::uint32_t>> needles;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto i = static_cast<std::uint32_t>(f);
    const std::array<Double3, 3> corner = corners_of(i);
    const NeedleAxis axis(corner);
    const double length = axis.length();
    if (length > kLongNeedle * extent && length > kMinNeedle * axis.height) {
      needles.emplace_back(needle_code(axis, low, per_cell), i);
      continue;
    }
    Centre& centre = plain.emplace_back();
    centre.face = i;
    for (std::size_t k = 0; k < 3; ++k)
      centre.at[k] =
          static_cast<float>(((corner[0][k] + corner[1][k] + corner[2][k]) / 3.0 - low[k]) * per_cell);
  }
  order_by_halves(plain);
  std::sort(needles.begin(), needles.end());
  face_.reserve(count_ + kLanes);
  for (const Centre& c : plain) face_.push_back(c.face);
  for (const auto& needle : needles) face_.push_back(needle.second);
  plain_leaves_ = (plain.size() + kLanes - 1) / kLanes;  // the last one may begin the needles
  decltype(plain)().swap(plain);
  decltype(needles)().swap(needles);
  leaves_.resize((count_ + kLanes - 1) / kLanes);
  const std::size_t padded = leaves_.size() * kLanes;
  for (std::size_t slot = 0; slot < padded; ++slot) {
    // The last leaf repeats its last triangle: never closer than the triangle itself.
    store(slot, corners_of(face_[std::min(slot, count_ - 1)]));
  }
  face_.resize(padded, face_.back());
  if (plain_leaves_ > 0) build_nodes();
  if (plain_leaves_ < leaves_.size()) build_needle_nodes();
}

void ClosestFaces::store(std::size_t slot, const std::array<Double3, 3>& corner) {
  Leaf& leaf = leaves_[slot / kLanes];
  const std::size_t lane = slot % kLanes;
  const auto square = [&](std::size_t i) {
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double d = corner[(i + 1) % 3][k] - corner[i][k];
      sum += d * d;
    }
    return sum;
  };
  std::size_t first = 0;
  for (std::size_t i = 1; i < 3; ++i)
    if (square(i) > square(first)) first = i;
  const Double3 &a = corner[first], &b = corner[(first + 1) % 3], &c = corner[(first + 2) % 3];
  double uu = 0.0, uc = 0.0, vv = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    leaf.a[k][lane] = a[k];
    leaf.u[k][lane] = b[k] - a[k];
    uu += leaf.u[k][lane] * leaf.u[k][lane];
    uc += leaf.u[k][lane] * (c[k] - a[k]);
  }
  const double along = uu > 0.0 ? uc / uu : 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    leaf.v[k][lane] = c[k] - a[k] - along * leaf.u[k][lane];
    vv += leaf.v[k][lane] * leaf.v[k][lane];
  }
  const auto per = [](double x) { return x > 0.0 && std::isfinite(1.0 / x) ? 1.0 / x : 0.0; };
  leaf.uu[lane] = uu;
  leaf.k[lane] = along;
  leaf.per_uu[lane] = per(uu);
  leaf.per_vv[lane] = per(vv);
  leaf.per_ac[lane] = per(along * along * uu + vv);
  leaf.per_bc[lane] = per((along - 1.0) * (along - 1.0) * uu + vv);
}

std::array<Double3, 3> ClosestFaces::corners(std::uint32_t slot) const {
  const Leaf& leaf = leaves_[slot / kLanes];
  const std::size_t lane = slot % kLanes;
  std::array<Double3, 3> c;
  for (std::size_t k = 0; k < 3; ++k) {
    c[0][k] = leaf.a[k][lane];
    c[1][k] = leaf.a[k][lane] + leaf.u[k][lane];
    c[2][k] = leaf.a[k][lane] + leaf.k[lane] * leaf.u[k][lane] + leaf.v[k][lane];
  }
  return c;
}

void ClosestFaces::build_nodes() {
  const auto margin = static_cast<float>(0x1p-21 * largest_);
  std::size_t below = plain_leaves_;
  do {
    std::vector<Node> nodes((below + 7) / 8);
    for (Node& node : nodes)
      for (std::size_t k = 0; k < 3; ++k) {
        std::fill_n(node.low[k], 8, kFar);
        std::fill_n(node.high[k], 8, -kFar);
      }
    for (std::size_t child = 0; child < below; ++child) {
      Node& node = nodes[child / 8];
      const std::size_t lane = child % 8;
      for (std::size_t k = 0; k < 3; ++k) {
        float low = kFar, high = -kFar;
        if (levels_.empty()) {
          const Leaf& leaf = leaves_[child];
          for (std::size_t j = 0; j < kLanes; ++j) {
            const double a = leaf.a[k][j], b = a + leaf.u[k][j],
                         c = a + leaf.k[j] * leaf.u[k][j] + leaf.v[k][j];
            low = std::min(low, static_cast<float>(std::min({a, b, c})) - margin);
            high = std::max(high, static_cast<float>(std::max({a, b, c})) + margin);
          }
        } else {
          const Node& sub = levels_.back()[child];
          low = *std::min_element(sub.low[k], sub.low[k] + 8);
          high = *std::max_element(sub.high[k], sub.high[k] + 8);
        }
        node.low[k][lane] = low;
        node.high[k][lane] = high;
      }
    }
    below = nodes.size();
    levels_.push_back(std::move(nodes));
  } while (below > 1);
}

/// Around the needles of the leaves from `first` to `end`: a segment along their mean, and how far off it they start and end.
void ClosestFaces::bound_needles(std::size_t first, std::size_t end, NeedleNode& node,
                                 std::size_t lane) const {
  const auto for_needles = [&](const auto& use) {
    for (std::size_t slot = first * kLanes; slot < end * kLanes; ++slot)
      use(NeedleAxis(corners(static_cast<std::uint32_t>(slot))));
  };
  Double3 from{}, to{};
  for_needles([&](const NeedleAxis& axis) { from = from + axis.from, to = to + axis.to; });
  const double share = 1.0 / static_cast<double>((end - first) * kLanes);
  from = from * share, to = to * share;
  const Double3 along = unit_or_zero(to - from);
  // Ends may lie before and behind the mean ones.
  double low = 0.0, high = norm(to - from), start = 0.0, stop = 0.0, height = 0.0;
  const auto off = [&](const Double3& p) {
    const Double3 d = p - from;
    const double at = dot(d, along);
    return std::pair(at, norm(d - along * at));
  };
  for_needles([&](const NeedleAxis& axis) {
    const auto [at_from, off_from] = off(axis.from);
    const auto [at_to, off_to] = off(axis.to);
    low = std::min({low, at_from, at_to}), high = std::max({high, at_from, at_to});
    start = std::max(start, off_from), stop = std::max(stop, off_to);
    height = std::max(height, axis.height);
  });
  const double length = high - low;
  double more = 0.0;  // where the hull is thinner than at the ends
  for_needles([&](const NeedleAxis& axis) {
    for (const Double3& p : {axis.from, axis.to}) {
      const auto [at, aside] = off(p);
      const double t = length > 0.0 ? (at - low) / length : 0.0;
      more = std::max(more, aside - (start + t * (stop - start)));
    }
  });
  more += height + 0x1p-40 * largest_;
  const double growth = stop - start, square = length * length;
  for (std::size_t k = 0; k < 3; ++k) {
    node.from[k][lane] = from[k] + low * along[k];
    node.along[k][lane] = length * along[k];
  }
  node.per_square[lane] = square > 0x1p-100 ? 1.0 / square : 0.0;
  node.radius[lane] = start + more;
  node.growth[lane] = growth;
  node.maximum[lane] = std::max(start, stop) + more;
  node.slope[lane] =
      std::sqrt(std::max(0.0, 1.0 - growth * growth * node.per_square[lane])) * (1.0 - 0x1p-40);
}

void ClosestFaces::build_needle_nodes() {
  const std::size_t leaves = leaves_.size() - plain_leaves_;
  std::size_t below = leaves, each = 1;  // children, and the leaves of each
  do {
    std::vector<NeedleNode> nodes((below + 7) / 8);
    for (NeedleNode& node : nodes) {
      node = NeedleNode{};
      std::fill_n(node.radius, 8, -std::numeric_limits<double>::infinity());
      std::fill_n(node.maximum, 8, -std::numeric_limits<double>::infinity());
    }
    for (std::size_t child = 0; child < below; ++child)
      bound_needles(plain_leaves_ + child * each, plain_leaves_ + std::min(leaves, (child + 1) * each),
                    nodes[child / 8], child % 8);
    below = nodes.size();
    each *= 8;
    needle_levels_.push_back(std::move(nodes));
  } while (below > 1);
}

double ClosestFaces::square_to(std::uint32_t slot, const Double3& p) const {
  alignas(32) double x[kLanes] = {p[0], p[0], p[0], p[0]}, y[kLanes] = {p[1], p[1], p[1], p[1]},
                     z[kLanes] = {p[2], p[2], p[2], p[2]}, square[kLanes];
  squares_to(slot, x, y, z, 1, square);
  return square[0];
}

void ClosestFaces::squares_to(std::uint32_t slot, const double* x, const double* y, const double* z,
                              int count, double* square) const {
  const Leaf& leaf = leaves_[slot / kLanes];
  const std::size_t lane = slot % kLanes;
  const auto all = [&](const double* column) { return _mm256_broadcast_sd(column + lane); };
  Lanes f;
  __m256d a[3];
  for (std::size_t k = 0; k < 3; ++k) {
    a[k] = all(leaf.a[k]);
    f.u[k] = all(leaf.u[k]);
    f.v[k] = all(leaf.v[k]);
  }
  f.uu = all(leaf.uu), f.k = all(leaf.k), f.per_uu = all(leaf.per_uu), f.per_vv = all(leaf.per_vv);
  f.per_ac = all(leaf.per_ac), f.per_bc = all(leaf.per_bc);
  for (int i = 0; i < count; i += kLanes) {
    const __m256d q[3] = {_mm256_sub_pd(_mm256_loadu_pd(x + i), a[0]),
                          _mm256_sub_pd(_mm256_loadu_pd(y + i), a[1]),
                          _mm256_sub_pd(_mm256_loadu_pd(z + i), a[2])};
    _mm256_storeu_pd(square + i, square_distance(f, q));
  }
}

/// Squares of lower bounds of the distances. Of a point at height h over the line and its foot at t the hull of balls around
/// c(s) of radius r(s) = r + s g is at least min |p - c(s)| - r(s) = h sqrt(1 - (g / L)^2) - r(t) away, ends or no ends,
/// and the segment's distance less the larger radius.
void ClosestFaces::needle_squares(const NeedleNode& node, const Double3& p, float* square) {
  const __m256d zero = _mm256_setzero_pd();
  for (std::size_t i = 0; i < 2; ++i) {
    const std::size_t at = 4 * i;
    __m256d q[3], u[3];
    for (std::size_t k = 0; k < 3; ++k) {
      u[k] = _mm256_load_pd(node.along[k] + at);
      q[k] = _mm256_sub_pd(_mm256_set1_pd(p[k]), _mm256_load_pd(node.from[k] + at));
    }
    const __m256d t = _mm256_mul_pd(dot_lanes(q, u), _mm256_load_pd(node.per_square + at)), on = clamp01(t);
    __m256d line[3], segment[3];
    for (std::size_t k = 0; k < 3; ++k) {
      line[k] = _mm256_fnmadd_pd(t, u[k], q[k]);
      segment[k] = _mm256_fnmadd_pd(on, u[k], q[k]);
    }
    const __m256d height = _mm256_sqrt_pd(dot_lanes(line, line)),
                  distance = _mm256_sqrt_pd(dot_lanes(segment, segment));
    const __m256d cone =
        _mm256_sub_pd(_mm256_mul_pd(height, _mm256_load_pd(node.slope + at)),
                      _mm256_fmadd_pd(t, _mm256_load_pd(node.growth + at), _mm256_load_pd(node.radius + at)));
    const __m256d gap =
        _mm256_max_pd(_mm256_max_pd(cone, _mm256_sub_pd(distance, _mm256_load_pd(node.maximum + at))), zero);
    _mm_store_ps(square + at,
                 _mm256_cvtpd_ps(_mm256_mul_pd(_mm256_mul_pd(gap, gap), _mm256_set1_pd(1.0 - 0x1p-20))));
  }
}

ClosestFaces::Hit ClosestFaces::closest(const Double3& p, double limit_square, std::uint32_t hint) const {
  Hit best{limit_square, kNone};
  if (count_ == 0) return best;
  if (hint != kNone) {
    const double square = square_to(hint, p);
    if (square < best.square) best = {square, hint};
  }
  // Rounded up a little: a box is skipped only when it is surely no closer.
  const auto bound = [](double square) {
    if (square >= 0x1p120)
      return std::numeric_limits<float>::max();  // lanes without a child are farther still
    return static_cast<float>(square) * (1.0f + 0x1p-20f) + std::numeric_limits<float>::min();
  };
  const __m256 zero = _mm256_setzero_ps();
  const __m256 x = _mm256_set1_ps(static_cast<float>(p[0])), y = _mm256_set1_ps(static_cast<float>(p[1])),
               z = _mm256_set1_ps(static_cast<float>(p[2]));
  const __m256d point[3] = {_mm256_set1_pd(p[0]), _mm256_set1_pd(p[1]), _mm256_set1_pd(p[2])};
  struct Entry {
    float square;
    std::uint32_t level, index;
  };
  constexpr std::uint32_t kNeedles = 0x80000000u;  // with the level, of their hierarchy
  std::array<Entry, 8 * 16> stack;
  std::size_t top = 0;
  if (!needle_levels_.empty())
    stack[top++] = {0.0f, static_cast<std::uint32_t>(needle_levels_.size()) | kNeedles, 0};
  if (!levels_.empty()) stack[top++] = {0.0f, static_cast<std::uint32_t>(levels_.size()), 0};
  float limit = bound(best.square);
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.square > limit) continue;
    if (entry.level == 0) {
      const Leaf& leaf = leaves_[entry.index];
      Lanes f;
      __m256d q[3];
      for (std::size_t k = 0; k < 3; ++k) {
        q[k] = _mm256_sub_pd(point[k], _mm256_load_pd(leaf.a[k]));
        f.u[k] = _mm256_load_pd(leaf.u[k]);
        f.v[k] = _mm256_load_pd(leaf.v[k]);
      }
      f.uu = _mm256_load_pd(leaf.uu), f.k = _mm256_load_pd(leaf.k);
      f.per_uu = _mm256_load_pd(leaf.per_uu), f.per_vv = _mm256_load_pd(leaf.per_vv);
      f.per_ac = _mm256_load_pd(leaf.per_ac), f.per_bc = _mm256_load_pd(leaf.per_bc);
      alignas(32) double square[kLanes];
      _mm256_store_pd(square, square_distance(f, q));
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const auto slot = static_cast<std::uint32_t>(entry.index * kLanes + lane);
        if (square[lane] < best.square ||
            (square[lane] == best.square && best.slot != kNone && face_[slot] < face_[best.slot])) {
          best = {square[lane], slot};
          limit = bound(best.square);
        }
      }
      continue;
    }
    const bool needles = (entry.level & kNeedles) != 0;
    const std::uint32_t level = entry.level & ~kNeedles;
    alignas(32) float gaps[8];
    if (needles) {
      needle_squares(needle_levels_[level - 1][entry.index], p, gaps);
    } else {
      const Node& node = levels_[level - 1][entry.index];
      const auto gap = [&](__m256 at, const float* low, const float* high) {
        return _mm256_max_ps(
            _mm256_max_ps(_mm256_sub_ps(_mm256_load_ps(low), at), _mm256_sub_ps(at, _mm256_load_ps(high))),
            zero);
      };
      const __m256 gx = gap(x, node.low[0], node.high[0]), gy = gap(y, node.low[1], node.high[1]),
                   gz = gap(z, node.low[2], node.high[2]);
      _mm256_store_ps(gaps, _mm256_fmadd_ps(gz, gz, _mm256_fmadd_ps(gy, gy, _mm256_mul_ps(gx, gx))));
    }
    auto near = static_cast<unsigned>(
        _mm256_movemask_ps(_mm256_cmp_ps(_mm256_load_ps(gaps), _mm256_set1_ps(limit), _CMP_LE_OQ)));
    // Where the children begin and how many there are, of both hierarchies.
    const std::size_t begin = needles && level == 1 ? plain_leaves_ : 0,
                      end = needles ? leaves_.size() : plain_leaves_;
    const std::size_t first = top;
    for (; near != 0; near &= near - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(near));
      const Entry child{gaps[lane], level == 1 ? 0u : (level - 1) | (needles ? kNeedles : 0u),
                        static_cast<std::uint32_t>(begin) + entry.index * 8 + lane};
      if (child.level == 0 && child.index >= end) continue;
      std::size_t at = top++;
      for (; at > first && stack[at - 1].square < child.square; --at) stack[at] = stack[at - 1];
      stack[at] = child;
    }
  }
  return best;
}

}  // namespace tessera
