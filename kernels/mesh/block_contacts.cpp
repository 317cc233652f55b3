#include "kernels/mesh/block_contacts.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "kernels/mesh/face_planes.h"
#include "kernels/mesh/orientation_sign.h"
#include "octree/morton.h"

namespace tessera {
namespace {

constexpr std::size_t kLanes = 8;  ///< boxes of a bundle: compared with one in a few instructions

/// Boxes side by side, in floats rounded outwards; those that are missing meet nothing.
struct BoxBundle {
  alignas(32) std::array<std::array<float, kLanes>, 3> low, high;
  BoxBundle() {
    for (auto& axis : low) axis.fill(std::numeric_limits<float>::infinity());
    for (auto& axis : high) axis.fill(-std::numeric_limits<float>::infinity());
  }
};

struct FloatBox {
  Float3 low, high;
};

FloatBox around(const BoxBundle& boxes) {
  FloatBox b;
  for (std::size_t k = 0; k < 3; ++k) {
    const __m128 low = _mm_min_ps(_mm_load_ps(&boxes.low[k][0]), _mm_load_ps(&boxes.low[k][4])),
                 high = _mm_max_ps(_mm_load_ps(&boxes.high[k][0]), _mm_load_ps(&boxes.high[k][4]));
    const __m128 low2 = _mm_min_ps(low, _mm_movehl_ps(low, low)),
                 high2 = _mm_max_ps(high, _mm_movehl_ps(high, high));
    b.low[k] = _mm_cvtss_f32(_mm_min_ss(low2, _mm_movehdup_ps(low2)));
    b.high[k] = _mm_cvtss_f32(_mm_max_ss(high2, _mm_movehdup_ps(high2)));
  }
  return b;
}

void put(BoxBundle& boxes, std::size_t lane, const FloatBox& b) {
  for (std::size_t k = 0; k < 3; ++k) boxes.low[k][lane] = b.low[k], boxes.high[k][lane] = b.high[k];
}

FloatBox lane(const BoxBundle& boxes, std::size_t l) {
  FloatBox b;
  for (std::size_t k = 0; k < 3; ++k) b.low[k] = boxes.low[k][l], b.high[k] = boxes.high[k][l];
  return b;
}

/// A bit for each box that meets this one.
unsigned meeting(const BoxBundle& boxes, const FloatBox& b) {
  __m256 apart = _mm256_setzero_ps();
#pragma GCC unroll 3
  for (std::size_t k = 0; k < 3; ++k) {
    const __m256 low = _mm256_load_ps(boxes.low[k].data()), high = _mm256_load_ps(boxes.high[k].data());
    apart = _mm256_or_ps(apart, _mm256_cmp_ps(low, _mm256_set1_ps(b.high[k]), _CMP_GT_OQ));
    apart = _mm256_or_ps(apart, _mm256_cmp_ps(high, _mm256_set1_ps(b.low[k]), _CMP_LT_OQ));
  }
  return ~static_cast<unsigned>(_mm256_movemask_ps(apart)) & 0xffu;
}

/// The faces that may meet others. Seen along an axis, a block is cut into cells. Where all faces that touch a cell look one
/// way, none of their edges there is without exactly one other face, and one point of it is covered at most once, all of it is:
/// the projection is a covering there without branches, so faces have in common what they share. What is left are places where
/// the block folds, is steep, ends, or lies over itself: of a terrain its border. Signs are certain, what is in doubt is left.
/// The culling by regions of one normal cone and one contour (Volino and Magnenat-Thalmann 1994), without a contour to test.
template <class Faces>
class SheetCells {
 public:
  explicit SheetCells(Faces faces) : faces_(faces) {
    if (faces.size() < kMinFaces || !find_axis()) return;
    useful_ = mark_faces() && mark_borders();
  }
  /// Numbers of the faces that may meet others; false: so many that all may as well be asked.
  bool doubtful(std::vector<std::uint32_t>& some) const {
    if (!useful_) return false;
    for (std::uint32_t f = 0; f < faces_.size() && some.size() <= faces_.size() / 2; ++f)
      if (any_doubt(ranges_[f])) some.push_back(f);
    return some.size() <= faces_.size() / 2;
  }

