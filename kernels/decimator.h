/// \file decimator.h
/// The greedy loop of decimate(): candidates by cost class, binary legality, collapse. See decimate.h.
#pragma once
#include <vector>

#include "kernels/collapse_gap.h"
#include "kernels/collapse_mesh.h"
#include "kernels/cost_queue.h"
#include "kernels/decimate.h"
#include "kernels/quadric.h"
#include "kernels/reference_gap.h"

namespace tessera {

class Decimator {
 public:
  /// \param mesh       features are marked
  /// \param reference  same origin as mesh; used when options.tolerance > 0
  /// \param reference_vertex  per vertex of the mesh the same one in the reference, or kNoCorner
  Decimator(CollapseMesh& mesh, const CollapseMesh& reference, std::vector<std::uint32_t> reference_vertex,
            const DecimateOptions& options);

  void run(DecimateReport& report);

 private:
  enum class Refusal : std::uint8_t { kNone, kFeature, kLink, kFold, kShape, kNormal, kTolerance };
  struct Candidate {
    double cost;
    std::uint32_t vertex;
    std::uint32_t at;  ///< place in the ring
  };

  void accumulate_quadrics();
  void seed_queue();
  std::size_t list_candidates(std::uint32_t u, const Star& star, std::array<Candidate, kMaxRing + 1>& list);
  void update_error(std::uint32_t v);
  double cost(std::uint32_t u, const Quadric& q, std::uint32_t v) const;
  bool allowed_by_features(std::uint32_t u, const Star& star, std::size_t at) const;
  Refusal check(std::uint32_t u, const Star& star, std::size_t at);
  bool linked(const Star& star, std::size_t at);
  Refusal check_faces(std::uint32_t u, const Star& star, std::size_t at) const;
  Refusal check_gap(std::uint32_t u, const Star& star, std::size_t at);
  void make_side(const Star& star, std::uint32_t v, std::size_t from, std::size_t to, bool v_first,
                 RimLoop& loop) const;
  void add_rim(std::uint32_t v, std::uint32_t w, std::uint32_t corner, RimLoop& loop) const;
  void commit(std::uint32_t u, const Star& star, std::size_t at, std::uint32_t cost_class_now);

  CollapseMesh& mesh_;
  const DecimateOptions& options_;
  std::vector<Quadric> quadric_;
  std::vector<std::uint16_t> tried_;  ///< candidates below this class failed with the star as it is
  std::vector<std::uint32_t> mark_;
  std::uint32_t stamp_ = 0;
  CostQueue<kCostClasses> queue_;
  RimLoop loops_[2];
  double least_cosine_ = -1.0;
  ReferenceGap reference_gap_;
  std::vector<std::uint32_t> reference_vertex_;
  std::uint64_t exact_tests_ = 0, exact_accepted_ = 0;
  float new_bound_ = 0.0f;  ///< of the candidate that check() just accepted
};

}  // namespace tessera
