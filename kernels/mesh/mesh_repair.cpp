#include "kernels/mesh/mesh_repair.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "octree/edge_faces.h"
#include "octree/error.h"
#include "octree/lists.h"
#include "octree/union_find.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr std::uint32_t kBorder = 0xffffffffu;   ///< no partner
constexpr std::uint32_t kUnknown = 0xfffffffeu;  ///< decided by another tile

RepairFace sorted_corners(RepairFace f) {
  if (f[1] < f[0]) std::swap(f[0], f[1]);
  if (f[2] < f[1]) std::swap(f[1], f[2]);
  if (f[1] < f[0]) std::swap(f[0], f[1]);
  return f;
}
/// Smallest corner first, direction kept.
RepairFace reversed(const RepairFace& f) {
  if (f[1] < f[0] && f[1] < f[2]) return {f[1], f[2], f[0]};
  if (f[2] < f[0] && f[2] < f[1]) return {f[2], f[0], f[1]};
  return f;
}

std::uint32_t next_of(std::uint32_t half) {
  return half % 3 == 2 ? half - 2 : half + 1;
}
std::uint32_t previous_of(std::uint32_t half) {
  return half % 3 == 0 ? half + 2 : half - 1;
}

/// The tile with local vertex indices. Half-edge 3 f + e runs from corner e to the next one.
class Repair {
 public:
  explicit Repair(RepairTile&& tile) : tile_(std::move(tile)), local_(std::move(tile_.faces)) {}

  RepairResult run() {
    localise();
    drop_duplicates();
    if (tile_.orient) orient();
    pair_edges();
    split_fans();
    if (tile_.orient && result_.report.split_vertices > 0) split_named_fans();
    collect();
    return std::move(result_);
  }

 private:
  bool owned(std::uint32_t number) const { return number >= tile_.own_begin && number < tile_.own_end; }
  std::uint32_t from(std::uint32_t half) const { return local_[half / 3][half % 3]; }
  std::uint32_t to(std::uint32_t half) const { return local_[half / 3][half % 3 == 2 ? 0 : half % 3 + 1]; }
  bool own_vertex(std::uint32_t local) const { return local >= own_first_ && local < own_last_; }

  /// Numbers become indices of them, which ascend alike; the smallest corner comes first.
  void localise() {
    const auto& number = tile_.number;
    const auto place = [&](std::uint32_t v) {
      return static_cast<std::uint32_t>(std::lower_bound(number.begin(), number.end(), v) - number.begin());
    };
    own_first_ = place(tile_.own_begin);
    own_last_ = place(tile_.own_end);
    // Own numbers are mostly without gaps, so a table finds them; the others are searched.
    std::vector<std::uint32_t> slot(tile_.own_end - tile_.own_begin);
    for (std::uint32_t v = own_first_; v < own_last_; ++v) slot[number[v] - tile_.own_begin] = v;
    for (RepairFace& f : local_) {
      for (std::uint32_t& v : f) {
        const std::uint32_t local = owned(v) ? slot[v - tile_.own_begin] : place(v);
        assert(number[local] == v);
        v = local;
      }
      f = reversed(f);
    }
  }

  /// Ascending by sorted corners; of equal corner sets the smallest stays.
  void drop_duplicates() {
    sort_faces();
    // Faces with the same corner set have the same first corner once turned.
    const auto same = [](const RepairFace& a, const RepairFace& b) {
      return a[0] == b[0] && std::min(a[1], a[2]) == std::min(b[1], b[2]) &&
             std::max(a[1], a[2]) == std::max(b[1], b[2]);
    };
    std::size_t kept = 0;
    for (std::size_t f = 0; f < local_.size(); ++f) {
      if (kept > 0 && same(local_[f], local_[kept - 1])) {
        if (own_vertex(local_[f][0])) ++result_.report.duplicate_faces;
        continue;
      }
      if (kept != f) local_[kept] = local_[f];
      ++kept;
    }
    local_.resize(kept);
  }