 private:
  static constexpr std::size_t kMinFaces = 256;
  static constexpr std::size_t kCellFaces = 12, kMaxPerAxis = 4096;
  static constexpr std::size_t kMaxVisits =
      16;  ///< of cells, a face: needles across all of the block are not worth it
  static constexpr std::size_t kAxisStep = 8;  ///< faces of large blocks that are asked where they look
  static constexpr double kMinOneWay = 0.6;    ///< of the area, seen along the axis
  static constexpr double kSure = 1e-14;       ///< of the terms of a determinant: more than their rounding
  static constexpr double kSample = 0.61803398874989485;  ///< where a cell is asked how often it is covered
  static constexpr std::uint8_t kDoubt = 2;               ///< from so many on
  struct Range {
    std::uint16_t x0, y0, x1, y1;
  };

  bool find_axis() {
    Double3 sum{}, all{}, low = faces_.corner(0, 0), high = low;
    const std::size_t step = faces_.size() > 64 * kMinFaces ? kAxisStep : 1;
    for (std::size_t f = 0; f < faces_.size(); f += step) {
      const Double3 &a = faces_.corner(f, 0), &b = faces_.corner(f, 1), &c = faces_.corner(f, 2);
      const Double3 n = cross(b - a, c - a);
      for (std::size_t k = 0; k < 3; ++k) sum[k] += n[k], all[k] += std::fabs(n[k]);
    }
    const __m256i three = _mm256_setr_epi64x(-1, -1, -1, 0);
    __m256d lowest = _mm256_maskload_pd(low.data(), three), highest = lowest;
    for (std::size_t f = 0; f < faces_.size(); ++f)
      for (std::size_t k = 0; k < 3; ++k) {
        const __m256d at = _mm256_maskload_pd(faces_.corner(f, k).data(), three);
        lowest = _mm256_min_pd(lowest, at), highest = _mm256_max_pd(highest, at);
      }
    _mm256_maskstore_pd(low.data(), three, lowest), _mm256_maskstore_pd(high.data(), three, highest);
    std::size_t axis = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (std::fabs(sum[k]) > std::fabs(sum[axis])) axis = k;
    if (!(std::fabs(sum[axis]) > kMinOneWay * all[axis])) return false;
    x_ = (axis + 1) % 3, y_ = (axis + 2) % 3;
    if (sum[axis] < 0.0) std::swap(x_, y_);
    low_ = {low[x_], low[y_]};
    const double width = high[x_] - low[x_], height = high[y_] - low[y_];
    const double cells = static_cast<double>(faces_.size()) / static_cast<double>(kCellFaces);
    const double edge = std::max(std::sqrt(width * height / cells), std::max(width, height) / kMaxPerAxis);
    // Far from zero a sample might be rounded out of its cell.
    const double far =
        std::max({std::fabs(low[x_]), std::fabs(low[y_]), std::fabs(high[x_]), std::fabs(high[y_])});
    if (!(width > 0.0 && height > 0.0 && edge > 0x1p-40 * far && std::isfinite(edge))) return false;
    edge_ = edge, per_edge_ = 1.0 / edge;
    if (!std::isfinite(per_edge_)) return false;
    size_ = {static_cast<std::size_t>(width * per_edge_) + 1,
             static_cast<std::size_t>(height * per_edge_) + 1};
    marks_.assign(size_[0] * size_[1], 0);
    return true;
  }

