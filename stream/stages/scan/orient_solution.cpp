#include "stream/stages/scan/orient_solution.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <string>

#include "kernels/points/visibility.h"
#include "stream/files/json.h"
#include "stream/runtime/parallel.h"
#include "stream/stages/scan/orient_tally.h"

namespace tessera {
namespace {

/// Votes of what surfels see, of one surfel, against those of its links.
constexpr double kVisibilityScale = kVoteScale;

std::string name_of(SceneKind scene) {
  switch (scene) {
    case SceneKind::kObject:
      return "object";
    case SceneKind::kLand:
      return "land";
    case SceneKind::kRoom:
      return "room";
  }
  return "";
}

/// What the solvers say of every patch.
struct PatchSigns {
  std::vector<std::int8_t> sign;
  std::vector<Decider> decider;
  std::vector<std::uint32_t> component;  ///< patches that votes of points, sensors or up join
  double frustrated = 0.0;               ///< share of the votes that the signs break
};

/// Sensors or up have voted: links carry what they say to where they say little. \param seen  of patches, `b` is
/// their number
PatchSigns solve_seen(const std::vector<std::uint64_t>& weight, std::vector<PatchVote> seen,
                      std::vector<PatchVote> votes) {
  const auto outside = static_cast<std::uint32_t>(weight.size());  // one more node: where the viewer is
  std::vector<std::int64_t> shown(outside, 0);
  for (const PatchVote& v : seen) shown[v.a] = v.same - v.opposite;
  votes.insert(votes.end(), seen.begin(), seen.end());
  std::vector<std::uint64_t> weights = weight;
  weights.push_back(std::uint64_t{1} << 60);  // everything joins outside, never the other way round
  merge_votes(votes);
  SignSolution s = solve_signs(weights, votes);
  PatchSigns out;
  out.sign.assign(s.sign.begin(), s.sign.end() - 1);
  out.component.assign(s.component.begin(), s.component.end() - 1);
  for (std::uint32_t p = 0; p < outside; ++p)
    out.decider.push_back(s.uncertain[p] != 0 || s.component[p] != outside ? Decider::kUncertain
                          : shown[p] * s.sign[p] > 0                       ? Decider::kSeen
                                                                           : Decider::kPropagation);
  out.frustrated = share_of(s.frustrated_votes, s.total_votes);
  return out;
}

/// Votes for sides and between groups of patches by how the scene was scanned, which the entry tells.
/// \param surfels  with the signs that they have inside their group
std::vector<PatchVote> votes_of_scene(std::vector<JobSurfel>& surfels, const Viewers& viewers,
                                      const TaskContext& context, const PatchGroups& groups, Json& entry) {
  for (JobSurfel& s : surfels) s.patch = groups.of[s.patch];
  std::optional<SceneKind> known;
  if (viewers.scene == "around") known = SceneKind::kObject;
  if (viewers.scene == "inside") known = SceneKind::kRoom;
  VisibilityVotes visibility =
      vote_by_visibility(surfels, groups.count(), viewers.up, kVisibilityScale, known,
                         [&](std::size_t count, const std::function<void(std::size_t)>& body) {
                           parallel_for(count, [&](std::size_t i) {
                             context.check_stop();
                             body(i);
                           });
                         });
  entry["enclosed_fraction"] = visibility.enclosed;
  entry["shell_fraction"] = visibility.shells;
  entry["density_spread"] = visibility.density_spread;
  entry["scene"] = name_of(visibility.scene);
  std::vector<PatchVote> votes = std::move(visibility.pairs);
  votes.insert(votes.end(), visibility.sides.begin(), visibility.sides.end());
  return votes;
}

/// Nobody is known to have seen anything: links make groups, and what their surfels see of each other and of the
/// open decides which side of them is outside. \param stats  of patches, with votes of `up`
PatchSigns solve_unseen(const std::vector<std::uint64_t>& weight, const std::vector<PatchVote>& links,
                        const std::vector<PatchStats>& stats, std::vector<JobSurfel> surfels,
                        const Viewers& viewers, const TaskContext& context, Json& entry) {
  const auto patches = static_cast<std::uint32_t>(weight.size());
  const PatchGroups grouped = group_patches(weight, links, kGroupLimits);
  context.check_stop();
  for (JobSurfel& s : surfels)
    for (float& a : s.area) a *= static_cast<float>(grouped.sign[s.patch]);
  std::vector<PatchVote> votes = votes_of_scene(surfels, viewers, context, grouped, entry);
  const auto& [group, sign, size] = grouped;
  const std::uint32_t groups = grouped.count();
  // In a room as much shows down as up: there `up` says where the sky is, no more.
  if (entry.at("scene") != name_of(SceneKind::kRoom))
    for (const PatchVote& v : votes_of(stats)) {
      const std::int64_t same = v.same / kAboveShare, opposite = v.opposite / kAboveShare;
      votes.push_back({group[v.a], groups, sign[v.a] > 0 ? same : opposite, sign[v.a] > 0 ? opposite : same});
    }
  if (viewers.given) {
    const std::vector<PatchVote> given = votes_of_given(stats, grouped);
    votes.insert(votes.end(), given.begin(), given.end());
  }
  std::vector<std::int64_t> shown(groups, 0);
  for (const PatchVote& v : votes)
    if (v.b == groups) shown[v.a] += v.same - v.opposite;
  for (const PatchVote& v : links) {
    const std::uint32_t a = group[v.a], b = group[v.b];
    if (a == b) continue;
    const bool keep = sign[v.a] * sign[v.b] > 0;
    votes.push_back({std::min(a, b), std::max(a, b), keep ? v.same : v.opposite, keep ? v.opposite : v.same});
  }
  std::vector<std::uint64_t> weights = size;
  weights.push_back(std::uint64_t{1} << 60);
  merge_votes(votes);
  const SignSolution s = solve_signs(weights, votes);

  PatchSigns out;
  out.sign.resize(patches), out.decider.resize(patches), out.component.resize(patches);
  for (std::uint32_t p = 0; p < patches; ++p) {
    const std::uint32_t g = group[p];
    out.sign[p] = static_cast<std::int8_t>(sign[p] * s.sign[g]);
    out.component[p] = s.component[g];
    out.decider[p] = s.uncertain[g] != 0 || s.component[g] != groups ? Decider::kUncertain
                     : shown[g] * s.sign[g] > 0                      ? Decider::kVisibility
                                                                     : Decider::kPropagation;
  }
  std::uint64_t broken = 0, all = 0;
  for (const PatchVote& v : links) {
    broken += static_cast<std::uint64_t>(out.sign[v.a] == out.sign[v.b] ? v.opposite : v.same);
    all += static_cast<std::uint64_t>(v.same + v.opposite);
  }
  out.frustrated = share_of(broken, all);
  return out;
}

}  // namespace

std::uint64_t whole_orientation_bytes(std::uint64_t patches, std::uint64_t votes, std::uint64_t coarse) {
  ++patches;         // outside
  votes += patches;  // of sensors or up
  // Votes as given and inside the contraction, their adjacency; surfels, their disks as they are sorted; looks.
  return votes * (2 * sizeof(PatchVote) + 8) + patches * (sizeof(PatchStats) + 120) +
         coarse * (sizeof(JobSurfel) + 56) + (24u << 20);
}

void solve_whole_orientation(const PointOverlay& overlay, const PatchLinks& links, const Viewers& viewers,
                             const TaskContext& context, OverlayDecisions& decisions, Json& entry) {
  const auto patches = static_cast<std::uint32_t>(overlay.first_patch().back());
  std::vector<PatchVote> votes = links.outer();
  std::vector<PatchStats> stats;
  std::vector<JobSurfel> surfels;
  std::vector<std::uint64_t> weight;
  stats.reserve(patches), weight.reserve(patches);
  std::uint64_t all_points = 0;
  const std::vector<PatchBlock> blocks = list_patch_blocks(overlay);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    context.check_stop();
    const auto first = static_cast<std::uint32_t>(blocks[b].first_patch);
    for (const PatchVote& v : links.inner(b)) votes.push_back({first + v.a, first + v.b, v.same, v.opposite});
    const std::vector<PatchStats> of = load_stats(overlay, blocks[b]);
    for (JobSurfel& s : load_surfels(overlay, blocks[b], of)) {
      s.patch += first;
      surfels.push_back(s);
    }
    for (const PatchStats& f : of) stats.push_back(f), weight.push_back(f.surfels);
  }
  for (const OverlayBrick& b : overlay.bricks()) all_points += b.points;
  merge_votes(votes);
  context.check_stop();
  PatchSigns signs;
  if (!viewers.sensors.empty())
    signs =
        solve_seen(weight, vote_by_sensors(surfels, patches, viewers.sensors, kVoteScale), std::move(votes));
  else
    signs = solve_unseen(weight, votes, stats, std::move(surfels), viewers, context, entry);
  OrientationTally tally;
  for (std::uint32_t p = 0; p < patches; ++p)
    tally.add(stats[p], signs.sign[p], signs.decider[p], signs.component[p], decisions);
  tally.write(all_points, entry);
  entry["frustrated_fraction"] = signs.frustrated;
}

}  // namespace tessera
