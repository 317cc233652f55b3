#include "stream/stages/scan/orient_tally.h"

#include <algorithm>

#include "stream/files/json.h"

namespace tessera {

void OrientationTally::add(const PatchStats& stats, int sign, Decider decider, std::uint64_t component,
                           OverlayDecisions& decisions) {
  const bool flip = sign < 0;
  const bool uncertain = decider == Decider::kUncertain;
  decisions.patch.push_back(
      static_cast<std::uint8_t>((flip ? kPatchFlip : 0) | (uncertain ? kPatchUncertain : 0)));
  ++patches_;
  // What is taken out shows no side: no doubt about it is one about the mesh.
  const bool gone =
      decisions.volumetric == VolumetricUse::kDrop || decisions.volumetric == VolumetricUse::kTop;
  decided_[static_cast<std::size_t>(decider)] +=
      stats.points - (uncertain && gone ? std::min(stats.volumetric, stats.points) : 0);
  Agreement& a = by_component_[component];
  (flip ? a.disagree : a.agree) += stats.agree;
  (flip ? a.agree : a.disagree) += stats.disagree;
  (flip ? near_.disagree : near_.agree) += stats.agree_near;
  (flip ? near_.agree : near_.disagree) += stats.disagree_near;
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
  entry["uncertain_points"] = decided_[3];
  entry["uncertain_fraction"] = share_of(decided_[3], all_points);
  if (all.agree + all.disagree > 0)
    entry["agreement"] = {{"agree", all.agree},
                          {"disagree", all.disagree},
                          {"fraction", share_of(all.agree, all.agree + all.disagree)},
                          {"near_axis",
                           {{"agree", near_.agree},
                            {"disagree", near_.disagree},
                            {"fraction", share_of(near_.agree, near_.agree + near_.disagree)}}},
                          {"fraction_up_to_component_sign",
                           share_of(up_to_sign.agree, up_to_sign.agree + up_to_sign.disagree)}};
}

}  // namespace tessera
