#include "kernels/edit/self_intersections.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "octree/box_levels.h"
#include "octree/lists.h"
#include "octree/morton.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;
constexpr std::size_t kLeaf = 4;  ///< faces of a leaf, and boxes of the one above

struct Box {
  Double3 low, high;
  Box() {
    low.fill(std::numeric_limits<double>::infinity());
    high.fill(-std::numeric_limits<double>::infinity());
  }
  void add(const Double3& p) {
    for (std::size_t c = 0; c < 3; ++c) {
      low[c] = std::min(low[c], p[c]);
      high[c] = std::max(high[c], p[c]);
    }
  }
  bool meets(const Box& o) const {
    for (std::size_t c = 0; c < 3; ++c)
      if (low[c] > o.high[c] || o.low[c] > high[c]) return false;
    return true;
  }
};

double six_volumes(const Double3& a, const Double3& b, const Double3& c, const Double3& d) {
  return dot(cross(b - a, c - a), d - a);
}

/// Faces in the order of their middles along a curve, by fours, and boxes over these.
class Crossings {
 public:
  Crossings(std::span<const Double3> position, std::span<const Face> faces) : p_(position), faces_(faces) {
    Box middles;
    for (const Face& f : faces) middles.add(middle(f));
    Double3 scale{};
    for (std::size_t c = 0; c < 3; ++c) {
      const double size = middles.high[c] - middles.low[c];
      scale[c] = size > 0.0 && std::isfinite(size) ? 2097151.0 / size : 0.0;
    }
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(faces.size());
    for (std::uint32_t f = 0; f < faces.size(); ++f) {
      std::array<std::uint32_t, 3> cell{};
      const Double3 at = middle(faces[f]) - middles.low;
      for (std::size_t c = 0; c < 3; ++c)
        if (const double x = at[c] * scale[c]; x > 0.0) cell[c] = static_cast<std::uint32_t>(x);
      keys[f] = {morton_encode(cell[0], cell[1], cell[2]), f};
    }
    std::sort(keys.begin(), keys.end());
    order_.reserve(faces.size());
    box_.reserve(faces.size());
    std::vector<Box> leaves((faces.size() + kLeaf - 1) / kLeaf);
    for (std::size_t i = 0; i < keys.size(); ++i) {
      order_.push_back(keys[i].second);
      box_.emplace_back();
      for (const std::uint32_t v : faces[order_[i]]) {
        box_[i].add(p_[v]);
        leaves[i / kLeaf].add(p_[v]);
      }
    }
    if (!leaves.empty()) levels_ = box_levels(std::move(leaves), kLeaf);
  }

  /// Calls use(face, other) once for each pair that crosses, one of the two watched.
  template <class Use>
  void each(std::span<const std::uint8_t> watched, const Use& use) const {
    if (levels_.empty()) return;
    const auto is_watched = [&](std::size_t i) { return watched.empty() || watched[order_[i]]; };
    std::vector<std::uint8_t> queried(levels_[0].size(), 0);
    for (std::size_t i = 0; i < order_.size(); ++i)
      if (is_watched(i)) queried[i / kLeaf] = 1;
    for (std::size_t leaf = 0; leaf < queried.size(); ++leaf) {
      if (!queried[leaf]) continue;
      const auto meet = [&](std::size_t number) {
        if (queried[number] && number < leaf) return true;  // that one has met this one
        for (std::size_t i = leaf * kLeaf; i < std::min((leaf + 1) * kLeaf, order_.size()); ++i)
          for (std::size_t j = number == leaf ? i + 1 : number * kLeaf;
               j < std::min((number + 1) * kLeaf, order_.size()); ++j)
            if ((is_watched(i) || is_watched(j)) && box_[i].meets(box_[j]) &&
                cross_each_other(order_[i], order_[j]))
              use(order_[i], order_[j]);
        return true;
      };
      visit_boxes(
          levels_, kLeaf, BoxOrder::kDescending, [&](const Box& box) { return box.meets(levels_[0][leaf]); },
          meet);
    }
  }

 private:
  Double3 middle(const Face& f) const { return (p_[f[0]] + p_[f[1]] + p_[f[2]]) * (1.0 / 3.0); }