  /// As it is seen along the axis.
  __m128d seen(const Double3& p) const { return _mm_loadh_pd(_mm_load_sd(&p[x_]), &p[y_]); }
  /// Monotone, so that a cell is where its points are.
  Range range(__m128d low, __m128d high) const {
    const __m256d from = _mm256_broadcast_pd(reinterpret_cast<const __m128d*>(low_.data())),
                  last = _mm256_setr_pd(static_cast<double>(size_[0] - 1), static_cast<double>(size_[1] - 1),
                                        static_cast<double>(size_[0] - 1), static_cast<double>(size_[1] - 1));
    const __m256d at =
        _mm256_mul_pd(_mm256_sub_pd(_mm256_set_m128d(high, low), from), _mm256_set1_pd(per_edge_));
    const __m128i cells = _mm256_cvttpd_epi32(_mm256_min_pd(_mm256_max_pd(at, _mm256_setzero_pd()), last));
    return std::bit_cast<Range>(_mm_cvtsi128_si64(_mm_packus_epi32(cells, cells)));
  }
  Range range_of(std::uint32_t f) const {
    const __m128d a = seen(faces_.corner(f, 0)), b = seen(faces_.corner(f, 1)), c = seen(faces_.corner(f, 2));
    return range(_mm_min_pd(_mm_min_pd(a, b), c), _mm_max_pd(_mm_max_pd(a, b), c));
  }
  template <class Use>
  void each_mark(const Range& r, const Use& use) {
    for (std::size_t y = r.y0; y <= r.y1; ++y)
      for (std::size_t x = r.x0; x <= r.x1; ++x) use(marks_[y * size_[0] + x], x, y);
  }
  bool any_doubt(const Range& r) const {
    for (std::size_t y = r.y0; y <= r.y1; ++y)
      for (std::size_t x = r.x0; x <= r.x1; ++x)
        if (marks_[y * size_[0] + x] >= kDoubt) return true;
    return false;
  }

  /// Twice the area of a, b and p, seen along the axis; p in doubt counts as on the left.
  bool left_of(const Double3& a, const Double3& b, const std::array<double, 2>& p) const {
    const double left = (b[x_] - a[x_]) * (p[1] - a[y_]), right = (b[y_] - a[y_]) * (p[0] - a[x_]);
    return left - right >= -kSure * (std::fabs(left) + std::fabs(right));
  }

  /// Cells of faces that do not surely look along the axis, and how often each one's sample is covered.
  bool mark_faces() {
    std::size_t visits = 0;
    ranges_.resize(faces_.size());
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
      const Double3 &a = faces_.corner(f, 0), &b = faces_.corner(f, 1), &c = faces_.corner(f, 2);
      const Range r = ranges_[f] = range_of(f);
      visits += static_cast<std::size_t>((r.x1 - r.x0 + 1) * (r.y1 - r.y0 + 1));
      if (visits > kMaxVisits * faces_.size()) return false;
      const double left = (b[x_] - a[x_]) * (c[y_] - a[y_]), right = (b[y_] - a[y_]) * (c[x_] - a[x_]);
      if (!(left - right > kSure * (std::fabs(left) + std::fabs(right)))) {
        each_mark(r, [](std::uint8_t& mark, std::size_t, std::size_t) { mark = kDoubt; });
        continue;
      }
      each_mark(r, [&](std::uint8_t& mark, std::size_t x, std::size_t y) {
        if (mark >= kDoubt) return;
        const std::array<double, 2> at = {low_[0] + (static_cast<double>(x) + kSample) * edge_,
                                          low_[1] + (static_cast<double>(y) + kSample) * edge_};
        if (at[0] < std::min({a[x_], b[x_], c[x_]}) || at[0] > std::max({a[x_], b[x_], c[x_]})) return;
        if (left_of(a, b, at) && left_of(b, c, at) && left_of(c, a, at)) ++mark;
      });
    }
    return true;
  }

  /// A side of a face, in the bucket of its lower vertex.
  struct Side {
    std::uint32_t face;
    std::uint32_t other : 29, rises : 1,
        corner : 2;  ///< of the higher vertex what tells most apart; the side begins at the corner
  };
  void doubt_edge(std::uint32_t f, std::size_t corner) {
    const __m128d a = seen(faces_.corner(f, corner)), b = seen(faces_.corner(f, after(corner)));
    each_mark(range(_mm_min_pd(a, b), _mm_max_pd(a, b)),
              [](std::uint8_t& mark, std::size_t, std::size_t) { mark = kDoubt; });
  }

