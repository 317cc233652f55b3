#include "kernels/solid/lattice_crossings.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

__extension__ using Wide = __int128;

template <class T>
T floor_div(T a, T b) {  // b > 0
  const T q = a / b;
  return q * b > a ? q - 1 : q;
}

int sign_of(Wide v) {
  return v > 0 ? 1 : v < 0 ? -1 : 0;
}

/// The triangle seen along one axis, turned so that its projection runs counter-clockwise.
/// \tparam T  wide enough for the cube of the triangle's extent, times four
template <class T>
class Projection {
 public:
  Projection(const QuantisedTriangle& triangle, std::size_t axis)
      : corner_(triangle), a_(axis), u_((axis + 1) % 3), v_((axis + 2) % 3) {
    normal_ = normal();
    if (normal_[a_] == 0) return;
    winding_ = normal_[a_] > 0 ? std::int8_t{-1} : std::int8_t{1};
    if (normal_[a_] < 0) {
      std::swap(corner_[1], corner_[2]);
      for (T& n : normal_) n = -n;
    }
    for (std::size_t e = 0; e < 3; ++e) {
      const Long3 &p = corner_[e], &q = corner_[(e + 1) % 3];
      du_[e] = q[u_] - p[u_];
      dv_[e] = q[v_] - p[v_];
      // On the edge, the moved line lies inside where du e_v - dv e_u > 0.
      const bool u_first = u_ < v_;
      const std::int64_t first = u_first ? -dv_[e] : du_[e], second = u_first ? du_[e] : -dv_[e];
      takes_edge_[e] = first != 0 ? first > 0 : second > 0;
    }
    // A crossing at a node lies before the moved node where n.e and the axis agree.
    const int first = normal_[0] != 0 ? sign_of(normal_[0]) : normal_[1] != 0 ? sign_of(normal_[1]) : 1;
    before_node_ = first > 0;
  }

  void cross(const NodeBox& box, std::vector<LatticeCrossing>& out) const {
    if (normal_[a_] == 0) return;
    const auto [low_u, high_u] = rows(u_, box);
    const auto [low_v, high_v] = rows(v_, box);
    for (std::int64_t j = low_v; j <= high_v; ++j) {
      std::int64_t first = low_u, last = high_u;
      if (high_u - low_u > 3) narrow(j, first, last);
      for (std::int64_t i = first; i <= last; ++i)
        if (holds(i, j)) add(i, j, box, out);
    }
  }