  /// A counting sort by first corner, then the few faces of each.
  void sort_faces() {
    std::vector<RepairFace> sorted(local_.size());
    std::vector<std::uint32_t> begin(tile_.number.size() + 1);
    counting_sort<RepairFace>(local_, sorted, begin, [](const RepairFace& f) { return f[0]; });
    local_.swap(sorted);
    for (std::size_t f = 0, end = 0; f < local_.size(); f = end) {
      end = f + 1;
      while (end < local_.size() && local_[end][0] == local_[f][0]) ++end;
      if (end > f + 1) sort_star(std::span(local_).subspan(f, end - f));
    }
  }

  /// Faces of one first corner, by the smaller and the larger one of the others; of equal ones as the corners are.
  static void sort_star(std::span<RepairFace> faces) {
    const auto others = [](const RepairFace& f) {
      return std::uint64_t{std::min(f[1], f[2])} << 32 | std::max(f[1], f[2]);
    };
    const auto before = [&](const RepairFace& a, const RepairFace& b) {
      const std::uint64_t of_a = others(a), of_b = others(b);
      return of_a != of_b ? of_a < of_b : a[1] < b[1];
    };
    constexpr std::size_t kFew = 16;
    if (faces.size() > kFew) {
      std::sort(faces.begin(), faces.end(), before);
      return;
    }
    for (std::size_t i = 1; i < faces.size(); ++i) {
      const RepairFace f = faces[i];
      std::size_t j = i;
      for (; j > 0 && before(f, faces[j - 1]); --j) faces[j] = faces[j - 1];
      faces[j] = f;
    }
  }

  /// Parts joined by edges of two faces: a spanning tree gives each face a parity, the majority of the part
  /// wins.
  void orient() {
    const std::vector<std::uint32_t> neighbour = opposite_half_edges(tile_.number.size(), local_);
    std::vector<std::uint8_t> state(local_.size(), 0);  // 1 as it is, 2 turned
    std::vector<std::uint32_t> part;
    for (std::uint32_t seed = 0; seed < local_.size(); ++seed) {
      if (state[seed]) continue;
      part.assign(1, seed);
      state[seed] = 1;
      std::size_t reversed_count = 0;
      for (std::size_t i = 0; i < part.size(); ++i) {
        const std::uint32_t f = part[i];
        reversed_count += state[f] == 2;
        for (std::uint32_t e = 0; e < 3; ++e) {
          const std::uint32_t h = 3 * f + e;
          const std::uint32_t g = neighbour[h];
          if (g == kNoHalfEdge || state[g / 3]) continue;
          const bool agree = from(h) == to(g);
          state[g / 3] = agree ? state[f] : static_cast<std::uint8_t>(3 - state[f]);
          part.push_back(g / 3);
        }
      }
      const std::uint8_t wrong = 2 * reversed_count > part.size() ? 1 : 2;
      for (const std::uint32_t f : part) {
        if (state[f] != wrong) continue;
        std::swap(local_[f][1], local_[f][2]);
        ++result_.report.reversed_faces;
      }
    }
  }