  /// Where marks tell of which edges there is another side. All others have one face in each direction if these cancel out.
  bool mark_told_borders() {
    std::uint64_t sum = 0;
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
      const unsigned open = faces_.open_edges(f);
      for (unsigned k = 0; k < 3; ++k) {
        if ((open >> k & 1u) != 0) {
          doubt_edge(f, k);
          continue;
        }
        const std::uint64_t a = faces_.vertex(f, k), b = faces_.vertex(f, after(k));
        sum += a < b ? edge_hash(a, b) : ~edge_hash(b, a) + 1;
      }
    }
    return sum == 0;
  }
  static std::uint64_t edge_hash(std::uint64_t low, std::uint64_t high) {
    std::uint64_t x = (low << 32 ^ high) * 0x9e3779b97f4a7c15u;
    x = (x ^ x >> 32) * 0xd6e8feb86659fd93u;
    return x ^ x >> 32;
  }

  /// Cells of edges that have not exactly one face on each side.
  bool mark_borders() {
    if constexpr (requires(const Faces& some) { some.open_edges(0u); })
      if (mark_told_borders()) return true;
    std::size_t buckets = 1;
    while (buckets < faces_.size() / 2) buckets *= 2;
    const std::uint64_t mask = buckets - 1;
    std::vector<std::uint32_t> first(buckets + 1, 0);
    if (faces_.size() > 0x50000000u) return false;
    each_side(
        [&](std::uint32_t, unsigned, std::uint64_t low, std::uint64_t, bool) { ++first[(low & mask) + 1]; });
    for (std::size_t b = 0; b < buckets; ++b) first[b + 1] += first[b];
    std::vector<Side> sides(3 * faces_.size());
    // Buckets are filled from their ends on, and then begin where they did.
    std::vector<std::uint32_t> next(first.begin() + 1, first.end());
    each_side([&](std::uint32_t f, unsigned corner, std::uint64_t low, std::uint64_t high, bool rises) {
      sides[--next[low & mask]] = {f, static_cast<std::uint32_t>(high & 0x1fffffffu), rises, corner & 3u};
    });
    for (std::size_t b = 0; b < buckets; ++b) match({sides.data() + first[b], sides.data() + first[b + 1]});
    return true;
  }
  template <class Use>
  void each_side(const Use& use) const {
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
      const std::array<std::uint64_t, 3> v = {faces_.vertex(f, 0), faces_.vertex(f, 1), faces_.vertex(f, 2)};
      for (unsigned k = 0; k < 3; ++k) {
        const std::uint64_t a = v[k], b = v[k < 2 ? k + 1 : 0];
        use(f, k, std::min(a, b), std::max(a, b), a < b);
      }
    }
  }
  void match(std::span<const Side> bucket) {
    constexpr std::size_t kMaxBucket = 64;  // an umbrella of so many, or numbers that fall together
    for (const Side& s : bucket) {
      std::size_t same = 0, across = 0;
      if (bucket.size() <= kMaxBucket)
        for (const Side& t : bucket) {
          if (t.other != s.other || !is_edge(s, t)) continue;
          ++(t.rises == s.rises ? same : across);
        }
      if (same == 1 && across == 1) continue;
      doubt_edge(s.face, s.corner);
    }
  }
  static std::size_t after(std::size_t corner) { return corner < 2 ? corner + 1 : 0; }
  bool is_edge(const Side& s, const Side& t) const {
    const std::uint64_t a = faces_.vertex(s.face, s.corner), b = faces_.vertex(s.face, after(s.corner)),
                        c = faces_.vertex(t.face, t.corner), d = faces_.vertex(t.face, after(t.corner));
    return (a == c && b == d) || (a == d && b == c);
  }

  Faces faces_;
  bool useful_ = false;
  std::size_t x_ = 0, y_ = 1;
  std::array<double, 2> low_{};
  double edge_ = 0.0, per_edge_ = 0.0;  ///< of cells
  std::array<std::size_t, 2> size_{};
  std::vector<Range> ranges_;        ///< of cells, by face
  std::vector<std::uint8_t> marks_;  ///< by cell: how many faces cover its sample, or doubt
};

