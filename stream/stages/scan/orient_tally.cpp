#include "stream/stages/scan/orient_tally.h"

#include <algorithm>

#include "stream/files/json.h"

namespace tessera {

void OrientationTally::add(const PatchStats& stats, int sign, std::uint64_t component) {
  const bool flip = sign < 0;
  ++patches_;
  Agreement& a = by_component_[component];
  (flip ? a.disagree : a.agree) += stats.agree;
  (flip ? a.agree : a.disagree) += stats.disagree;
  (flip ? near_.disagree : near_.agree) += stats.agree_near;
  (flip ? near_.agree : near_.disagree) += stats.disagree_near;
}

void OrientationTally::decide(const PatchStats& stats, int sign, Decider decider,
                              OverlayDecisions& decisions) {
  const bool flip = sign < 0;
  const bool uncertain = decider == Decider::kUncertain;
  decisions.patch.push_back(
      static_cast<std::uint8_t>((flip ? kPatchFlip : 0) | (uncertain ? kPatchUncertain : 0)));
  if (uncertain) {
    (flip ? uncertain_.disagree : uncertain_.agree) += stats.agree;
    (flip ? uncertain_.agree : uncertain_.disagree) += stats.disagree;
  } else {
    decided_[static_cast<std::size_t>(decider)] += stats.points;
  }
}

void OrientationTally::add_doubt(std::span<const PointOverlayRecord> points,
                                 std::span<const std::uint8_t> decided, const OverlayDecisions& decisions) {
  for (const PointOverlayRecord& p : points) {
    if (p.patch >= decided.size() || (decided[p.patch] & kPatchUncertain) == 0) continue;
    if (!decisions.shows_side(p)) continue;  // no doubt about it is one about the mesh
    ++((p.supporters & kVolumetric) != 0 ? doubtful_strewn_ : doubtful_);
  }
}

void OrientationTally::write(std::uint64_t all_points, Json& entry) const {
  Agreement all, up_to_sign;
  for (const auto& [component, a] : by_component_) {
    all.agree += a.agree, all.disagree += a.disagree;
    up_to_sign.agree += std::max(a.agree, a.disagree), up_to_sign.disagree += std::min(a.agree, a.disagree);
  }
  entry["patches"] = patches_;
  entry["components"] = by_component_.size();
  entry["decided"] = {{"seen", decided_[0]}, {"propagation", decided_[1]}, {"sight", decided_[2]}};
  entry["uncertain_points"] = doubtful_;
  entry["uncertain_fraction"] = share_of(doubtful_, all_points);
  entry["uncertain_strewn_points"] = doubtful_strewn_;
  entry["uncertain_strewn_fraction"] = share_of(doubtful_strewn_, all_points);
  if (all.agree + all.disagree > 0)
    entry["agreement"] = {
        {"agree", all.agree},
        {"disagree", all.disagree},
        {"fraction", share_of(all.agree, all.agree + all.disagree)},
        {"near_axis",
         {{"agree", near_.agree},
          {"disagree", near_.disagree},
          {"fraction", share_of(near_.agree, near_.agree + near_.disagree)}}},
        {"uncertain",
         {{"agree", uncertain_.agree},
          {"disagree", uncertain_.disagree},
          {"fraction", share_of(uncertain_.agree, uncertain_.agree + uncertain_.disagree)}}},
        {"fraction_up_to_component_sign",
         share_of(up_to_sign.agree, up_to_sign.agree + up_to_sign.disagree)}};
}

}  // namespace tessera