  /// Vertex by vertex the edges to larger ones: as a rule each has one half-edge that leaves it and one that comes back.
  void pair_edges() {
    const std::size_t n = tile_.number.size();
    partner_.assign(3 * local_.size(), kUnknown);
    std::vector<std::uint32_t> leaving(n, kBorder);  // of the vertex at hand, by where they end
    // Of faces with larger first corners than the smaller end of their second edge: by that end, in lists.
    std::vector<std::uint32_t> first(n, kBorder), next(local_.size());
    for (std::uint32_t v = 0, begin = 0, end = 0; v < n; ++v, begin = end) {
      for (; end < local_.size() && local_[end][0] == v; ++end) {
        std::uint32_t& list = first[std::min(local_[end][1], local_[end][2])];
        next[end] = std::exchange(list, end);
      }
      const auto each = [&](const auto& leaves, const auto& comes) {
        const auto own = [&](std::uint32_t other) { return own_vertex(v) || own_vertex(other); };
        for (std::uint32_t f = begin; f < end; ++f)
          if (own(local_[f][1])) leaves(3 * f, local_[f][1]);
        for (std::uint32_t f = first[v]; f != kBorder; f = next[f])
          if (local_[f][1] == v && own(local_[f][2])) leaves(3 * f + 1, local_[f][2]);
        for (std::uint32_t f = begin; f < end; ++f)
          if (own(local_[f][2])) comes(3 * f + 2, local_[f][2]);
        for (std::uint32_t f = first[v]; f != kBorder; f = next[f])
          if (local_[f][2] == v && own(local_[f][1])) comes(3 * f + 1, local_[f][1]);
      };
      bool plain = true;
      each(
          [&](std::uint32_t half, std::uint32_t to) {
            plain = plain && leaving[to] == kBorder;
            leaving[to] = half;
            partner_[half] = kBorder;
          },
          [&](std::uint32_t half, std::uint32_t from) {
            const std::uint32_t other = leaving[from];
            if (other == kBorder || partner_[other] != kBorder) {
              plain = false;
              return;
            }
            partner_[other] = half;
            partner_[half] = other;
          });
      const auto clear = [&](std::uint32_t, std::uint32_t to) { leaving[to] = kBorder; };
      each(clear, [](std::uint32_t, std::uint32_t) {});
      if (plain) continue;
      std::vector<std::uint64_t> ends;  // the larger vertex, then the half-edge
      const auto add = [&](std::uint32_t half, std::uint32_t other) {
        ends.push_back(std::uint64_t{other} << 32 | half);
      };
      each(add, add);
      pair_edges_of(v, ends);
    }
  }

  /// Any half-edges between a vertex and larger ones.
  void pair_edges_of(std::uint32_t low, std::vector<std::uint64_t>& ends) {
    std::sort(ends.begin(), ends.end());
    std::vector<std::uint32_t> half;
    const bool counted = own_vertex(low);
    for (std::size_t i = 0; i < ends.size();) {
      const auto high = static_cast<std::uint32_t>(ends[i] >> 32);
      half.clear();
      for (; i < ends.size() && ends[i] >> 32 == high; ++i)
        half.push_back(static_cast<std::uint32_t>(ends[i]));
      for (const std::uint32_t h : half) partner_[h] = kBorder;
      if (half.size() == 1) continue;
      if (half.size() == 2) {
        if (from(half[0]) == to(half[1])) {
          partner_[half[0]] = half[1];
          partner_[half[1]] = half[0];
        } else if (counted) {
          ++result_.report.inconsistent_edges;
        }
        continue;
      }
      if (counted) ++result_.report.nonmanifold_edges;
      if (branch_.empty()) branch_.assign(tile_.number.size(), 0);
      branch_[low] = branch_[high] = 1;
      pair_many(low, high, half);
    }
  }

  /// From the edge into the face of a half-edge, square to the edge, unit length; zero if the face has no
  /// area.
  Double3 into_face(std::uint32_t half, const Double3& origin, const Double3& along) const {
    const Double3& apex = tile_.position[from(previous_of(half))];
    const Double3 d = apex - origin;
    return direction(d - along * dot(d, along));
  }

  /// unit_or_zero but for the last bit: symmetric faces are to stay ties.
  static Double3 direction(const Double3& d) {
    const double length = norm(d);
    return length > 0.0 ? d / length : Double3{};
  }