/// Faces as SheetCells takes them.
struct GivenFaces {
  std::span<const ContactFace> faces;
  std::size_t size() const { return faces.size(); }
  const Double3& corner(std::size_t f, std::size_t k) const { return faces[f].corner[k]; }
  std::uint64_t vertex(std::size_t f, std::size_t k) const { return faces[f].vertex[k]; }
};
struct BlockFaces {
  const MeshBlock& block;
  std::size_t size() const { return block.faces.size(); }
  const Double3& corner(std::size_t f, std::size_t k) const { return block.position[block.faces[f][k]]; }
  std::uint64_t vertex(std::size_t f, std::size_t k) const { return block.faces[f][k]; }
};

/// Some faces of a block.
struct CoreFaces {
  const MeshBlock& block;
  std::span<const std::uint32_t> some;  ///< empty: all of them
  std::span<const std::uint8_t> outer;  ///< per vertex: a face that is not of them has it; or empty
  std::size_t size() const { return some.empty() ? block.faces.size() : some.size(); }
  std::uint32_t number(std::size_t f) const { return some.empty() ? static_cast<std::uint32_t>(f) : some[f]; }
  const Double3& corner(std::size_t f, std::size_t k) const {
    return block.position[block.faces[number(f)][k]];
  }
  std::uint64_t vertex(std::size_t f, std::size_t k) const { return block.faces[number(f)][k]; }
  /// A bit for each edge, of corner 0 and 1 first, that has no other side here.
  unsigned open_edges(std::size_t f) const {
    const std::uint32_t n = number(f);
    unsigned open = block.face_flags[n] & unsigned{kFaceBorder01 | kFaceBorder12 | kFaceBorder20};
    if (outer.empty()) return open;
    const auto& c = block.faces[n];
    const unsigned a = outer[c[0]], b = outer[c[1]], d = outer[c[2]];
    return open | (a & b) | (b & d) << 1 | (d & a) << 2;
  }
};

class ContactTree {
 public:
  /// \param some  of the faces; none: all of them
  ContactTree(std::span<const ContactFace> faces, const ContactCell& cell,
              std::vector<std::uint32_t> some = {})
      : faces_(faces), cell_(cell), order_(std::move(some)) {
    sort();
    std::vector<BoxBundle> leaves((order_.size() + kLanes - 1) / kLanes);
    for (std::size_t i = 0; i < order_.size(); ++i) {
      prefetch(i + 2 * kLanes);
      put(leaves[i / kLanes], i % kLanes, box(faces[order_[i]]));
    }
    levels_.push_back(std::move(leaves));
    while (levels_.size() < 2 || levels_.back().size() > 1) {
      const std::vector<BoxBundle>& below = levels_.back();
      std::vector<BoxBundle> next((below.size() + kLanes - 1) / kLanes);
      for (std::size_t b = 0; b < below.size(); ++b) put(next[b / kLanes], b % kLanes, around(below[b]));
      levels_.push_back(std::move(next));
    }
  }

