#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/files/json.h"
#include "stream/stages/scan/orient_solution.h"
#include "stream/stages/scan/orient_tally.h"

namespace tessera {
namespace {

constexpr std::uint64_t kOutsideWeight = std::uint64_t{1} << 60;  ///< everything joins outside

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

/// Where the anchors of every block stand among those of all, and their votes.
struct AnchorGraph {
  std::vector<std::uint32_t> first;   ///< per block
  std::vector<std::uint64_t> weight;  ///< and at the end that of outside
  std::vector<PatchVote> links, sides;

  std::uint32_t outside() const { return static_cast<std::uint32_t>(weight.size() - 1); }
  std::uint32_t node(std::size_t block, std::uint32_t anchor) const {
    return anchor == PatchAnchor::kOutside ? outside() : first[block] + anchor;
  }
};

AnchorGraph load_graph(const PatchAnchors& anchors) {
  AnchorGraph graph;
  const std::size_t blocks = anchors.entries().size();
  for (std::size_t b = 0; b < blocks; ++b) {
    graph.first.push_back(static_cast<std::uint32_t>(graph.weight.size()));
    const auto of = anchors.load<std::uint64_t>(b, &AnchorsEntry::weight);
    graph.weight.insert(graph.weight.end(), of.begin(), of.end());
  }
  graph.weight.push_back(kOutsideWeight);
  for (std::size_t b = 0; b < blocks; ++b)
    for (const auto& [section, votes] :
         {std::pair{&AnchorsEntry::links, &graph.links}, std::pair{&AnchorsEntry::sides, &graph.sides}})
      for (const PatchVote& v : anchors.load<PatchVote>(b, section))
        votes->push_back({graph.node(b, v.a), graph.node(b, v.b), v.same, v.opposite});
  return graph;
}

/// Adds the links that join blocks, and what sees each other across blocks. \pre their patches are anchors
void add_outer_links(const std::vector<PatchBlock>& blocks, const PatchLinks& links,
                     const OrientationScene& scene, const PatchAnchors& anchors, const SightVotes* sight,
                     const TaskContext& context, AnchorGraph& graph) {
  std::vector<std::uint32_t> node(scene.border.size());
  std::vector<std::int8_t> sign(scene.border.size());
  std::size_t i = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    context.check_stop();
    if (i == scene.border.size() || scene.border[i] >= blocks[b].first_patch + blocks[b].patches) continue;
    const auto patches = anchors.load<PatchAnchor>(b, &AnchorsEntry::patches);
    for (; i < scene.border.size() && scene.border[i] < blocks[b].first_patch + blocks[b].patches; ++i) {
      const PatchAnchor& a = patches[scene.border[i] - blocks[b].first_patch];
      node[i] = graph.first[b] + a.anchor, sign[i] = a.sign;
    }
  }
  const auto border_index = [&](std::uint32_t patch) {
    return static_cast<std::size_t>(std::lower_bound(scene.border.begin(), scene.border.end(), patch) -
                                    scene.border.begin());
  };
  const auto add = [&](const std::vector<PatchVote>& votes, std::vector<PatchVote>& to) {
    for (const PatchVote& v : votes) {
      const std::size_t p = border_index(v.a), q = border_index(v.b);
      if (node[p] == node[q]) continue;
      const bool keep = sign[p] * sign[q] > 0;
      to.push_back({std::min(node[p], node[q]), std::max(node[p], node[q]), keep ? v.same : v.opposite,
                    keep ? v.opposite : v.same});
    }
  };
  for (std::size_t b = 0; b < blocks.size(); ++b) add(links.outer(b), graph.links);
  merge_votes(graph.links);
  if (sight != nullptr) add(sight->outer(), graph.sides);
}

SignSolution solve_graph(const AnchorGraph& graph) {
  std::vector<PatchVote> votes;
  votes.reserve(graph.links.size() + graph.sides.size());
  votes = graph.links;
  votes.insert(votes.end(), graph.sides.begin(), graph.sides.end());
  merge_votes(votes);
  return solve_signs(graph.weight, votes);
}

/// Share of the links of all patches that the signs break.
double frustrated(const AnchorGraph& graph, const SignSolution& solution, const PatchAnchors& anchors) {
  std::uint64_t broken = 0, all = 0;
  for (const AnchorsEntry& e : anchors.entries()) broken += e.broken_votes, all += e.inner_votes;
  for (const PatchVote& v : graph.links) {
    broken += static_cast<std::uint64_t>(solution.sign[v.a] == solution.sign[v.b] ? v.opposite : v.same);
    all += static_cast<std::uint64_t>(v.same + v.opposite);
  }
  return share_of(broken, all);
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
  AnchorGraph graph = load_graph(anchors);
  add_outer_links(blocks, links, scene, anchors, sight, context, graph);
  const SignSolution solution = solve_graph(graph);
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
      const bool loose = a.anchor >= PatchAnchor::kLoose && a.anchor != PatchAnchor::kOutside;
      const std::uint32_t node = loose ? graph.outside() : graph.node(b, a.anchor);
      const int sign = loose ? a.sign : a.sign * solution.sign[node];
      const std::uint64_t component =
          loose ? (std::uint64_t{1} << 32) + blocks[b].first_patch + (a.anchor - PatchAnchor::kLoose)
                : solution.component[node];
      const bool uncertain =
          loose || a.uncertain != 0 || solution.uncertain[node] != 0 || component != graph.outside();
      tally.add(stats[p], sign,
                uncertain            ? Decider::kUncertain
                : a.shown * sign > 0 ? sides
                                     : Decider::kPropagation,
                component, decisions);
    }
  }
  tally.write(points, entry);
  entry["frustrated_fraction"] = frustrated(graph, solution, anchors);
  entry["anchors"] = graph.outside();
}

std::uint64_t block_orientation_bytes(std::uint64_t patches, std::uint64_t largest, std::uint64_t border,
                                      std::uint64_t votes) {
  return patches + border * (4 + 5 + 120) + votes * (3 * sizeof(PatchVote) + 8) +
         largest * (sizeof(PatchStats) + sizeof(PatchAnchor)) + (8u << 20);
}

}  // namespace tessera