  void pair_many(std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
    struct Candidate {
      double angle;  // grows with the angle that the two faces enclose on the inside, 0 .. 4
      RepairFace a, b;
      std::uint32_t up, down;
      bool operator<(const Candidate& o) const {
        if (angle != o.angle) return angle < o.angle;
        return a != o.a ? a < o.a : b < o.b;
      }
    };
    const Double3& origin = tile_.position[low];
    const Double3& end = tile_.position[high];
    const Double3 along = direction(end - origin);
    std::vector<Candidate> candidates;
    for (const std::uint32_t up : half) {
      if (from(up) != low) continue;
      const Double3 u = into_face(up, origin, along);
      const Double3 outside = cross(along, u);
      for (const std::uint32_t down : half) {
        if (from(down) == low) continue;
        const Double3 d = into_face(down, origin, along);
        const double cosine = dot(u, d);
        const double sine = -dot(outside, d);
        candidates.push_back(
            {sine >= 0.0 ? 1.0 - cosine : 3.0 + cosine, local_[up / 3], local_[down / 3], up, down});
      }
    }
    std::sort(candidates.begin(), candidates.end());
    for (const Candidate& c : candidates) {
      if (partner_[c.up] != kBorder || partner_[c.down] != kBorder) continue;
      partner_[c.up] = c.down;
      partner_[c.down] = c.up;
    }
  }

  /// Fans of every own vertex; all but the one with the smallest face become copies.
  void split_fans() {
    const std::size_t n = tile_.number.size();
    std::vector<std::uint32_t> degree(n, 0), some(n);  // corners of each vertex, and one of them
    for (std::uint32_t f = 0; f < local_.size(); ++f)
      for (std::uint32_t c = 0; c < 3; ++c) {
        ++degree[local_[f][c]];
        some[local_[f][c]] = 3 * f + c;
      }
    copy_.assign(local_.size(), {0, 0, 0});
    std::vector<std::uint32_t> many;  // vertices of several fans, or of an edge with several pairs of faces
    for (std::uint32_t v = own_first_; v < own_last_; ++v) {
      if (degree[v] == 0) continue;
      if ((!branch_.empty() && branch_[v]) || fan_size(some[v]) != degree[v]) many.push_back(v);
    }
    if (many.empty()) return;

    cut_.assign(partner_.size(), 0);
    std::vector<std::uint32_t> rank(n, kBorder);
    for (std::uint32_t i = 0; i < many.size(); ++i) rank[many[i]] = i;
    std::vector<std::vector<std::uint32_t>> corners(many.size());
    for (std::uint32_t h = 0; h < partner_.size(); ++h)
      if (rank[from(h)] != kBorder) corners[rank[from(h)]].push_back(h);
    for (std::uint32_t i = 0; i < many.size(); ++i) {
      std::vector<std::uint8_t> seen(corners[i].size(), 0);
      std::uint32_t copies = 0;
      for (std::size_t k = 0; k < corners[i].size(); ++k) {
        if (seen[k]) continue;
        const std::vector<std::uint32_t> fan = fan_of(corners[i][k]);
        for (const std::uint32_t h : fan) {
          const auto at = std::lower_bound(corners[i].begin(), corners[i].end(), h);
          seen[static_cast<std::size_t>(at - corners[i].begin())] = 1;
        }
        copies = name_copies(fan, copies);
        if (copies > 0xffff)
          throw InputError("vertex " + std::to_string(tile_.number[many[i]]) +
                           " joins more than 65536 parts of the mesh: split them first");
      }
      result_.report.split_vertices += copies - 1;
    }
  }

  /// Gives the corners of a fan copy `copy`, and further ones where it would meet a neighbour a second time:
  /// then one edge would have several pairs of faces. Returns the first copy that is free.
  std::uint32_t name_copies(const std::vector<std::uint32_t>& fan, std::uint32_t copy) {
    const bool closed = partner_[fan.front()] != kBorder;
    std::vector<std::uint32_t> met = {to(fan.front())};
    bool whole = true;
    for (std::size_t i = 0; i < fan.size(); ++i) {
      const std::uint32_t next = from(previous_of(fan[i]));
      const bool closes = closed && whole && i + 1 == fan.size();
      if (!closes && std::find(met.begin(), met.end(), next) != met.end()) {
        cut(fan[i]);
        whole = false;
        ++copy;
        met = {to(fan[i])};
      }
      met.push_back(next);
      copy_[fan[i] / 3][fan[i] % 3] = static_cast<std::uint16_t>(copy);
    }
    if (closed && !whole) cut(fan.front());
    return copy + 1;
  }