  /// \param use  (i, j, contact) -> whether to go on
  template <class Use>
  void each_pair(const Use& use) const {
    std::vector<std::size_t> near;  // bundles of leaves that may meet one such bundle
    FacePlanes planes;              // of a leaf's faces
    for (std::size_t leaf = 0; leaf < levels_[0].size(); ++leaf) {
      if (leaf % kLanes == 0) find_near(leaf / kLanes, near);
      const FloatBox whole = around(levels_[0][leaf]);
      planes.clear();
      for (std::size_t i = (leaf + 2) * kLanes; i < (leaf + 3) * kLanes; ++i) prefetch(i);
      for (std::size_t i = leaf * kLanes; i < std::min(order_.size(), (leaf + 1) * kLanes); ++i)
        planes.add(faces_[order_[i]]);
      for (const std::size_t bundle : near) {
        const unsigned bits = meeting(levels_[1][bundle], whole);
        for (std::size_t l = kLanes; l-- > 0 && bundle * kLanes + l >= leaf;)  // those before it have met it
          if ((bits >> l & 1u) != 0 && !meet(leaf, whole, planes, bundle * kLanes + l, use)) return;
      }
    }
  }

 private:
  /// Along a curve through the middles, so that bundles are compact.
  void sort() {
    Double3 low, high;
    low.fill(std::numeric_limits<double>::infinity());
    high.fill(-std::numeric_limits<double>::infinity());
    for (const ContactFace& f : faces_)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min({low[k], f.corner[0][k], f.corner[1][k], f.corner[2][k]});
        high[k] = std::max({high[k], f.corner[0][k], f.corner[1][k], f.corner[2][k]});
      }
    origin_ = low;
    double widest = 0.0;
    for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, high[k] - low[k]);
    const double scale = widest > 0.0 ? 2097151.0 / widest : 0.0;
    if (order_.empty()) {
      order_.resize(faces_.size());
      std::iota(order_.begin(), order_.end(), 0u);
    }
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(order_.size());
    for (std::size_t n = 0; n < keys.size(); ++n) {
      const std::uint32_t f = order_[n];
      std::array<std::uint32_t, 3> at{};
      for (std::size_t k = 0; k < 3; ++k) {
        const auto& c = faces_[f].corner;
        const double x = ((c[0][k] - low[k]) + (c[1][k] - low[k]) + (c[2][k] - low[k])) / 3.0 * scale;
        at[k] = static_cast<std::uint32_t>(std::clamp(x, 0.0, 2097151.0));
      }
      keys[n] = {morton_encode(at[0], at[1], at[2]), f};
    }
    std::sort(keys.begin(), keys.end());
    for (std::size_t n = 0; n < keys.size(); ++n) order_[n] = keys[n].second;
  }

  /// Relative to a corner of the block, so that floats tell neighbours apart in survey coordinates too; differences round
  /// monotonically, so boxes that meet still do.
  FloatBox box(const ContactFace& f) const {
    const __m256i three = _mm256_setr_epi64x(-1, -1, -1, 0);
    const auto load = [&](const Double3& p) { return _mm256_maskload_pd(p.data(), three); };
    const __m256d a = load(f.corner[0]), b = load(f.corner[1]), c = load(f.corner[2]), from = load(origin_);
    const __m128 low = _mm256_cvtpd_ps(_mm256_sub_pd(_mm256_min_pd(_mm256_min_pd(a, b), c), from)),
                 high = _mm256_cvtpd_ps(_mm256_sub_pd(_mm256_max_pd(_mm256_max_pd(a, b), c), from));
    alignas(16) std::array<float, 4> l, h;
    _mm_store_ps(l.data(), outwards(low, -1.0f));
    _mm_store_ps(h.data(), outwards(high, 1.0f));
    return {{l[0], l[1], l[2]}, {h[0], h[1], h[2]}};
  }
  /// Beyond what was rounded to the nearest.
  static __m128 outwards(__m128 x, float direction) {
    constexpr float kLargest = std::numeric_limits<float>::max();
    const __m128 finite =
        direction < 0.0f ? _mm_min_ps(x, _mm_set1_ps(kLargest)) : _mm_max_ps(x, _mm_set1_ps(-kLargest));
    const __m128 unit =
        _mm_add_ps(_mm_mul_ps(_mm_andnot_ps(_mm_set1_ps(-0.0f), finite), _mm_set1_ps(0x1p-23f)),
                   _mm_set1_ps(std::numeric_limits<float>::min()));
    return _mm_add_ps(finite, _mm_mul_ps(unit, _mm_set1_ps(direction)));
  }
  void prefetch(std::size_t slot) const {
    if (slot >= order_.size()) return;
    const auto* face = reinterpret_cast<const char*>(&faces_[order_[slot]]);
    __builtin_prefetch(face), __builtin_prefetch(face + sizeof(ContactFace) - 1);
  }

  /// Bundles of leaves that meet this one, it and later ones, descending.
  void find_near(std::size_t own, std::vector<std::size_t>& near) const {
    const FloatBox whole = around(levels_[1][own]);
    near.clear();
    std::vector<std::pair<std::size_t, std::size_t>> open = {{levels_.size() - 1, 0}};  // level, bundle
    while (!open.empty()) {
      const auto [level, bundle] = open.back();
      open.pop_back();
      if (level == 1) {
        near.push_back(bundle);
        continue;
      }
      std::size_t first = own;  // the bundle of the level below that holds it
      for (std::size_t l = 2; l < level; ++l) first /= kLanes;
      for (unsigned bits = meeting(levels_[level][bundle], whole); bits != 0; bits &= bits - 1) {
        const std::size_t below = bundle * kLanes + static_cast<std::size_t>(__builtin_ctz(bits));
        if (below >= first) open.emplace_back(level - 1, below);
      }
    }
  }

  template <class Use>
  bool meet(std::size_t leaf, const FloatBox& whole, const FacePlanes& planes, std::size_t other,
            const Use& use) const {
    const BoxBundle &mine = levels_[0][leaf], &theirs = levels_[0][other];
    std::array<unsigned, kLanes> met;
    unsigned some = 0;
    for (unsigned lanes = meeting(theirs, whole); lanes != 0; lanes &= lanes - 1) {
      const auto l = static_cast<std::size_t>(__builtin_ctz(lanes));
      met[l] = meeting(mine, lane(theirs, l));
      if (leaf == other) met[l] &= (1u << l) - 1u;
      if (met[l] == 0) continue;
      some |= 1u << l;
      prefetch(other * kLanes + l);
    }
    for (; some != 0; some &= some - 1) {
      const auto l = static_cast<std::size_t>(__builtin_ctz(some));
      const std::uint32_t face = order_[other * kLanes + l];
      for (unsigned bits = met[l] & ~planes.apart(faces_[face]); bits != 0; bits &= bits - 1)
        if (!decide(order_[leaf * kLanes + static_cast<std::size_t>(__builtin_ctz(bits))], face, use))
          return false;
    }
    return true;
  }

  /// Few pairs meet, so whose they are is asked last.
  template <class Use>
  bool decide(std::uint32_t i, std::uint32_t j, const Use& use) const {
    const ContactFace &a = faces_[i], &b = faces_[j];
    const FaceContact contact = face_contact(a, b);
    if (contact == FaceContact::kNone) return true;
    for (std::size_t k = 0; k < 3; ++k) {
      const double low = std::max(std::min({a.corner[0][k], a.corner[1][k], a.corner[2][k]}),
                                  std::min({b.corner[0][k], b.corner[1][k], b.corner[2][k]}));
      if (low < cell_.low[k] || !(low < cell_.high[k])) return true;
    }
    return use(std::min(i, j), std::max(i, j), contact);
  }

  std::span<const ContactFace> faces_;
  const ContactCell& cell_;
  Double3 origin_{};
  std::vector<std::uint32_t> order_;
  std::vector<std::vector<BoxBundle>> levels_;  ///< of the faces in that order first
};

}  // namespace

