#include "kernels/extract/crease_patch.h"

#include <algorithm>
#include <cmath>

#include "kernels/extract/feature_sample.h"
#include "kernels/mesh/face_contact.h"
#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxVertices = 64;
/// A crease nearer than this to the chord between its ends is straight, in cells.
constexpr double kStraight = 0.004;
constexpr float kNoTriangle = 1e30f;
/// Triangles of one smooth region turn by less than this (60 degrees) where they meet: more is a fold.
constexpr double kFoldCosine = 0.5;
/// Faces that would meet if one lay lower by this are too close for what bricks and files will round, in cells.
constexpr double kLift = 1.0 / 32768;
/// Only faces that lie back to back do.
constexpr double kBackCosine = -0.9;
/// What a triangle costs whose height would not survive rounding: more than any area.
constexpr float kSliverCost = 100.0f;

using Polygon = std::vector<std::uint8_t>;

double square_from_segment(const Double3& p, const Double3& a, const Double3& b) {
  const Double3 d = b - a, from = p - a;
  const double length = dot(d, d);
  const double s = length > 0.0 ? std::clamp(dot(from, d) / length, 0.0, 1.0) : 0.0;
  const Double3 off = from - d * s;
  return dot(off, off);
}

/// A stretch of crease between nodes where something begins, ends or meets.
struct Polyline {
  std::array<std::uint16_t, 2> end{};
  std::array<std::uint8_t, 2> rank{};
  std::vector<Float3> between;
  std::vector<std::uint8_t> vertex;  ///< of `between`
};

class Cutter {
 public:
  Cutter(const PatchOutline& outline, std::size_t vertices, CreasePatch& patch)
      : in_(outline), patch_(patch), vertices_(vertices) {
    patch_.inner.clear();
    patch_.is_corner.clear();
    patch_.triangles.clear();
  }

  bool cut() {
    if (vertices_ > kMaxVertices || !collect_nodes() || !join_links() || !number_vertices()) return false;
    if (!trace_regions()) return false;
    for (const Polygon& region : regions_)
      for (std::size_t i = 0; i < region.size(); ++i)
        mark_edge(region[i], region[i + 1 == region.size() ? 0 : i + 1]);
    for (const Polygon& region : regions_)
      if (!triangulate(region)) return false;
    return is_sheet() && !crosses_itself();
  }

 private:
  [[nodiscard]] std::size_t corners() const { return in_.corners.size(); }
  [[nodiscard]] bool is_corner(std::size_t node) const { return node < corners(); }
  [[nodiscard]] Float3 at_node(std::size_t node) const {
    return is_corner(node) ? in_.corners[node].at : in_.inner[node - corners()];
  }

  bool collect_nodes() {
    around_.assign(corners() + in_.inner.size(), {});
    for (std::size_t l = 0; l < in_.links.size(); ++l)
      for (std::size_t e = 0; e < 2; ++e) around_[in_.links[l].end[e]].push_back({l, e});
    for (std::size_t c = 0; c < corners(); ++c)
      if (around_[c].size() > 1) return false;
    return true;
  }
  [[nodiscard]] bool stops(std::size_t node) const { return is_corner(node) || around_[node].size() != 2; }

  /// Links through nodes where two meet become one.
  bool join_links() {
    std::vector<std::uint8_t> used(in_.links.size(), 0);
    for (std::size_t node = 0; node < around_.size(); ++node) {
      if (!stops(node)) continue;
      for (const auto& [first, side] : around_[node]) {
        if (used[first]) continue;
        Polyline line;
        line.end[0] = static_cast<std::uint16_t>(node);
        line.rank[0] = in_.links[first].rank[side];
        std::size_t l = first, s = side;
        for (;;) {
          used[l] = 1;
          const std::uint16_t to = in_.links[l].end[1 - s];
          if (stops(to)) {
            line.end[1] = to;
            line.rank[1] = in_.links[l].rank[1 - s];
            break;
          }
          line.between.push_back(at_node(to));
          const auto& both = around_[to];
          const auto& next = both[0].first == l && both[0].second == 1 - s ? both[1] : both[0];
          l = next.first;
          s = next.second;
        }
        if (!simplify(line)) return false;
        lines_.push_back(std::move(line));
      }
    }
    return std::find(used.begin(), used.end(), 0) == used.end();
  }

