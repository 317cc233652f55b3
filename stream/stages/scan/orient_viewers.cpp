#include "stream/stages/scan/orient_viewers.h"

#include <algorithm>

#include "stream/stages/scan/orient_tally.h"

namespace tessera {
namespace {

/// Weight of given normals of one surfel, where such a share of a group's agrees.
constexpr std::int64_t kGivenScale = 4 * kVoteScale;

struct GivenAgreement {
  std::uint64_t agree = 0;
  std::uint64_t disagree = 0;
};

}  // namespace

Viewers viewers_of(const NormalsMode& mode, const Plan& plan, const std::string& from) {
  Viewers v;
  v.own = mode.each_seen();
  v.scene = mode.completes ? kGivenSides : mode.airborne ? kAirborne : v.own ? "sensors" : from;
  v.given = mode.lines;
  for (std::size_t a = 0; a < 3; ++a) v.up[a] = static_cast<float>(mode.up[a]);
  if (!mode.by_sensor || v.own) return v;
  const double cell = plan.lattice.h;
  for (const Double3& sensor : plan.sensors) {
    Float3 at;
    for (std::size_t a = 0; a < 3; ++a)
      at[a] = static_cast<float>((sensor[a] - plan.lattice.world(static_cast<int>(a), 0.0)) / cell);
    v.sensors.push_back(at);
  }
  return v;
}

std::vector<PatchVote> votes_of(std::span<const PatchStats> stats) {
  std::vector<PatchVote> votes;
  const auto outside = static_cast<std::uint32_t>(stats.size());
  for (std::uint32_t p = 0; p < outside; ++p)
    if (stats[p].seen != stats[p].hidden) votes.push_back({p, outside, stats[p].seen, stats[p].hidden});
  return votes;
}

std::vector<PatchVote> votes_of_given(std::span<const PatchStats> stats, const PatchGroups& grouped) {
  const auto& [group, sign, size] = grouped;
  const std::uint32_t groups = grouped.count();
  std::vector<GivenAgreement> of(groups);
  std::vector<std::int64_t> surfels(groups, 0);
  for (std::size_t p = 0; p < stats.size(); ++p) {
    GivenAgreement& a = of[group[p]];
    a.agree += sign[p] > 0 ? stats[p].agree : stats[p].disagree;
    a.disagree += sign[p] > 0 ? stats[p].disagree : stats[p].agree;
    surfels[group[p]] += stats[p].surfels;
  }
  std::vector<PatchVote> votes;
  for (std::uint32_t g = 0; g < groups; ++g) {
    const std::uint64_t maximum = std::max(of[g].agree, of[g].disagree), all = of[g].agree + of[g].disagree;
    if (all == 0 || share_of(maximum, all) < kClearMajority) continue;
    const std::int64_t vote = kGivenScale * surfels[g];
    votes.push_back({g, groups, maximum == of[g].agree ? vote : 0, maximum == of[g].agree ? 0 : vote});
  }
  return votes;
}

}  // namespace tessera