void block_contacts(std::span<const ContactFace> faces, const ContactCell& cell,
                    const std::function<void(std::uint32_t, std::uint32_t, FaceContact)>& use,
                    ContactOrder order) {
  if (faces.size() < 2) return;
  const auto all_of = [&](std::vector<std::uint32_t> some) {
    ContactTree(faces, cell, std::move(some))
        .each_pair([&](std::uint32_t i, std::uint32_t j, FaceContact contact) {
          use(i, j, contact);
          return true;
        });
  };
  std::vector<std::uint32_t> some;
  if (!SheetCells(GivenFaces{faces}).doubtful(some)) return all_of({});
  if (some.size() < 2) return;
  if (order == ContactOrder::kAny) return all_of(std::move(some));
  // The order is that of the tree of all faces, so where there are any it is made.
  bool any = false;
  ContactTree(faces, cell, std::move(some)).each_pair([&](std::uint32_t, std::uint32_t, FaceContact) {
    any = true;
    return false;
  });
  if (any) all_of({});
}

namespace {

void add_contact_face(const MeshBlock& block, std::uint32_t i, std::vector<ContactFace>& faces,
                      std::vector<std::uint32_t>* number) {
  const auto& f = block.faces[i];
  const ContactFace face = {{block.position[f[0]], block.position[f[1]], block.position[f[2]]},
                            {f[0], f[1], f[2]}};
  if (collinear(face.corner[0], face.corner[1], face.corner[2])) return;
  faces.push_back(face);
  if (number != nullptr) number->push_back(i);
}

}  // namespace