  /// Both faces at an edge end there; its other end may know nothing of it.
  void cut(std::uint32_t half) {
    cut_[half] = 1;
    cut_[partner_[half]] = 1;
  }

  /// Corners (as the half-edges that leave the vertex) of the fan of one of them: from its end, or around
  /// from there.
  std::vector<std::uint32_t> fan_of(std::uint32_t corner) const {
    std::uint32_t first = corner;
    while (partner_[first] != kBorder) {
      first = next_of(partner_[first]);
      if (first == corner) break;
    }
    std::vector<std::uint32_t> fan;
    for (std::uint32_t h = first;;) {
      fan.push_back(h);
      h = partner_[previous_of(h)];
      if (h == kBorder || h == first) return fan;
      assert(h != kUnknown);
    }
  }

  std::uint32_t fan_size(std::uint32_t corner) const {
    std::uint32_t count = 1;
    for (std::uint32_t h = partner_[previous_of(corner)]; h != kBorder; h = partner_[previous_of(h)]) {
      if (h == corner) return count;
      ++count;
    }
    for (std::uint32_t across = partner_[corner]; across != kBorder; across = partner_[next_of(across)])
      ++count;
    return count;
  }

  /// Copies are named star by star, so that a cut at one end of an edge may leave the other end with several fans. Where
  /// the whole mesh is here, the fans of what is named now are split once more. A fan keeps its copies on both sides of
  /// every edge that joins two of its faces, so this never breaks another one up.
  void split_named_fans() {
    const auto halves = static_cast<std::uint32_t>(partner_.size());
    struct Edge {
      std::array<std::uint64_t, 2> ends;  // ascending
      std::uint32_t half;
      bool operator<(const Edge& o) const { return ends != o.ends ? ends < o.ends : half < o.half; }
    };
    const auto name = [&](std::uint32_t half) {
      return std::uint64_t{from(half)} << 16 | copy_[half / 3][half % 3];
    };
    std::vector<Edge> edges;
    for (std::uint32_t h = 0; h < halves; ++h) {
      const std::uint64_t a = name(h), b = name(next_of(h));
      edges.push_back({{std::min(a, b), std::max(a, b)}, h});
    }
    std::sort(edges.begin(), edges.end());
    UnionFind fans(halves);
    cut_.assign(halves, 1);
    for (std::size_t i = 0; i < edges.size();) {
      std::size_t end = i + 1;
      while (end < edges.size() && edges[end].ends == edges[i].ends) ++end;
      const std::uint32_t g = edges[i].half, h = edges[end - 1].half;
      if (end == i + 2 && name(g) == name(next_of(h))) {
        fans.unite(g, next_of(h));
        fans.unite(next_of(g), h);
        cut_[g] = cut_[h] = 0;
        partner_[g] = h;
        partner_[h] = g;
      }
      i = end;
    }
    std::vector<std::pair<std::uint64_t, std::uint32_t>> corners;  // by vertex and copy, then fan
    for (std::uint32_t h = 0; h < halves; ++h) corners.emplace_back(name(h), fans.find(h));
    std::vector<std::uint32_t> order(halves);
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return corners[a] != corners[b] ? corners[a] < corners[b] : a < b;
    });
    std::vector<std::uint32_t> copies(tile_.number.size(), 0);  // of each vertex
    for (std::uint32_t h = 0; h < halves; ++h)
      copies[from(h)] = std::max<std::uint32_t>(copies[from(h)], copy_[h / 3][h % 3] + 1u);
    for (std::size_t i = 1; i < order.size(); ++i) {
      const auto &before = corners[order[i - 1]], &now = corners[order[i]];
      if (before.first != now.first) continue;
      const std::uint32_t h = order[i], last = order[i - 1];
      if (before.second == now.second) {
        copy_[h / 3][h % 3] = copy_[last / 3][last % 3];
        continue;
      }
      if (copies[from(h)] > 0xffff)
        throw InputError("vertex " + std::to_string(tile_.number[from(h)]) +
                         " joins more than 65536 parts of the mesh: split them first");
      copy_[h / 3][h % 3] = static_cast<std::uint16_t>(copies[from(h)]++);
      ++result_.report.split_vertices;
    }
  }

  void collect() {
    RepairResult& out = result_;
    const auto first_of = [&](std::uint32_t vertex) {
      return static_cast<std::size_t>(
          std::partition_point(local_.begin(), local_.end(),
                               [&](const RepairFace& f) { return f[0] < vertex; }) -
          local_.begin());
    };
    const std::size_t begin = first_of(own_first_), end = first_of(own_last_);
    const auto part = [&](const auto& values) { return std::span(values).subspan(begin, end - begin); };
    out.local.assign(part(local_).begin(), part(local_).end());
    out.copy.assign(part(copy_).begin(), part(copy_).end());
    out.faces.resize(end - begin);
    out.border.resize(end - begin);
    for (std::size_t i = 0; i < out.faces.size(); ++i) {
      out.faces[i] = numbers_of(out.local[i]);
      const auto half = static_cast<std::uint32_t>(3 * (begin + i));
      const unsigned a = ends_at(half), b = ends_at(half + 1), c = ends_at(half + 2);
      out.border[i] = static_cast<std::uint8_t>(a | b << 1 | c << 2);
      out.report.border_edges += a + b + c;
    }
    for (std::size_t f = 0; f < begin; ++f) add_fixes(static_cast<std::uint32_t>(f));
    for (std::size_t f = end; f < local_.size(); ++f) add_fixes(static_cast<std::uint32_t>(f));
    std::sort(out.fixes.begin(), out.fixes.end());
  }

  RepairFace numbers_of(const RepairFace& local) const {
    return {tile_.number[local[0]], tile_.number[local[1]], tile_.number[local[2]]};
  }

  /// What is known here of a face that another tile keeps.
  void add_fixes(std::uint32_t f) {
    const RepairFace face = numbers_of(local_[f]), corners = sorted_corners(face);
    const auto slot = [&](std::uint32_t v) {
      return static_cast<std::uint16_t>(v == corners[0] ? 0 : v == corners[1] ? 1 : 2);
    };
    std::vector<RepairFix>& fixes = result_.fixes;
    for (std::uint32_t e = 0; e < 3; ++e) {
      if (owned(face[e]) && copy_[f][e] != 0) fixes.push_back({corners, slot(face[e]), copy_[f][e]});
      // The tile that keeps the face knows nothing of its edge between the two larger corners, if neither
      // is its own: the owner of the smaller one tells. Of cuts only who makes them knows.
      const std::uint32_t half = 3 * f + e;
      if (!ends_at(half)) continue;
      const std::uint16_t i = slot(face[e]);
      const std::uint16_t j = slot(face[(e + 1) % 3]);
      const bool known = std::min(i, j) == 1 && owned(corners[1]);
      if (known || (!cut_.empty() && cut_[half]))
        fixes.push_back({corners, static_cast<std::uint16_t>(i + j == 2 ? 5 : 3 + std::min(i, j)), 0});
    }
  }

  bool ends_at(std::uint32_t half) const {
    return partner_[half] == kBorder || (!cut_.empty() && cut_[half]);
  }

  RepairTile tile_;
  std::vector<RepairFace> local_;  ///< faces by indices of RepairTile::number
  std::uint32_t own_first_ = 0;
  std::uint32_t own_last_ = 0;
  std::vector<std::uint32_t> partner_;  ///< per half-edge
  /// Per vertex: an edge with more than two faces ends here; empty if none does.
  std::vector<std::uint8_t> branch_;
  std::vector<std::uint8_t> cut_;  ///< per half-edge; empty if nothing is split
  std::vector<std::array<std::uint16_t, 3>> copy_;
  RepairResult result_;
};

}  // namespace

RepairResult repair_tile(RepairTile&& tile) {
  return Repair(std::move(tile)).run();
}

}  // namespace tessera
