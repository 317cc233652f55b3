/// \file decimator.h
/// The greedy loop of decimate(): candidates by cost class, binary legality, collapse. See decimate.h.
///
/// Most collapses are far below the tolerance. In a first pass those go first, in a few sweeps over the vertices in the
/// order of their places with a rising limit of the cost: a star and its neighbours are then in the cache, and what is
/// left for the queue is small. In a sweep no vertex goes whose star another collapse has changed in it, so stars stay
/// round. What the sweeps leave is a coarse reference as well: it has a tenth of the faces, each with a small bound.
/// After them the queue too takes the vertices part by part, and at last those that another part has woken: its order is
/// one of costs, so that stars come from all over what it takes.
#pragma once
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "kernels/decimate/collapse_deviation.h"
#include "kernels/decimate/collapse_legality.h"
#include "kernels/decimate/collapse_mesh.h"
#include "kernels/decimate/cost_queue.h"
#include "kernels/decimate/crossing_guard.h"
#include "kernels/decimate/decimate.h"
#include "kernels/decimate/quadric.h"
#include "kernels/decimate/reference_deviation.h"
#include "kernels/decimate/star_lanes.h"

namespace tessera {

/// What a halfedge collapse costs by quadrics: the error of q, which goes to `to`, and of what is there already.
inline double endpoint_cost(const Quadric& q, const CollapseVertex& to) {
  const double error = q(to.at[0], to.at[1], to.at[2]);
  return (error > 0.0 ? error : 0.0) + to.error;
}
/// In a plane all costs are 0 but for rounding: there short edges go first.
inline double tie_cost(double squared_edge) {
  return 1e-8 * squared_edge * squared_edge;
}

class Decimator {
 public:
  /// \param mesh       features are marked
  /// \param reference  same origin as mesh; used when options.tolerance > 0
  /// \param block      takes the places and attributes of vertices that move (kOptimal)
  /// \param origin     of mesh
  /// \param reference_vertex  per vertex of the mesh the same one in the reference, or kNoCorner
  /// \param guard_all  false: where a star is nearly flat, sweeps do not look for faces that would cross; then look at the result
  Decimator(CollapseMesh& mesh, const CollapseMesh& reference, std::vector<std::uint32_t> reference_vertex,
            const DecimateOptions& options, MeshBlock& block, const Double3& origin, bool guard_all);

  void run(DecimateReport& report);
  /// Whether collapses were done in which no face was looked for that would cross.
  bool trusted() const { return trusted_; }

 private:
  using Refusal = CollapseRefusal;
  enum class Doubt : std::uint8_t { kOpen, kWithin, kBeyond };
  struct Candidate {
    double cost;
    std::uint32_t vertex;
    std::uint32_t at;  ///< place in the ring
  };

  /// Area-weighted sum of original normals.
  struct NormalSum {
    Double3 normal{};
    double area = 0.0;
    NormalSum& operator+=(const NormalSum& o) {
      normal = normal + o.normal;
      area += o.area;
      return *this;
    }
  };
  /// Where the removed vertex comes to lie: in the face or on the edge of a, b, c; weights of a and b.
  struct Foot {
    std::uint32_t a = 0, b = 0, c = 0;
    double wa = 0.0, wb = 0.0;
  };