std::vector<ContactFace> contact_faces(const MeshBlock& block, std::vector<std::uint32_t>* number) {
  std::vector<ContactFace> faces;
  faces.reserve(block.faces.size());
  if (number != nullptr) number->reserve(block.faces.size());
  for (std::uint32_t i = 0; i < block.faces.size(); ++i) add_contact_face(block, i, faces, number);
  return faces;
}

std::vector<ContactFace> doubtful_faces(const MeshBlock& block, std::vector<std::uint32_t>* number) {
  std::vector<std::uint32_t> some;
  if (!SheetCells(BlockFaces{block}).doubtful(some)) return contact_faces(block, number);
  std::vector<ContactFace> faces;
  faces.reserve(some.size());
  for (const std::uint32_t i : some) add_contact_face(block, i, faces, number);
  return faces;
}

void core_contacts(const MeshBlock& block, std::span<const std::uint8_t> core,
                   const std::function<void(const ContactFace&, const ContactFace&)>& use) {
  std::vector<std::uint32_t> own, some;
  std::vector<std::uint8_t> outer;
  if (std::find(core.begin(), core.end(), std::uint8_t{0}) != core.end()) {
    outer.resize(block.position.size(), 0);
    for (std::uint32_t f = 0; f < core.size(); ++f)
      if (core[f] != 0)
        own.push_back(f);
      else
        for (const std::uint32_t v : block.faces[f]) outer[v] = 1;
    if (own.empty()) return;
  }
  const CoreFaces faces{block, own, outer};
  const bool sheet = SheetCells(faces).doubtful(some);
  const std::size_t count = sheet ? some.size() : faces.size();
  std::vector<ContactFace> found;
  found.reserve(count);
  for (std::uint32_t f = 0; f < count; ++f)
    add_contact_face(block, faces.number(sheet ? some[f] : f), found, nullptr);
  some = {};
  if (found.size() < 2) return;
  ContactTree(found, kAllSpace).each_pair([&](std::uint32_t i, std::uint32_t j, FaceContact) {
    if (!meet_in_copies(found[i], found[j])) use(found[i], found[j]);
    return true;
  });
}

std::size_t count_contacts(const MeshBlock& block, std::size_t enough) {
  const std::vector<ContactFace> faces = doubtful_faces(block);
  if (faces.size() < 2) return 0;
  std::size_t pairs = 0;
  ContactTree(faces, kAllSpace).each_pair([&](std::uint32_t i, std::uint32_t j, FaceContact) {
    pairs += !meet_in_copies(faces[i], faces[j]);
    return pairs < enough;
  });
  return pairs;
}

}  // namespace tessera
