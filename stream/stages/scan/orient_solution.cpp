#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/files/json.h"
#include "stream/stages/scan/orient_anchors.h"
#include "stream/stages/scan/orient_solution.h"
#include "stream/stages/scan/orient_tally.h"

namespace tessera {
namespace {

/// Groups, and what is known of their sides, of a block seen from above.
void see_from_above(std::vector<JobSurfel> surfels, const std::vector<PatchStats>& stats,
                    const std::vector<std::uint64_t>& weight, const TopColumns& tops, const Viewers& viewers,
                    SignBlock& out) {
  for (JobSurfel& s : surfels)
    for (float& a : s.area) a *= static_cast<float>(out.groups.sign[s.patch]);
  std::vector<PatchVote> sides = vote_by_top(surfels, tops, weight.size(), kSkyScale);
  tear_groups(sides, weight, kClearMajority, out.groups);
  const auto& [group, sign, size] = out.groups;
  for (PatchVote& v : sides) v.a = group[v.a];
  for (const PatchVote& v : votes_of(stats)) {
    const std::int64_t same = v.same / kAboveShare, opposite = v.opposite / kAboveShare;
    sides.push_back({group[v.a], 0, sign[v.a] > 0 ? same : opposite, sign[v.a] > 0 ? opposite : same});
  }
  if (viewers.given) {
    const std::vector<PatchVote> given = votes_of_given(stats, out.groups);
    sides.insert(sides.end(), given.begin(), given.end());
  }
  out.sides = std::move(sides);
}

/// Sides of groups, and groups that see each other, of a block of a scan that is told by what its surfels see.
void see_around(const SightVotes& sight, std::size_t index, const std::vector<PatchStats>& stats,
                const Viewers& viewers, SignBlock& out) {
  const auto& [group, sign, size] = out.groups;
  out.sides = sight.sides(index);
  out.pairs = sight.pairs(index);
  // In a room as much shows down as up: there `up` says where the sky is, no more.
  if (!sight.is_room())
    for (const PatchVote& v : votes_of(stats)) {
      const std::int64_t same = v.same / kAboveShare, opposite = v.opposite / kAboveShare;
      out.sides.push_back({group[v.a], 0, sign[v.a] > 0 ? same : opposite, sign[v.a] > 0 ? opposite : same});
    }
  if (!viewers.given) return;
  const std::vector<PatchVote> given = votes_of_given(stats, out.groups);
  out.sides.insert(out.sides.end(), given.begin(), given.end());
}

/// Every patch by itself.
PatchGroups single_patches(std::vector<std::uint64_t> weight) {
  PatchGroups groups;
  for (std::uint32_t p = 0; p < weight.size(); ++p) groups.of.push_back(p), groups.sign.push_back(1);
  groups.size = std::move(weight);
  return groups;
}

}  // namespace

BlockSigns solve_block(const PointOverlay& overlay, const PatchLinks& links, std::size_t index,
                       const PatchBlock& block, const OrientationScene& scene, const TopColumns& tops,
                       const SightVotes* sight, const Viewers& viewers) {
  const std::vector<PatchStats> stats = load_stats(overlay, block);
  std::vector<std::uint64_t> weight;
  weight.reserve(stats.size());
  for (const PatchStats& s : stats) weight.push_back(s.surfels);
  SignBlock in;
  in.links = links.inner(index);
  in.border = scene.border_of(block);
  if (!viewers.sensors.empty() && sight != nullptr) {
    in.groups = single_patches(std::move(weight));
    in.sides = sight->sides(index);
    return solve_block_signs(in);
  }
  in.groups = links.groups(index, weight);
  if (viewers.own)
    in.sides = votes_of(stats);
  else if (sight != nullptr)
    see_around(*sight, index, stats, viewers, in);
  else
    see_from_above(load_surfels(overlay, block, stats), stats, weight, tops, viewers, in);
  return solve_block_signs(in);
}

std::uint64_t solve_block_bytes(std::uint64_t patches, std::uint64_t votes, std::uint64_t coarse) {
  votes += 2 * patches;  // of sides
  return votes * (4 * sizeof(PatchVote) + 8) + patches * (sizeof(PatchStats) + 200) +
         coarse * 2 * sizeof(JobSurfel) + (4u << 20);
}

void solve_block_orientation(const PointOverlay& overlay, const PatchLinks& links,
                             const OrientationScene& scene, const PatchAnchors& anchors,
                             const SightVotes* sight, const Viewers& viewers, const TaskContext& context,
                             OverlayDecisions& decisions, Json& entry) {
  const std::vector<PatchBlock> blocks = list_patch_blocks(overlay);
  const AnchorSigns signs(overlay, blocks, links, scene, anchors, sight, context);
  const Decider sides = viewers.unknown() ? Decider::kVisibility : Decider::kSeen;
  OrientationTally tally;
  decisions.patch.reserve(overlay.first_patch().back());
  std::uint64_t points = 0;
  for (const OverlayBrick& b : overlay.bricks()) points += b.points;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    context.check_stop();
    const std::vector<PatchStats> stats = load_stats(overlay, blocks[b]);
    const auto patches = anchors.load<PatchAnchor>(b, &AnchorsEntry::patches);
    for (std::size_t p = 0; p < patches.size(); ++p) {
      const PatchAnchor& a = patches[p];
      const AnchorSigns::Known known = signs.of(b, a);
      const int sign = a.sign * known.sign;
      const bool uncertain = a.uncertain != 0 || known.uncertain || known.component != 0;
      tally.add(stats[p], sign,
                uncertain            ? Decider::kUncertain
                : a.shown * sign > 0 ? sides
                                     : Decider::kPropagation,
                known.component, decisions);
    }
  }
  tally.write(points, entry);
  entry["frustrated_fraction"] = signs.frustrated();
  entry["anchors"] = anchors.anchor_count();
}

std::uint64_t block_orientation_bytes(std::uint64_t patches, std::uint64_t largest, std::uint64_t border,
                                      std::uint64_t votes) {
  return patches + AnchorSigns::bytes(border, votes) + largest * (sizeof(PatchStats) + sizeof(PatchAnchor)) +
         (8u << 20);
}

}  // namespace tessera
