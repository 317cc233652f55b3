#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/files/json.h"
#include "stream/stages/scan/orient_anchors.h"
#include "stream/stages/scan/orient_solution.h"
#include "stream/stages/scan/orient_tally.h"

namespace tessera {
namespace {

constexpr std::uint64_t kRecordsAtOnce = 1u << 16;

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

/// Every patch of the job.
struct SolvedPatches {
  std::vector<std::int8_t> sign;
  std::vector<std::uint8_t> shown;     ///< its group's sides speak for its sign
  std::vector<std::uint8_t> doubtful;  ///< votes are split, or nothing tells
};

/// Bytes a patch of it, of what was in doubt before, of what groups see, and of decisions.
constexpr std::uint64_t kSolvedBytes = 3 + 1 + sizeof(float) + 1 + 1;

/// \returns share of the links that the signs break
double solve_anchors(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks,
                     const PatchLinks& links, const OrientationScene& scene, const PatchAnchors& anchors,
                     const SightVotes* sight, const TaskContext& context, SolvedPatches& out,
                     OrientationTally& tally) {
  const AnchorSigns signs(overlay, blocks, links, scene, anchors, sight, context);
  const std::size_t patches = overlay.first_patch().back();
  out.sign.reserve(patches), out.shown.reserve(patches), out.doubtful.reserve(patches);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    context.check_stop();
    const std::vector<PatchStats> stats = load_stats(overlay, blocks[b]);
    const auto hung = anchors.load<PatchAnchor>(b, &AnchorsEntry::patches);
    for (std::size_t p = 0; p < hung.size(); ++p) {
      const PatchAnchor& a = hung[p];
      const AnchorSigns::Known known = signs.of(b, a);
      const int sign = a.sign * known.sign;
      tally.add(stats[p], sign, known.component);
      out.sign.push_back(static_cast<std::int8_t>(sign));
      out.shown.push_back(a.shown * sign > 0 ? 1 : 0);
      out.doubtful.push_back(a.uncertain != 0 || known.uncertain || known.component != 0 ? 1 : 0);
    }
  }
  return signs.frustrated();
}

/// Groups in doubt look, all of them, and are settled block by block.
void settle_block_doubt(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks,
                        const PatchLinks& links, const SightVotes& sight, const Viewers& viewers,
                        std::uint64_t memory, const TaskContext& context, SolvedPatches& solved) {
  std::vector<float> leans =
      look_again(overlay, blocks, links, viewers, sight, solved.doubtful, memory, context);
  for (std::size_t p = 0; p < leans.size(); ++p) leans[p] *= static_cast<float>(solved.sign[p]);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    context.check_stop();
    const std::size_t first = blocks[b].first_patch, patches = blocks[b].patches;
    settle_doubt(links.groups(b, std::vector<std::uint64_t>(patches, 0)), links.inner(b),
                 std::span(solved.sign).subspan(first, patches), std::span(leans).subspan(first, patches),
                 std::span(solved.doubtful).subspan(first, patches));
  }
}

/// The points of one brick that are in doubt.
void count_doubt(const PointOverlay& overlay, std::size_t brick, const TaskContext& context,
                 const OverlayDecisions& decisions, OrientationTally& tally) {
  const std::uint64_t first = overlay.first_patch()[brick], last = overlay.first_patch()[brick + 1];
  const std::span<const std::uint8_t> decided = std::span(decisions.patch).subspan(first, last - first);
  if (std::none_of(decided.begin(), decided.end(), [](std::uint8_t d) { return (d & kPatchUncertain) != 0; }))
    return;
  const std::uint64_t points = overlay.bricks()[brick].points;
  for (std::uint64_t at = 0; at < points; at += kRecordsAtOnce) {
    context.check_stop();
    tally.add_doubt(overlay.load_records(brick, at, std::min(kRecordsAtOnce, points - at)), decided,
                    decisions);
  }
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
                             const SightVotes* sight, const Viewers& viewers, std::uint64_t memory,
                             const TaskContext& context, OverlayDecisions& decisions, Json& entry) {
  const std::vector<PatchBlock> blocks = list_patch_blocks(overlay);
  SolvedPatches solved;
  OrientationTally tally;
  entry["frustrated_fraction"] =
      solve_anchors(overlay, blocks, links, scene, anchors, sight, context, solved, tally);
  const std::vector<std::uint8_t> before = solved.doubtful;
  // Of objects looks say too little of what links leave open, thin parts and noise: of a drill's 40 % were wrong.
  if (sight != nullptr && sight->is_room())
    settle_block_doubt(overlay, blocks, links, *sight, viewers, memory, context, solved);
  const Decider sides = viewers.unknown() ? Decider::kVisibility : Decider::kSeen;
  decisions.patch.reserve(overlay.first_patch().back());
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    context.check_stop();
    const std::vector<PatchStats> stats = load_stats(overlay, blocks[b]);
    for (std::size_t p = 0; p < stats.size(); ++p) {
      const std::size_t at = blocks[b].first_patch + p;
      const bool by_sides = solved.shown[at] != 0 || before[at] != solved.doubtful[at];
      tally.decide(stats[p], solved.sign[at],
                   solved.doubtful[at] != 0 ? Decider::kUncertain
                   : by_sides               ? sides
                                            : Decider::kPropagation,
                   decisions);
    }
  }
  std::uint64_t points = 0;
  for (std::size_t b = 0; b < overlay.bricks().size(); ++b) {
    points += overlay.bricks()[b].points;
    count_doubt(overlay, b, context, decisions, tally);
  }
  tally.write(points, entry);
  entry["anchors"] = anchors.anchor_count();
}

std::uint64_t block_orientation_bytes(std::uint64_t patches, std::uint64_t largest, std::uint64_t border,
                                      std::uint64_t votes) {
  return patches * kSolvedBytes + AnchorSigns::bytes(border, votes) +
         largest * (sizeof(PatchStats) + sizeof(PatchAnchor)) + (8u << 20);
}

std::uint64_t settle_doubt_bytes(std::uint64_t patches, std::uint64_t largest, std::uint64_t coarse,
                                 std::uint64_t surfels, std::uint64_t bricks, std::uint64_t memory) {
  return patches * (kSolvedBytes + sizeof(GroupView)) +
         look_again_bytes(coarse, surfels, largest, bricks, memory) + (4u << 20);
}

}  // namespace tessera