  void accumulate_quadrics();
  bool sweeps() const;
  void sweep_all(DecimateReport& report);
  void sweep(double max_cost, std::vector<float>& minimum, DecimateReport& report);
  bool gather(std::uint32_t u, Star& star);
  bool trusts(std::uint32_t u, const Star& star);
  StarLanes::Cheapest find_cheapest(std::uint32_t u, const Star& star);
  bool check_cheap(std::uint32_t u, const Star& star, std::size_t at);
  double largest_bound(const Star& star) const {
    float bound = 0.0f;
    for (std::size_t i = 0; i < star.faces; ++i) {
      const float own = mesh_.face(star.corner[i] >> 2).bound;
      bound = own > bound ? own : bound;
    }
    return static_cast<double>(bound);
  }
  void compact(std::vector<float>& minimum);
  void seed_queue(bool woken);
  void empty_queue(DecimateReport& report);
  void mark_done_faces(bool later);
  /// cost() where it is but a quadric, without the calls.
  double plain_cost(const Quadric& q, const Double3& from, std::uint32_t v) const {
    const CollapseVertex& to = mesh_.node(v);
    const Double3 edge = to.at - from;
    return endpoint_cost(q, to) + tie_cost(dot(edge, edge));
  }
  std::size_t list_candidates(std::uint32_t u, const Star& star, std::array<Candidate, kMaxRing + 1>& list);
  /// Brings the cheapest of list[at] .. list[n - 1] to `at`; equal costs fall to the lower vertex.
  static const Candidate& next_candidate(std::array<Candidate, kMaxRing + 1>& list, std::size_t at,
                                         std::size_t n) {
    std::size_t minimum = at;
    for (std::size_t i = at + 1; i < n; ++i)
      if (list[i].cost < list[minimum].cost ||
          (list[i].cost == list[minimum].cost && list[i].vertex < list[minimum].vertex))
        minimum = i;
    std::swap(list[at], list[minimum]);
    return list[at];
  }
  void update_error(std::uint32_t v);
  double cost(std::uint32_t u, const Quadric& q, const Star& star, std::size_t at);
  double normal_cost(std::uint32_t u, const Star& star, std::size_t at) const;
  double worst_shape(const Star& star, std::size_t at) const;
  double attribute_cost(std::uint32_t u) const;
  Refusal check(std::uint32_t u, const Star& star, std::size_t at);
  Refusal check_star(std::uint32_t u, const Star& star, std::size_t at);
  bool bound_by_sum(std::uint32_t u, const Star& star, std::size_t at);
  void lay_link(const Star& star, std::size_t at);
  bool may_move(std::uint32_t u, std::uint32_t v) const;
  Double3 best_position(const Quadric& q, std::uint32_t u, std::uint32_t v) const;
  Double3 as_stored(const Double3& p) const;
  bool check_optimal(std::uint32_t u, const Star& star, std::size_t at);
  void move_vertex(std::uint32_t u, std::uint32_t v);
  /// Whether faces would meet others that check_star() does not know of.
  bool adds_crossing(const Star& star, std::size_t at) {
    if (options_.allow_crossings) return false;
    return moves_ ? guard_.collapse_adds(star, at, other_star_, target_) : guard_.collapse_adds(star, at);
  }
  Refusal check_deviation(std::uint32_t u, const Star& star, std::size_t at);
  Refusal query_reference(std::uint32_t u, const Star& star, std::size_t at, bool short_sum,
                          double on_line_deviation);
  void make_side(const Star& star, std::uint32_t v, std::size_t from, std::size_t to, bool v_first,
                 LinkLoop& loop) const;
  void add_link(std::uint32_t v, std::uint32_t w, std::uint32_t corner, LinkLoop& loop) const;
  Doubt query_coarse(std::uint32_t u, const Star& star, std::size_t at);
  void remove(std::uint32_t u, const Star& star, std::size_t at);
  void commit(std::uint32_t u, const Star& star, std::size_t at, std::uint32_t cost_class_now);

  CollapseMesh& mesh_;
  MeshBlock& block_;
  const Double3 origin_;
  const DecimateOptions& options_;
  const bool plain_;   ///< costs are endpoint quadrics without attributes
  double area_ = 0.0;  ///< of all faces
  std::vector<Quadric> quadric_;
  std::vector<std::uint16_t> tried_;  ///< candidates below this class failed with the star as it is
  CostQueue<kCostClasses> queue_;
  std::uint32_t first_ = 0, end_ = 0;  ///< vertices that the queue takes
  std::vector<std::uint8_t> woken_;    ///< those before first_ whose star has changed since
  std::vector<NormalSum> normal_sum_;  ///< kNormalDeviation only
  // Of the candidate at hand.
  StarLanes lanes_;
  bool in_lanes_ = false;  ///< they hold the star that was gathered last
  LinkLoop loops_[2];
  std::size_t sides_ = 0, flat_edge_[2] = {kNoFlatEdge, kNoFlatEdge};
  Foot foot_;
  Star other_star_;
  Double3 target_{};
  bool moves_ = false;
  double min_cosine_ = -1.0;
  ReferenceDeviation reference_deviation_, coarse_deviation_;
  std::vector<std::uint32_t> reference_vertex_;
  /// Per vertex: the vertex of the reference, of the coarse one that last refused its removal.
  std::vector<std::uint32_t> witness_, coarse_witness_;
  std::uint64_t exact_tests_ = 0, exact_accepted_ = 0;
  float new_bound_ = 0.0f;  ///< of the candidate that check() just accepted
  CrossingGuard guard_;
  const bool guard_all_;
  bool trusted_ = false;
};

}  // namespace tessera