  /// Leaves out points where the crease is straight enough, the same ones whichever way it runs.
  bool simplify(Polyline& line) const {
    std::vector<Float3> points = {at_node(line.end[0])};
    points.insert(points.end(), line.between.begin(), line.between.end());
    points.push_back(at_node(line.end[1]));
    const bool turned =
        std::lexicographical_compare(points.rbegin(), points.rend(), points.begin(), points.end());
    if (turned) std::reverse(points.begin(), points.end());
    std::vector<std::uint8_t> kept(points.size(), 0);
    const bool whole = share_face(line) || line.end[0] == line.end[1];
    keep(points, 0, points.size() - 1, whole, kept);
    line.between.clear();
    for (std::size_t i = 1; i + 1 < points.size(); ++i)
      if (kept[i]) line.between.push_back(points[i]);
    if (turned) std::reverse(line.between.begin(), line.between.end());
    return !line.between.empty() || !whole || adjacent(line);
  }
  /// \param one  at least one point is wanted
  static void keep(const std::vector<Float3>& points, std::size_t from, std::size_t to, bool one,
                   std::vector<std::uint8_t>& kept) {
    double worst = one ? 0.0 : kStraight * kStraight;
    std::size_t at = from;
    for (std::size_t i = from + 1; i < to; ++i) {
      const double square = square_from_segment(wide(points[i]), wide(points[from]), wide(points[to]));
      if (!(square > worst)) continue;
      worst = square;
      at = i;
    }
    if (at == from) return;
    kept[at] = 1;
    keep(points, from, at, false, kept);
    keep(points, at, to, false, kept);
  }
  [[nodiscard]] bool share_face(const Polyline& line) const {
    return is_corner(line.end[0]) && is_corner(line.end[1]) &&
           (in_.corners[line.end[0]].faces & in_.corners[line.end[1]].faces) != 0;
  }
  [[nodiscard]] bool adjacent(const Polyline& line) const {
    if (!is_corner(line.end[0]) || !is_corner(line.end[1])) return false;
    const std::uint8_t a = in_.corners[line.end[0]].vertex, b = in_.corners[line.end[1]].vertex;
    if (a == b) return true;
    for (std::size_t c = 0; c < corners(); ++c) {
      const std::uint8_t p = in_.corners[c].vertex, q = in_.corners[after(c)].vertex;
      if ((p == a && q == b) || (p == b && q == a)) return true;
    }
    return false;
  }
  [[nodiscard]] std::size_t after(std::size_t corner) const {
    return corner + 1 == corners() ? 0 : corner + 1;
  }

  bool number_vertices() {
    faces_.assign(vertices_, 0);
    position_.assign(vertices_, Float3{});
    for (const OutlineCorner& c : in_.corners) {
      faces_[c.vertex] = c.faces;
      position_[c.vertex] = c.at;
    }
    vertex_.assign(around_.size(), 0);
    const auto add = [&](const Float3& at, bool corner) {
      position_.push_back(at);
      faces_.push_back(0);
      patch_.inner.push_back(at);
      patch_.is_corner.push_back(corner ? 1 : 0);
      return static_cast<std::uint8_t>(position_.size() - 1);
    };
    for (std::size_t node = 0; node < around_.size(); ++node) {
      if (is_corner(node)) {
        vertex_[node] = in_.corners[node].vertex;
      } else if (stops(node)) {
        if (around_[node].empty() || position_.size() >= kMaxVertices) return false;
        vertex_[node] = add(in_.inner[node - corners()], true);
      }
    }
    for (Polyline& line : lines_)
      for (const Float3& p : line.between) {
        if (position_.size() >= kMaxVertices) return false;
        line.vertex.push_back(add(p, false));
      }
    return true;
  }

  // Arc 2 p + d runs along polyline p from its end d.
  [[nodiscard]] std::uint16_t to_of(std::size_t arc) const { return lines_[arc >> 1].end[1 - (arc & 1)]; }
  void follow(std::size_t arc, Polygon& region) {
    used_[arc] = 1;
    const Polyline& line = lines_[arc >> 1];
    region.push_back(vertex_[line.end[arc & 1]]);
    if (arc & 1)
      region.insert(region.end(), line.vertex.rbegin(), line.vertex.rend());
    else
      region.insert(region.end(), line.vertex.begin(), line.vertex.end());
  }
  /// The arc that leaves an inner node next, clockwise from the one that came.
  bool next_arc(std::size_t arc, std::size_t& next) const {
    const std::uint16_t node = to_of(arc);
    const std::size_t back = arc ^ 1;
    if (around_[node].size() == 1) {
      next = back;
      return true;
    }
    const std::size_t degree = around_[node].size();
    const std::uint8_t rank = lines_[back >> 1].rank[back & 1];
    if (rank >= degree) return false;
    const std::size_t wanted = (std::size_t{rank} + (in_.clockwise ? std::size_t{1} : degree - 1)) % degree;
    for (std::size_t a = 0; a < 2 * lines_.size(); ++a)
      if (lines_[a >> 1].end[a & 1] == node && lines_[a >> 1].rank[a & 1] == wanted) {
        next = a;
        return true;
      }
    return false;
  }

