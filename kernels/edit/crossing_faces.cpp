#include "kernels/edit/crossing_faces.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;
constexpr std::size_t kLeaf = 4;  ///< faces of a leaf

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

class Crossings {
 public:
  Crossings(std::span<const Double3> position, std::span<const Face> faces) : p_(position), faces_(faces) {
    order_.resize(faces.size());
    std::iota(order_.begin(), order_.end(), 0u);
    if (!faces.empty()) build(0, faces.size());
  }

  template <class Use>
  void each(std::uint32_t face, const Use& use) const {
    Box box;
    for (const std::uint32_t v : faces_[face]) box.add(p_[v]);
    std::vector<std::uint32_t> open = {0};
    while (!open.empty()) {
      const Node& node = nodes_[open.back()];
      const std::uint32_t at = open.back();
      open.pop_back();
      if (!node.box.meets(box)) continue;
      if (node.right == 0) {
        for (std::size_t i = node.first; i < node.last; ++i)
          if (order_[i] != face && cross_each_other(face, order_[i])) use(order_[i]);
      } else {
        open.push_back(node.right);
        open.push_back(at + 1);
      }
    }
  }

 private:
  struct Node {
    Box box;
    std::uint32_t right = 0;  ///< the left child is the next node; 0: a leaf
    std::uint32_t first = 0, last = 0;
  };

  Double3 middle(std::uint32_t f) const { return p_[faces_[f][0]] + p_[faces_[f][1]] + p_[faces_[f][2]]; }

  std::uint32_t build(std::size_t first, std::size_t last) {
    const auto at = static_cast<std::uint32_t>(nodes_.size());
    nodes_.emplace_back();
    Box box, middles;
    for (std::size_t i = first; i < last; ++i) {
      for (const std::uint32_t v : faces_[order_[i]]) box.add(p_[v]);
      middles.add(middle(order_[i]));
    }
    nodes_[at].box = box;
    nodes_[at].first = static_cast<std::uint32_t>(first);
    nodes_[at].last = static_cast<std::uint32_t>(last);
    if (last - first <= kLeaf) return at;
    std::size_t axis = 0;
    for (std::size_t c = 1; c < 3; ++c)
      if (middles.high[c] - middles.low[c] > middles.high[axis] - middles.low[axis]) axis = c;
    const std::size_t half = first + (last - first) / 2;
    const auto place = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(place(first), place(half), place(last), [&](std::uint32_t a, std::uint32_t b) {
      const double x = middle(a)[axis], y = middle(b)[axis];
      return x != y ? x < y : a < b;
    });
    build(first, half);
    const std::uint32_t right = build(half, last);
    nodes_[at].right = right;
    return at;
  }

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
  std::vector<Node> nodes_;
};

}  // namespace

CrossingFaces crossing_faces(std::span<const Double3> position, std::span<const Face> faces,
                             std::span<const std::uint8_t> watched) {
  const Crossings all(position, faces);
  CrossingFaces out;
  std::vector<std::uint8_t> crosses(faces.size(), 0);
  for (std::uint32_t f = 0; f < faces.size(); ++f) {
    if (!watched.empty() && !watched[f]) continue;
    all.each(f, [&](std::uint32_t other) {
      crosses[f] = crosses[other] = 1;
      const bool both = watched.empty() || watched[other];
      out.pairs += !both || f < other;
    });
  }
  for (std::uint32_t f = 0; f < faces.size(); ++f)
    if (crosses[f]) out.faces.push_back(f);
  return out;
}

}  // namespace tessera