 private:
  std::array<T, 3> normal() const {
    std::array<T, 3> b, c;
    for (std::size_t k = 0; k < 3; ++k) {
      b[k] = static_cast<T>(corner_[1][k] - corner_[0][k]);
      c[k] = static_cast<T>(corner_[2][k] - corner_[0][k]);
    }
    return {b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]};
  }

  /// Lines that can meet the triangle, first and last.
  std::pair<std::int64_t, std::int64_t> rows(std::size_t k, const NodeBox& box) const {
    const auto [low, high] = std::minmax({corner_[0][k], corner_[1][k], corner_[2][k]});
    return {std::max<std::int64_t>(box.low[k], -floor_div(-low, kSolidQuanta)),
            std::min<std::int64_t>(box.high[k] - 1, floor_div(high, kSolidQuanta))};
  }

  /// Twice the area of the edge and the line, > 0 inside.
  T side(std::size_t e, std::int64_t i, std::int64_t j) const {
    return static_cast<T>(du_[e]) * static_cast<T>(j * kSolidQuanta - corner_[e][v_]) -
           static_cast<T>(dv_[e]) * static_cast<T>(i * kSolidQuanta - corner_[e][u_]);
  }
  bool holds(std::int64_t i, std::int64_t j) const {
    for (std::size_t e = 0; e < 3; ++e) {
      const T s = side(e, i, j);
      if (s < 0 || (s == 0 && !takes_edge_[e])) return false;
    }
    return true;
  }
  /// Cuts a row to the lines between the edges, ends included.
  void narrow(std::int64_t j, std::int64_t& first, std::int64_t& last) const {
    for (std::size_t e = 0; e < 3; ++e) {
      const T at = side(e, 0, j);  // less dv Q with every step of i
      const T step = static_cast<T>(dv_[e]) * kSolidQuanta;
      if (step > 0) {
        last = static_cast<std::int64_t>(std::min<T>(static_cast<T>(last), floor_div<T>(at, step)));
      } else if (step < 0) {
        first = static_cast<std::int64_t>(std::max<T>(static_cast<T>(first), -floor_div<T>(at, -step)));
      }
    }
  }

  void add(std::int64_t i, std::int64_t j, const NodeBox& box, std::vector<LatticeCrossing>& out) const {
    const Long3& p = corner_[0];
    const std::int64_t base = floor_div(p[a_], kSolidQuanta);
    const T per_cell = normal_[a_] * kSolidQuanta;
    const T total = static_cast<T>(p[a_] - base * kSolidQuanta) * normal_[a_] -
                    normal_[u_] * static_cast<T>(i * kSolidQuanta - p[u_]) -
                    normal_[v_] * static_cast<T>(j * kSolidQuanta - p[v_]);
    const T cell = floor_div<T>(total, per_cell);
    const T rest = total - cell * per_cell;
    std::int64_t at = base + static_cast<std::int64_t>(cell);
    double t = static_cast<double>(rest) / static_cast<double>(per_cell);
    if (rest == 0 && before_node_) {
      --at;
      t = 1.0;
    }
    if (at < box.low[a_] || at >= box.high[a_]) return;
    LatticeCrossing& c = out.emplace_back();
    c.node[a_] = static_cast<std::int32_t>(at);
    c.node[u_] = static_cast<std::int32_t>(i);
    c.node[v_] = static_cast<std::int32_t>(j);
    c.axis = static_cast<std::uint8_t>(a_);
    c.winding = winding_;
    c.t = t;
  }

  QuantisedTriangle corner_;
  std::size_t a_, u_, v_;
  std::array<T, 3> normal_{};
  std::array<std::int64_t, 3> du_{}, dv_{};
  std::array<bool, 3> takes_edge_{};
  bool before_node_ = false;
  std::int8_t winding_ = 0;
};

/// Extents up to which 64 bits hold every product.
constexpr std::int64_t kNarrowExtent = std::int64_t{1} << 19;

}  // namespace

Long3 quantise_solid(const Lattice& lattice, const Double3& world) {
  Long3 q;
  for (std::size_t a = 0; a < 3; ++a)
    q[a] = static_cast<std::int64_t>(
               std::floor(world[a] / lattice.h * static_cast<double>(kSolidQuanta) + 0.5)) -
           lattice.origin_brick[a] * (kBrickCells * kSolidQuanta);
  return q;
}

void find_crossings(const QuantisedTriangle& triangle, const NodeBox& box, unsigned axes,
                    std::vector<LatticeCrossing>& out) {
  std::int64_t extent = 0;
  int thin = 0;  // axes along which no plane of nodes passes
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] = std::minmax({triangle[0][k], triangle[1][k], triangle[2][k]});
    extent = std::max(extent, high - low);
    if (floor_div(high, kSolidQuanta) < box.low[k] - 1 || -floor_div(-low, kSolidQuanta) > box.high[k])
      return;
    thin += floor_div(high, kSolidQuanta) < -floor_div(-low, kSolidQuanta) ? 1 : 0;
  }
  if (thin >= 2) return;  // a line lies in two planes of nodes
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if ((axes >> axis & 1u) == 0) continue;
    if (extent < kNarrowExtent) {
      Projection<std::int64_t>(triangle, axis).cross(box, out);
    } else {
      Projection<Wide>(triangle, axis).cross(box, out);
    }
  }
}

}  // namespace tessera