  bool trace_regions() {
    used_.assign(2 * lines_.size(), 0);
    std::vector<std::size_t> out(corners(), kNone);
    std::size_t inner_nodes = 0;
    for (std::size_t a = 0; a < 2 * lines_.size(); ++a)
      if (is_corner(lines_[a >> 1].end[a & 1])) out[lines_[a >> 1].end[a & 1]] = a;
    for (std::size_t node = corners(); node < around_.size(); ++node) inner_nodes += stops(node) ? 1 : 0;
    std::vector<std::uint8_t> passed(corners(), 0);
    std::size_t count = 0;
    const auto follow_to_corner = [&](std::size_t arc, std::size_t& corner, Polygon& region) {
      for (;;) {
        if (used_[arc]) return false;
        follow(arc, region);
        if (is_corner(to_of(arc))) {
          corner = to_of(arc);
          return true;
        }
        if (!next_arc(arc, arc)) return false;
      }
    };
    for (std::size_t start = 0; start < corners(); ++start) {
      if (passed[start]) continue;
      Polygon region;
      std::size_t c = start;
      do {
        if (passed[c]) return false;
        passed[c] = 1;
        region.push_back(in_.corners[c].vertex);
        c = after(c);
        if (out[c] != kNone && !follow_to_corner(out[c], c, region)) return false;
      } while (c != start);
      ++count;
      add_region(region);
    }
    for (std::size_t start = 0; start < used_.size(); ++start) {
      if (used_[start]) continue;
      Polygon region;
      std::size_t arc = start;
      do {
        if (used_[arc] || is_corner(to_of(arc))) return false;
        follow(arc, region);
        if (!next_arc(arc, arc)) return false;
      } while (arc != start);
      ++count;
      add_region(region);
    }
    return count + inner_nodes == 1 + lines_.size();  // Euler: a disk
  }

  void add_region(const Polygon& region) {
    Polygon single;
    for (const std::uint8_t v : region)
      if (single.empty() || single.back() != v) single.push_back(v);
    while (single.size() > 1 && single.front() == single.back()) single.pop_back();
    if (single.size() > 2) regions_.push_back(std::move(single));
  }

  void mark_edge(std::uint8_t a, std::uint8_t b) {
    taken_[a] |= std::uint64_t{1} << b;
    taken_[b] |= std::uint64_t{1} << a;
  }

  [[nodiscard]] float cost_of(std::uint8_t a, std::uint8_t b, std::uint8_t c) const {
    if (a == b || b == c || c == a) return kNoTriangle;
    const Float3 n = triangle_normal(position_[a], position_[b], position_[c]);
    return std::sqrt(dot(n, n)) + (is_sliver(position_[a], position_[b], position_[c]) ? kSliverCost : 0.0f);
  }

  bool triangulate(const Polygon& region) {
    const std::size_t size = region.size();
    std::vector<float> cost(size * size, 0.0f);
    std::vector<std::uint8_t> split(size * size, 0);
    for (std::size_t span = 2; span < size; ++span)
      for (std::size_t i = 0; i + span < size; ++i) {
        const std::size_t j = i + span;
        float& best = cost[i * size + j];
        best = kNoTriangle;
        const std::uint8_t a = region[i], b = region[j];
        const bool chord = span + 1 < size;
        if (chord && (a == b || (faces_[a] & faces_[b]) != 0 || (taken_[a] >> b & 1) != 0)) continue;
        for (std::size_t k = i + 1; k < j; ++k) {
          const float sides = cost[i * size + k] + cost[k * size + j];
          if (!(sides < best)) continue;
          const float sum = sides + cost_of(a, region[k], b);
          if (!(sum < best)) continue;
          best = sum;
          split[i * size + j] = static_cast<std::uint8_t>(k);
        }
      }
    if (!(cost[size - 1] < kSliverCost)) return false;
    const std::size_t first = patch_.triangles.size();
    emit(region, split, 0, size - 1);
    return !is_folded(region, first);
  }
  /// Whether triangles of a region, which is smooth, turn too far at a chord between them. \param first  its first triangle
  [[nodiscard]] bool is_folded(const Polygon& region, std::size_t first) const {
    std::array<std::uint64_t, kMaxVertices> side{};
    for (std::size_t i = 0; i < region.size(); ++i)
      side[region[i]] |= std::uint64_t{1} << region[i + 1 == region.size() ? 0 : i + 1];
    const auto normal = [&](const std::array<std::uint8_t, 3>& t) {
      return unit_or_zero(
          triangle_normal(wide(position_[t[0]]), wide(position_[t[1]]), wide(position_[t[2]])));
    };
    const auto& all = patch_.triangles;
    for (std::size_t i = first; i < all.size(); ++i)
      for (std::size_t j = i + 1; j < all.size(); ++j)
        for (std::size_t e = 0; e < 9; ++e) {
          const std::uint8_t a = all[i][e / 3], b = all[i][(e / 3 + 1) % 3];
          if (all[j][e % 3] != b || all[j][(e % 3 + 1) % 3] != a) continue;
          if ((side[a] >> b & 1) != 0 && (side[b] >> a & 1) != 0)
            continue;  // both sides of a crease that ends
          if (!(dot(normal(all[i]), normal(all[j])) > kFoldCosine)) return true;
        }
    return false;
  }
  void emit(const Polygon& region, const std::vector<std::uint8_t>& split, std::size_t i, std::size_t j) {
    if (j - i < 2) return;
    const std::size_t k = split[i * region.size() + j];
    patch_.triangles.push_back({region[i], region[k], region[j]});
    if (j - i + 1 < region.size()) mark_edge(region[i], region[j]);
    emit(region, split, i, k);
    emit(region, split, k, j);
  }