  bool pierces(std::uint32_t v, std::uint32_t w, const Face& f) const {
    const Double3 &a = p_[f[0]], &b = p_[f[1]], &c = p_[f[2]], &p = p_[v], &q = p_[w];
    const double s = six_volumes(a, b, c, p), t = six_volumes(a, b, c, q);
    if (!((s < 0.0 && t > 0.0) || (s > 0.0 && t < 0.0))) return false;
    const double x = six_volumes(p, q, a, b), y = six_volumes(p, q, b, c), z = six_volumes(p, q, c, a);
    return (x > 0.0 && y > 0.0 && z > 0.0) || (x < 0.0 && y < 0.0 && z < 0.0);
  }

  bool cross_each_other(std::uint32_t one, std::uint32_t other) const {
    const Face &a = faces_[one], &b = faces_[other];
    const auto in = [](std::uint32_t v, const Face& f) { return v == f[0] || v == f[1] || v == f[2]; };
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t m = (k + 1) % 3;
      if (!in(a[k], b) && !in(a[m], b) && pierces(a[k], a[m], b)) return true;
      if (!in(b[k], a) && !in(b[m], a) && pierces(b[k], b[m], a)) return true;
    }
    return false;
  }

  std::span<const Double3> p_;
  std::span<const Face> faces_;
  std::vector<std::uint32_t> order_;
  std::vector<Box> box_;  ///< of the faces in that order
  std::vector<std::vector<Box>> levels_;
};

constexpr std::size_t kMaxNear = 1000;  ///< faces that are looked at: twice what six regular rings have

/// Whether faces lie within kNearRings rings of each other.
class Nearness {
 public:
  Nearness(std::size_t vertices, std::span<const Face> faces)
      : faces_(faces),
        around_(make_lists<std::uint32_t>(vertices,
                                          [&](const auto& put) {
                                            for (std::uint32_t f = 0; f < faces.size(); ++f)
                                              for (const std::uint32_t v : faces[f]) put(v, f);
                                          })),
        seen_(faces.size(), 0) {}

  bool near(std::uint32_t one, std::uint32_t other) {
    if (gathered_.empty() || gathered_.front() != one) gather(one);
    return seen_[other] == round_;
  }

 private:
  void gather(std::uint32_t one) {
    ++round_;
    gathered_.assign(1, one);
    seen_[one] = round_;
    std::size_t begin = 0;
    for (int ring = 0; ring < kNearRings; ++ring)
      for (const std::size_t end = gathered_.size(); begin < end; ++begin)
        for (const std::uint32_t v : faces_[gathered_[begin]])
          for (const std::uint32_t f : around_[v]) {
            if (seen_[f] == round_) continue;
            if (gathered_.size() == kMaxNear) return;
            seen_[f] = round_;
            gathered_.push_back(f);
          }
  }

  std::span<const Face> faces_;
  Lists<std::uint32_t> around_;
  std::vector<std::uint32_t> seen_, gathered_;
  std::uint32_t round_ = 0;
};

}  // namespace

SelfIntersections self_intersections(std::span<const Double3> position, std::span<const Face> faces,
                                     std::span<const std::uint8_t> watched) {
  const Crossings all(position, faces);
  SelfIntersections out;
  std::vector<std::uint8_t> crosses(faces.size(), 0);
  std::vector<std::uint32_t> far;
  std::optional<Nearness> nearness;
  std::optional<UnionFind> lines;
  all.each(watched, [&](std::uint32_t f, std::uint32_t other) {
    if (!nearness) {
      nearness.emplace(position.size(), faces);
      lines.emplace(faces.size());
    }
    if (!nearness->near(f, other)) far.push_back(f);
    lines->unite(f, other);
    crosses[f] = crosses[other] = 1;
    ++out.pairs;
  });
  if (!lines) return out;
  // Along the surface a line goes on in a face with a common vertex.
  constexpr std::uint32_t kNone = 0xffffffffu;
  std::vector<std::uint32_t> at(position.size(), kNone);
  for (std::uint32_t f = 0; f < faces.size(); ++f) {
    if (!crosses[f]) continue;
    out.faces.push_back(f);
    for (const std::uint32_t v : faces[f]) {
      if (at[v] != kNone) lines->unite(at[v], f);
      at[v] = f;
    }
  }
  std::vector<std::uint8_t> meets_far(faces.size(), 0);
  for (const std::uint32_t f : far) meets_far[lines->find(f)] = 1;
  for (const std::uint32_t f : out.faces) out.local += meets_far[lines->find(f)] == 0;
  return out;
}

}  // namespace tessera
