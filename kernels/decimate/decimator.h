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
#include <optional>
#include <vector>

#include "kernels/decimate/collapse_bound.h"
#include "kernels/decimate/collapse_costs.h"
#include "kernels/decimate/collapse_legality.h"
#include "kernels/decimate/collapse_mesh.h"
#include "kernels/decimate/colour_guard.h"
#include "kernels/decimate/cost_queue.h"
#include "kernels/decimate/crossing_guard.h"
#include "kernels/decimate/decimate.h"
#include "kernels/decimate/tolerance_check.h"

namespace tessera {

class Decimator {
 public:
  /// \param mesh       features are marked
  /// \param reference  same origin as mesh; used when options.tolerance > 0
  /// \param reference_vertex  per vertex of the mesh the same one in the reference, or kNoCorner
  /// \param block      takes the places and attributes of vertices that move (kOptimal)
  /// \param origin     of mesh
  /// \param guard_all  false: where a star is nearly flat, sweeps do not look for faces that would cross; then ask may_meet()
  Decimator(CollapseMesh& mesh, const CollapseMesh& reference, std::vector<std::uint32_t> reference_vertex,
            const DecimateOptions& options, MeshBlock& block, const Double3& origin, bool guard_all);

  void run(DecimateReport& report);
  /// Whether there may be more pairs of faces that meet than there were. \pre run()
  [[nodiscard]] bool may_meet();

 private:
  /// A collapse that is legal, or why it is not.
  struct Verdict {
    CollapseRefusal refusal = CollapseRefusal::kNone;
    float bound = 0.0f;  ///< CollapseFace::bound of the new faces
    bool moves = false;  ///< the vertex that stays goes to move_.to
    bool asked = true;   ///< whether faces would cross
  };
  /// Where both ends of an edge go in the verdict at hand.
  struct EdgeMove {
    Double3 to{};
    Star other;  ///< star of the vertex that stays
  };

  // The sweeps.
  bool sweeps() const;
  void sweep_all(DecimateReport& report);
  void sweep(double max_cost, std::vector<float>& minimum, DecimateReport& report);
  Verdict check_cheap(const CandidateStar& s, std::size_t at);
  bool trusts(const CandidateStar& s) const;
  void compact(std::vector<float>& minimum);

  // The queue.
  void seed_queue(bool woken);
  void empty_queue(DecimateReport& report);
  void try_candidates(const CandidateStar& s, CandidateList& list, std::uint32_t now, DecimateReport& report);
  void wake_around(std::uint32_t v, std::uint32_t now);
  void mark_done_faces(bool later);

  Verdict check(const CandidateStar& s, std::size_t at);
  Verdict check_star(const CandidateStar& s, std::size_t at);
  std::optional<float> bound_of_move(const CandidateStar& s, std::size_t at);
  bool adds_crossing(const Star& star, std::size_t at, bool moves);
  void remove(const CandidateStar& s, std::size_t at, const Verdict& verdict);
  void tell_guard(const Star& star, const Verdict& verdict);
  void move_vertex(std::uint32_t u, std::uint32_t v, float bound);

  CollapseMesh& mesh_;
  MeshBlock& block_;
  const Double3 origin_;
  const DecimateOptions& options_;
  CollapseCosts costs_;
  ToleranceCheck tolerance_;
  ColourGuard colours_;
  CrossingGuard guard_;
  const bool guard_all_;
  CostQueue<kCostClasses> queue_;
  std::vector<std::uint16_t> tried_;   ///< candidates below this class failed with the star as it is
  std::uint32_t first_ = 0, end_ = 0;  ///< vertices that the queue takes
  std::vector<std::uint8_t> woken_;    ///< those before first_ whose star has changed since
  LinkSides sides_;                    ///< scratch
  EdgeMove move_;
};

}  // namespace tessera
