#include "stream/check/mesh_topology.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "octree/error.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;

bool is_finite(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// Keeps the `kListedParts` greatest items.
template <class Part, class Greater>
void list_part(std::vector<Part>& list, const Part& part, Greater greater) {
  list.insert(std::upper_bound(list.begin(), list.end(), part, greater), part);
  if (list.size() > kListedParts) list.pop_back();
}

/// Part of a boundary chain: ends of edges at vertices, and how many of them found no continuation there.
struct Chain {
  std::uint64_t ends = 0;
  std::uint64_t loose = 0;
};

void join_component(MeshComponent& into, const MeshComponent& from) {
  into.vertices += from.vertices;
  into.edges += from.edges;
  into.faces += from.faces;
  into.boundary_edges += from.boundary_edges;
  into.defects += from.defects;
}
void join_component(Chain& into, const Chain& from) {
  into.ends += from.ends;
  into.loose += from.loose;
}

void tally(const MeshComponent& part, MeshCheck& check) {
  ++check.components;
  if (part.solid()) {
    ++check.solid_components;
    check.total_genus += part.genus();
  }
  list_part(check.largest_components, part, [](const MeshComponent& a, const MeshComponent& b) {
    if (a.faces != b.faces) return a.faces > b.faces;
    if (a.vertices != b.vertices) return a.vertices > b.vertices;
    if (a.edges != b.edges) return a.edges > b.edges;
    if (a.boundary_edges != b.boundary_edges) return a.boundary_edges > b.boundary_edges;
    return a.defects > b.defects;
  });
}
void tally(const Chain& part, MeshCheck& check) {
  const BoundaryLoop loop{part.ends / 2, part.loose == 0};
  ++check.boundary_loops;
  if (!loop.closed) ++check.open_loops;
  list_part(check.largest_loops, loop, [](const BoundaryLoop& a, const BoundaryLoop& b) {
    return a.edges != b.edges ? a.edges > b.edges : a.closed > b.closed;
  });
}

/// How many pieces of sets may cross ranges, whatever their kind.
struct PieceBudget {
  std::uint64_t limit;
  std::uint64_t used = 0;
};

/// Sets that cross ranges: their pieces are numbered as ranges end, joined as later ranges find links, and
/// their contents wait in a spill bucket until all links are known.
template <class Part>
class CrossingSets {
 public:
  CrossingSets(SpillPool& pool, PieceBudget& budget) : budget_(&budget), pieces_(pool, 1, 1u << 20) {
    sets_.reserve(budget.limit);
  }

  std::uint32_t add(const Part& part) {
    if (budget_->used >= budget_->limit) {
      throw ResourceError("the mesh check needs more memory: " + std::to_string(budget_->limit) +
                          " parts cross its ranges of vertices already; raise --memory to twice its value");
    }
    ++budget_->used;
    const std::uint32_t id = sets_.add();
    pieces_.add(0, {id, part});
    return id;
  }
  void unite(std::uint32_t a, std::uint32_t b) { sets_.unite(a, b); }
  /// Adds up the pieces of each set, in passes of a bounded number of sets.
  void tally_all(MeshCheck& check) {
    const std::size_t batch = static_cast<std::size_t>(
        budget_->limit * sizeof(std::uint32_t) / (2 * (sizeof(Part) + sizeof(std::uint32_t))) + 1);
    std::vector<std::uint32_t> roots;
    for (std::uint32_t id = 0; id < sets_.size(); ++id) {
      if (sets_.find(id) == id) roots.push_back(id);
      if (roots.size() == batch || (id + 1 == sets_.size() && !roots.empty())) {
        tally_roots(roots, check);
        roots.clear();
      }
    }
  }

 private:
  void tally_roots(const std::vector<std::uint32_t>& roots, MeshCheck& check) {
    std::vector<Part> totals(roots.size());
    pieces_.for_each(0, [&](std::span<const Piece> pieces) {
      for (const Piece& piece : pieces) {
        const auto at = std::lower_bound(roots.begin(), roots.end(), sets_.find(piece.id));
        if (at == roots.end() || *at != sets_.find(piece.id)) continue;
        join_component(totals[static_cast<std::size_t>(at - roots.begin())], piece.part);
      }
    });
    for (const Part& part : totals) tally(part, check);
  }

  struct Piece {
    std::uint32_t id;
    Part part;
  };
  PieceBudget* budget_;
  UnionFind sets_;
  SpillBuckets<Piece> pieces_;
};

template <class Index>
class Topology : public MeshTopology {
  struct Corner {
    Index vertex, next, previous;  ///< all equal: the vertex is referenced and nothing else is known
  };
  struct Link {
    Index next, previous;
  };
  /// The component of `vertex` contains piece `id`.
  struct ComponentLink {
    Index vertex;
    std::uint32_t id;
  };
  /// One end of a boundary edge, the one at `vertex`; `id` is the piece that holds the other end.
  struct End {
    Index vertex, other;
    auto operator<=>(const End&) const = default;
  };
  struct EndLink {
    End end;
    std::uint32_t id;
  };
  /// A face on its way to the ranges of its other corners, which come later.
  struct OneKnown {
    Index middle, last;
    std::uint32_t flip;
    Double3 first;
  };
  struct TwoKnown {
    Index last;
    std::uint32_t flip;
    Double3 first, middle;
  };
  /// A use of an edge by a face around the vertex at hand.
  struct Use {
    Index other;
    std::uint32_t corner_out;  ///< corner * 2 + (1 if the face runs from the vertex to `other`)
  };

 public:
  Topology(const TopologyPlan& plan, SpillPool& pool)
      : plan_(plan),
        corners_(pool, ranges(), plan.chunk_bytes),
        component_links_(pool, ranges(), plan.chunk_bytes),
        end_links_(pool, ranges(), plan.chunk_bytes),
        one_known_(pool, ranges(), plan.chunk_bytes),
        two_known_(pool, ranges(), plan.chunk_bytes),
        pieces_{std::min<std::uint64_t>(plan.link_bytes / sizeof(std::uint32_t), kNone)},
        crossing_components_(pool, pieces_),
        crossing_chains_(pool, pieces_) {
    // Finds the range of a vertex in two steps: a coarse table, then the few bounds within a slot.
    const std::uint64_t vertices = plan.bounds.back();
    while ((vertices >> slot_shift_) > 65535) ++slot_shift_;
    std::uint32_t range = 0;
    for (std::uint64_t slot = 0; slot <= vertices >> slot_shift_; ++slot) {
      while (range + 1 < ranges() && plan.bounds[range + 1] <= slot << slot_shift_) ++range;
      slot_range_.push_back(range);
    }
  }

  void add(std::span<const MeshFace> faces) override {
    for (const MeshFace& face : faces) {
      const Index a = static_cast<Index>(face[0]), b = static_cast<Index>(face[1]),
                  c = static_cast<Index>(face[2]);
      if (a == b || b == c || c == a) {
        ++degenerate_;
        for (const Index v : {a, b, c}) corners_.add(range_of(v), {v, v, v});
        continue;
      }
      corners_.add(range_of(a), {a, b, c});
      corners_.add(range_of(b), {b, c, a});
      corners_.add(range_of(c), {c, a, b});
    }
  }

  void analyse(VertexStore& positions, MeshShape& shape, const std::function<void()>& check_stop,
               MeshCheck& check) override {
    check.degenerate_faces += degenerate_;
    for (std::size_t range = 0; range < ranges(); ++range) {
      analyse_range(range, positions, shape, check_stop, check);
      corners_.release(range);
      component_links_.release(range);
      end_links_.release(range);
      one_known_.release(range);
      two_known_.release(range);
    }
    crossing_components_.tally_all(check);
    crossing_chains_.tally_all(check);
  }

 private:
  std::size_t ranges() const { return plan_.bounds.size() - 1; }
  std::size_t range_of(std::uint64_t vertex) const {
    std::size_t range = slot_range_[vertex >> slot_shift_];
    while (plan_.bounds[range + 1] <= vertex) ++range;
    return range;
  }
  bool inside(Index vertex) const { return vertex >= begin_ && vertex < end_; }
  std::uint32_t local(Index vertex) const { return static_cast<std::uint32_t>(vertex - begin_); }
  std::span<const Link> around(std::uint32_t v) const {
    return {links_.data() + first_[v], links_.data() + first_[v + 1]};
  }

  void analyse_range(std::size_t range, VertexStore& positions, MeshShape& shape,
                     const std::function<void()>& check_stop, MeshCheck& check) {
    begin_ = static_cast<Index>(plan_.bounds[range]);
    end_ = static_cast<Index>(plan_.bounds[range + 1]);
    if (check_stop) check_stop();
    load_links(range, check);
    find_components(range);
    ends_.clear();
    loose_.clear();
    chains_.reset(0);
    for (std::uint32_t v = 0; v < local(end_); ++v) {
      if (check_stop && v % 65536 == 0) check_stop();
      if (first_[v + 1] > first_[v]) analyse_vertex(v, check);
    }
    close_components(range, check);
    close_chains(range, check);
    measure(range, positions, shape);
  }

  /// Sorts the corners of the range by vertex (counting sort: two passes over the bucket).
  void load_links(std::size_t range, MeshCheck& check) {
    const std::size_t n = local(end_);
    first_.assign(n + 2, 0);
    std::vector<bool> referenced(n, false);
    corners_.for_each(range, [&](std::span<const Corner> corners) {
      for (const Corner& c : corners) {
        referenced[local(c.vertex)] = true;
        if (c.next != c.vertex) ++first_[local(c.vertex) + 2];
      }
    });
    for (const bool r : referenced) check.unreferenced_vertices += r ? 0 : 1;
    for (std::size_t v = 2; v < n + 2; ++v) first_[v] += first_[v - 1];
    links_.resize(first_[n + 1]);
    corners_.for_each(range, [&](std::span<const Corner> corners) {
      for (const Corner& c : corners) {
        if (c.next != c.vertex) links_[first_[local(c.vertex) + 1]++] = {c.next, c.previous};
      }
    });
  }

  /// Numbers the components of the range; those that reach out of it get a piece number when they are
  /// complete.
  void find_components(std::size_t range) {
    const std::uint32_t n = local(end_);
    UnionFind sets(n);
    for (std::uint32_t v = 0; v < n; ++v) {
      for (const Link& link : around(v)) {
        if (inside(link.next)) sets.unite(v, local(link.next));
        if (inside(link.previous)) sets.unite(v, local(link.previous));
      }
    }
    component_of_.assign(n, kNone);
    components_.clear();
    crosses_.clear();
    for (std::uint32_t v = 0; v < n; ++v) {
      if (first_[v + 1] == first_[v]) continue;
      const std::uint32_t root = sets.find(v);  // the smallest member: numbered before the others
      if (root == v) {
        component_of_[v] = static_cast<std::uint32_t>(components_.size());
        components_.emplace_back();
        crosses_.push_back(false);
      }
      component_of_[v] = component_of_[root];
      for (const Link& link : around(v)) {
        if (!inside(link.next) || !inside(link.previous)) crosses_[component_of_[v]] = true;
      }
    }
    component_links_.for_each(range, [&](std::span<const ComponentLink> links) {
      for (const ComponentLink& link : links) crosses_[component_of_[local(link.vertex)]] = true;
    });
  }

  void analyse_vertex(std::uint32_t v, MeshCheck& check) {
    const std::span<const Link> links = around(v);
    const Index vertex = begin_ + static_cast<Index>(v);
    MeshComponent& component = components_[component_of_[v]];
    ++component.vertices;

    uses_.clear();
    for (std::uint32_t i = 0; i < links.size(); ++i) {
      uses_.push_back({links[i].next, 2 * i + 1});
      uses_.push_back({links[i].previous, 2 * i});
    }
    std::sort(uses_.begin(), uses_.end(), [](const Use& a, const Use& b) { return a.other < b.other; });

    fans_.reset(links.size());
    irregular_.assign(links.size(), false);
    bool manifold = true;
    const std::size_t first_end = ends_.size();
    end_corner_.clear();
    for (std::size_t i = 0; i < uses_.size();) {
      std::size_t j = i, out = 0;
      for (; j < uses_.size() && uses_[j].other == uses_[i].other; ++j) {
        out += uses_[j].corner_out & 1;
        fans_.unite(uses_[i].corner_out / 2, uses_[j].corner_out / 2);
      }
      const std::size_t count = j - i;
      if (count > 2) {
        manifold = false;
        irregular_[uses_[i].corner_out / 2] = true;
      }
      if (count == 1) {
        ends_.push_back({vertex, uses_[i].other});
        end_corner_.push_back(uses_[i].corner_out / 2);
      }
      if (vertex < uses_[i].other) count_edge(count, out, component, check);
      i = j;
    }
    std::size_t fans = 0;
    for (std::uint32_t i = 0; i < links.size(); ++i) {
      if (fans_.find(i) == i) ++fans;
      if (irregular_[i]) irregular_[fans_.find(i)] = true;
    }
    if (fans > 1 || !manifold) {
      ++check.nonmanifold_vertices;
      ++component.defects;
    }
    if (ends_.size() > first_end) continue_chains(first_end, links.size());
    count_faces(vertex, links, component, check);
  }

  static void count_edge(std::size_t uses, std::size_t out, MeshComponent& component, MeshCheck& check) {
    ++check.edges;
    ++component.edges;
    if (uses == 1) {
      ++check.boundary_edges;
      ++component.boundary_edges;
    } else if (uses > 2) {
      ++check.nonmanifold_edges;
      ++component.defects;
    } else if (out != 1) {
      ++check.inconsistent_edges;
      ++component.defects;
    }
  }

  /// A fan has no boundary end or two; the two continue each other. Ends at a non-manifold edge stay loose.
  void continue_chains(std::size_t first_end, std::size_t corners) {
    end_of_fan_.assign(corners, kNone);
    for (std::size_t i = first_end; i < ends_.size(); ++i) {
      const std::uint32_t end = chains_.add();
      const std::uint32_t fan = fans_.find(end_corner_[i - first_end]);
      loose_.push_back(irregular_[fan]);
      if (irregular_[fan]) continue;
      if (end_of_fan_[fan] != kNone) chains_.unite(end, end_of_fan_[fan]);
      end_of_fan_[fan] = end;
    }
  }

  /// Counts the faces whose lowest corner is `vertex`, and those among them that repeat another.
  void count_faces(Index vertex, std::span<const Link> links, MeshComponent& component, MeshCheck& check) {
    opposite_.clear();
    for (const Link& link : links) {
      if (link.next > vertex && link.previous > vertex)
        opposite_.push_back(std::minmax(link.next, link.previous));
    }
    component.faces += opposite_.size();
    std::sort(opposite_.begin(), opposite_.end());
    for (std::size_t i = 1; i < opposite_.size(); ++i) {
      if (opposite_[i] == opposite_[i - 1]) ++check.duplicate_faces;
    }
  }

  void close_components(std::size_t range, MeshCheck& check) {
    std::vector<std::uint32_t> piece(components_.size(), kNone);
    for (std::size_t c = 0; c < components_.size(); ++c) {
      if (crosses_[c]) {
        piece[c] = crossing_components_.add(components_[c]);
      } else {
        tally(components_[c], check);
      }
    }
    component_links_.for_each(range, [&](std::span<const ComponentLink> links) {
      for (const ComponentLink& link : links) {
        crossing_components_.unite(piece[component_of_[local(link.vertex)]], link.id);
      }
    });
    for (std::uint32_t v = 0; v < local(end_); ++v) {
      for (const Link& link : around(v)) {
        for (const Index other : {link.next, link.previous}) {
          if (other >= end_) component_links_.add(range_of(other), {other, piece[component_of_[v]]});
        }
      }
    }
  }

  void close_chains(std::size_t range, MeshCheck& check) {
    const auto index_of = [&](const End& end) {
      const auto at = std::lower_bound(ends_.begin(), ends_.end(), end);
      assert(at != ends_.end() && *at == end);
      return static_cast<std::uint32_t>(at - ends_.begin());
    };
    // Both ends of an edge within the range belong together; the others make their chain a crossing one.
    for (std::uint32_t i = 0; i < ends_.size(); ++i) {
      if (ends_[i].other > ends_[i].vertex && inside(ends_[i].other)) {
        chains_.unite(i, index_of({ends_[i].other, ends_[i].vertex}));
      }
    }
    std::vector<Chain> parts(ends_.size());
    std::vector<bool> crossing(ends_.size(), false);
    for (std::uint32_t i = 0; i < ends_.size(); ++i) {
      const std::uint32_t root = chains_.find(i);
      ++parts[root].ends;
      parts[root].loose += loose_[i] ? 1 : 0;
      if (!inside(ends_[i].other)) crossing[root] = true;
    }
    std::vector<std::uint32_t> piece(ends_.size(), kNone);
    for (std::uint32_t i = 0; i < ends_.size(); ++i) {
      if (chains_.find(i) != i) continue;
      if (crossing[i]) {
        piece[i] = crossing_chains_.add(parts[i]);
      } else {
        tally(parts[i], check);
      }
    }
    end_links_.for_each(range, [&](std::span<const EndLink> links) {
      for (const EndLink& link : links) {
        crossing_chains_.unite(piece[chains_.find(index_of(link.end))], link.id);
      }
    });
    for (std::uint32_t i = 0; i < ends_.size(); ++i) {
      const End& end = ends_[i];
      if (end.other < end_) continue;
      end_links_.add(range_of(end.other), {{end.other, end.vertex}, piece[chains_.find(i)]});
    }
  }

  /// Measures every face at the range of its last corner; positions of earlier corners travel with it.
  void measure(std::size_t range, VertexStore& positions, MeshShape& shape) {
    if (!shape.usable()) return;
    points_.resize(local(end_));
    positions.read(begin_, points_);
    for (std::uint32_t v = 0; v < local(end_); ++v) {
      const Index vertex = begin_ + static_cast<Index>(v);
      for (const Link& link : around(v)) {
        if (link.next < vertex || link.previous < vertex) continue;
        const bool flip = link.next > link.previous;
        pass_on(
            {flip ? link.previous : link.next, flip ? link.next : link.previous, flip ? 1u : 0u, points_[v]},
            shape);
      }
    }
    one_known_.for_each(range, [&](std::span<const OneKnown> faces) {
      for (const OneKnown& face : faces) pass_on(face, shape);
    });
    two_known_.for_each(range, [&](std::span<const TwoKnown> faces) {
      for (const TwoKnown& face : faces) finish(face, shape);
    });
  }
  void pass_on(const OneKnown& face, MeshShape& shape) {
    if (!inside(face.middle)) {
      one_known_.add(range_of(face.middle), face);
      return;
    }
    const TwoKnown next{face.last, face.flip, face.first, points_[local(face.middle)]};
    if (inside(face.last)) {
      finish(next, shape);
    } else {
      two_known_.add(range_of(face.last), next);
    }
  }
  void finish(const TwoKnown& face, MeshShape& shape) {
    const Double3& last = points_[local(face.last)];
    if (is_finite(face.first) && is_finite(face.middle) && is_finite(last)) {
      shape.add(face.first, face.middle, last, face.flip != 0);
    }
  }

  const TopologyPlan plan_;
  std::vector<std::uint32_t> slot_range_;
  int slot_shift_ = 0;
  std::uint64_t degenerate_ = 0;
  SpillBuckets<Corner> corners_;
  SpillBuckets<ComponentLink> component_links_;
  SpillBuckets<EndLink> end_links_;
  SpillBuckets<OneKnown> one_known_;
  SpillBuckets<TwoKnown> two_known_;
  PieceBudget pieces_;
  CrossingSets<MeshComponent> crossing_components_;
  CrossingSets<Chain> crossing_chains_;

  // The range at hand.
  Index begin_ = 0, end_ = 0;
  std::vector<std::uint64_t> first_;  ///< links_[first_[v] .. first_[v + 1]) are the corners at v
  std::vector<Link> links_;
  std::vector<std::uint32_t> component_of_;  ///< per vertex; kNone if no face
  std::vector<MeshComponent> components_;
  std::vector<bool> crosses_;  ///< per component
  std::vector<End> ends_;      ///< ascending
  std::vector<bool> loose_;    ///< per end
  UnionFind chains_;           ///< over ends_
  std::vector<Double3> points_;

  // The vertex at hand.
  std::vector<Use> uses_;
  UnionFind fans_;                         ///< over its corners
  std::vector<bool> irregular_;            ///< per corner; at roots: the fan has a non-manifold edge
  std::vector<std::uint32_t> end_corner_;  ///< of its ends, in order
  std::vector<std::uint32_t> end_of_fan_;  ///< per corner; at roots: an end that the fan has shown
  std::vector<std::pair<Index, Index>> opposite_;
};

}  // namespace

std::unique_ptr<MeshTopology> make_mesh_topology(const TopologyPlan& plan, SpillPool& pool) {
  if (plan.bounds.back() <= 0xffffffffULL) return std::make_unique<Topology<std::uint32_t>>(plan, pool);
  return std::make_unique<Topology<std::uint64_t>>(plan, pool);
}

}  // namespace tessera