  /// Every side of a triangle is the outline's, or another triangle has it the other way.
  [[nodiscard]] bool is_sheet() const {
    std::array<std::uint64_t, kMaxVertices> side{};
    const auto has = [&](std::uint8_t a, std::uint8_t b) { return (side[a] >> b & 1) != 0; };
    std::size_t sides = 0;
    for (const auto& t : patch_.triangles)
      for (std::size_t k = 0; k < 3; ++k, ++sides) {
        if (has(t[k], t[(k + 1) % 3])) return false;
        side[t[k]] |= std::uint64_t{1} << t[(k + 1) % 3];
      }
    std::size_t open = 0, wanted = 0;
    for (std::size_t c = 0; c < corners(); ++c) {
      const std::uint8_t a = in_.corners[c].vertex, b = in_.corners[after(c)].vertex;
      if (a == b) continue;
      ++wanted;
      if (!has(a, b) || has(b, a)) return false;
    }
    for (const auto& t : patch_.triangles)
      for (std::size_t k = 0; k < 3; ++k) open += has(t[(k + 1) % 3], t[k]) ? 0u : 1u;
    return open == wanted;
  }

  [[nodiscard]] bool crosses_itself() const {
    std::vector<ContactFace> faces;
    for (const auto& t : patch_.triangles) {
      ContactFace face;
      for (std::size_t k = 0; k < 3; ++k) {
        face.corner[k] = wide(position_[t[k]]);
        face.vertex[k] = t[k];
      }
      if (collinear(face.corner[0], face.corner[1], face.corner[2])) return true;
      for (const ContactFace& other : faces)
        if (face_contact(other, face) != FaceContact::kNone || lies_on(other, face) || lies_on(face, other))
          return true;
      faces.push_back(face);
    }
    return false;
  }
  /// Whether one face lies so close on the other that it may lie below once vertices are rounded.
  [[nodiscard]] static bool lies_on(const ContactFace& face, const ContactFace& other) {
    const auto normal = [](const ContactFace& f) {
      return unit_or_zero(triangle_normal(f.corner[0], f.corner[1], f.corner[2]));
    };
    const Double3 up = normal(face);
    if (dot(up, normal(other)) > kBackCosine) return false;
    for (const double height : {kLift, -kLift}) {
      ContactFace moved = other;
      for (std::size_t k = 0; k < 3; ++k)
        if (std::find(face.vertex.begin(), face.vertex.end(), other.vertex[k]) == face.vertex.end())
          moved.corner[k] = moved.corner[k] + up * height;
      if (face_contact(face, moved) != FaceContact::kNone) return true;
    }
    return false;
  }

  static constexpr std::size_t kNone = ~std::size_t{0};

  const PatchOutline& in_;
  CreasePatch& patch_;
  std::size_t vertices_;
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> around_;  ///< per node: links and which end
  std::vector<Polyline> lines_;
  std::vector<std::uint8_t> vertex_;  ///< per node
  std::vector<Float3> position_;      ///< per vertex
  std::vector<std::uint8_t> faces_;
  std::vector<std::uint8_t> used_;  ///< per arc
  std::vector<Polygon> regions_;
  std::array<std::uint64_t, kMaxVertices> taken_{};  ///< edges that no other chord may repeat
};

}  // namespace

bool triangulate_patch(const PatchOutline& outline, std::size_t vertices, CreasePatch& patch) {
  return Cutter(outline, vertices, patch).cut();
}

}  // namespace tessera
