#include "stream/stages/scan/orient_solution.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "kernels/points/patch_groups.h"
#include "kernels/points/top_surface.h"
#include "kernels/points/visibility.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

using json = nlohmann::json;

/// Patches join to groups while so many whole links speak for it, and three quarters of all that speak.
constexpr ContractionLimits kGroupLimits = {24.0 * kVoteScale, 0.8};
/// Votes of what surfels see, of one surfel, against those of its links.
constexpr double kVisibilityScale = kVoteScale;
/// And of what the highest surface tells.
constexpr double kSkyScale = 0.25 * kVoteScale;
/// And of given normals, where such a share of a group's agrees.
constexpr std::int64_t kGivenScale = 4 * kVoteScale;
constexpr double kClearMajority = 0.75;
/// `up` is taken to that part of its word: ceilings and the undersides of trees show downwards.
constexpr std::int64_t kAboveShare = 8;

struct Agreement {
  std::uint64_t agree = 0;
  std::uint64_t disagree = 0;
};

double share(std::uint64_t part, std::uint64_t all) {
  return all == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(all);
}

std::vector<JobSurfel> job_surfels(const PointOverlay& overlay, const std::vector<PatchStats>& stats,
                                   const TaskContext& context) {
  std::vector<JobSurfel> surfels;
  for (std::size_t b = 0; b < overlay.bricks().size(); ++b) {
    context.check_stop();
    const Int3 brick = brick_of_key(overlay.bricks()[b].key);
    for (const CoarseSurfel& c : overlay.load_coarse(b)) {
      JobSurfel s;
      for (std::size_t a = 0; a < 3; ++a)
        s.position[a] = static_cast<float>(brick[a] * kBrickCells) + c.position[a];
      s.area = c.area;
      s.patch = static_cast<std::uint32_t>(overlay.first_patch()[b] + c.patch);
      s.surfels = c.surfels;
      s.points = static_cast<float>(stats[s.patch].points) / static_cast<float>(stats[s.patch].surfels);
      surfels.push_back(s);
    }
  }
  return surfels;
}

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

enum class Decider : std::uint8_t { kSeen, kPropagation, kVisibility, kUncertain };

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
  out.frustrated = share(s.frustrated_votes, s.total_votes);
  return out;
}

/// Votes for sides and between groups of patches by how the scene was scanned, which the entry tells.
/// \param surfels  with the signs that they have inside their group
/// \param groups  torn where the scene tells that they are wrong
std::vector<PatchVote> votes_of_scene(std::vector<JobSurfel>& surfels,
                                      const std::vector<std::uint64_t>& weight, const Viewers& viewers,
                                      const TaskContext& context, PatchGroups& groups, json& entry) {
  {
    const TopSurface tops(surfels, viewers.up, groups.of);
    entry["covered_fraction"] = tops.covered_share();
    entry["roofed_fraction"] = tops.roofed_share();
    entry["level_fraction"] = tops.level_share();
    if (viewers.scene == "above" || (viewers.scene == "auto" && tops.seen_from_above())) {
      entry["scene"] = kSeenFromAbove;
      std::vector<PatchVote> sides = tops.votes(weight.size(), kSkyScale);
      tear_groups(sides, weight, kClearMajority, groups);
      for (PatchVote& v : sides) v.a = groups.of[v.a], v.b = groups.count();
      return sides;
    }
  }
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
  entry["scene"] = name_of(visibility.scene);
  std::vector<PatchVote> votes = std::move(visibility.pairs);
  votes.insert(votes.end(), visibility.sides.begin(), visibility.sides.end());
  return votes;
}

/// Votes of sensors or `up` that the patches brought along.
std::vector<PatchVote> votes_of(const std::vector<PatchStats>& stats) {
  std::vector<PatchVote> votes;
  const auto outside = static_cast<std::uint32_t>(stats.size());
  for (std::uint32_t p = 0; p < outside; ++p)
    if (stats[p].seen != stats[p].hidden) votes.push_back({p, outside, stats[p].seen, stats[p].hidden});
  return votes;
}

/// Votes of normals that came with the points, for groups of patches of which most agree on a side: they outweigh what is
/// told of the scene. \param group, sign  of patches
std::vector<PatchVote> votes_of_given(const std::vector<PatchStats>& stats,
                                      const std::vector<std::uint32_t>& group,
                                      const std::vector<std::int8_t>& sign, std::uint32_t groups) {
  std::vector<Agreement> of(groups);
  std::vector<std::int64_t> surfels(groups, 0);
  for (std::size_t p = 0; p < stats.size(); ++p) {
    Agreement& a = of[group[p]];
    a.agree += sign[p] > 0 ? stats[p].agree : stats[p].disagree;
    a.disagree += sign[p] > 0 ? stats[p].disagree : stats[p].agree;
    surfels[group[p]] += stats[p].surfels;
  }
  std::vector<PatchVote> votes;
  for (std::uint32_t g = 0; g < groups; ++g) {
    const std::uint64_t maximum = std::max(of[g].agree, of[g].disagree), all = of[g].agree + of[g].disagree;
    if (all == 0 || share(maximum, all) < kClearMajority) continue;
    const std::int64_t vote = kGivenScale * surfels[g];
    votes.push_back({g, groups, maximum == of[g].agree ? vote : 0, maximum == of[g].agree ? 0 : vote});
  }
  return votes;
}

/// Nobody is known to have seen anything: links make groups, and what their surfels see of each other and of the
/// open decides which side of them is outside. \param stats  of patches, with votes of `up`
PatchSigns solve_unseen(const std::vector<std::uint64_t>& weight, const std::vector<PatchVote>& links,
                        const std::vector<PatchStats>& stats, std::vector<JobSurfel> surfels,
                        const Viewers& viewers, const TaskContext& context, json& entry) {
  const auto patches = static_cast<std::uint32_t>(weight.size());
  PatchGroups grouped = group_patches(weight, links, kGroupLimits);
  context.check_stop();
  for (JobSurfel& s : surfels)
    for (float& a : s.area) a *= static_cast<float>(grouped.sign[s.patch]);
  std::vector<PatchVote> votes = votes_of_scene(surfels, weight, viewers, context, grouped, entry);
  const auto& [group, sign, size] = grouped;
  const std::uint32_t groups = grouped.count();
  // In a room as much shows down as up: there `up` says where the sky is, no more.
  if (entry.at("scene") != name_of(SceneKind::kRoom))
    for (const PatchVote& v : votes_of(stats)) {
      const std::int64_t same = v.same / kAboveShare, opposite = v.opposite / kAboveShare;
      votes.push_back({group[v.a], groups, sign[v.a] > 0 ? same : opposite, sign[v.a] > 0 ? opposite : same});
    }
  if (viewers.given) {
    const std::vector<PatchVote> given = votes_of_given(stats, group, sign, groups);
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
  out.frustrated = share(broken, all);
  return out;
}

}  // namespace

std::uint64_t orient_solution_bytes(std::uint64_t patches, std::uint64_t votes, std::uint64_t coarse) {
  ++patches;         // outside
  votes += patches;  // of sensors or up
  // Votes as given and inside the contraction, their adjacency; surfels, their disks as they are sorted; looks.
  return votes * (2 * sizeof(PatchVote) + 8) + patches * (sizeof(PatchStats) + 120) +
         coarse * (sizeof(JobSurfel) + 56) + (24u << 20);
}

void solve_orientation(const PointOverlay& overlay, std::vector<PatchVote> boundary_votes,
                       const Viewers& viewers, const TaskContext& context, OverlayDecisions& decisions,
                       json& entry) {
  const auto patches = static_cast<std::uint32_t>(overlay.first_patch().back());
  std::vector<PatchVote> votes = std::move(boundary_votes);
  std::vector<PatchStats> stats;
  stats.reserve(patches);
  std::vector<std::uint64_t> weight;
  weight.reserve(patches);
  std::uint64_t all_points = 0;
  for (std::size_t b = 0; b < overlay.bricks().size(); ++b) {
    context.check_stop();
    const auto first = static_cast<std::uint32_t>(overlay.first_patch()[b]);
    for (const PatchVote& v : overlay.load_votes(b))
      votes.push_back({first + v.a, first + v.b, v.same, v.opposite});
    for (const PatchStats& f : overlay.load_stats(b)) stats.push_back(f), weight.push_back(f.surfels);
    all_points += overlay.bricks()[b].points;
  }
  merge_votes(votes);
  context.check_stop();
  PatchSigns signs;
  if (viewers.own) {
    entry["scene"] = viewers.scene;
    signs = solve_seen(weight, votes_of(stats), std::move(votes));
  } else if (!viewers.sensors.empty()) {
    signs = solve_seen(
        weight, vote_by_sensors(job_surfels(overlay, stats, context), patches, viewers.sensors, kVoteScale),
        std::move(votes));
  } else {
    signs = solve_unseen(weight, votes, stats, job_surfels(overlay, stats, context), viewers, context, entry);
  }

  decisions.patch.assign(patches, 0);
  std::map<std::uint32_t, Agreement> by_component;
  Agreement all, near;
  std::array<std::uint64_t, 4> decided{};
  for (std::uint32_t p = 0; p < patches; ++p) {
    const PatchStats& f = stats[p];
    const bool flip = signs.sign[p] < 0;
    const bool uncertain = signs.decider[p] == Decider::kUncertain;
    decisions.patch[p] =
        static_cast<std::uint8_t>((flip ? kPatchFlip : 0) | (uncertain ? kPatchUncertain : 0));
    decided[static_cast<std::size_t>(signs.decider[p])] += f.points;
    Agreement& a = by_component[signs.component[p]];
    (flip ? a.disagree : a.agree) += f.agree;
    (flip ? a.agree : a.disagree) += f.disagree;
    (flip ? near.disagree : near.agree) += f.agree_near;
    (flip ? near.agree : near.disagree) += f.disagree_near;
  }
  Agreement up_to_sign;
  for (const auto& [component, a] : by_component) {
    all.agree += a.agree, all.disagree += a.disagree;
    up_to_sign.agree += std::max(a.agree, a.disagree), up_to_sign.disagree += std::min(a.agree, a.disagree);
  }
  entry["patches"] = patches;
  entry["components"] = by_component.size();
  entry["decided"] = {{"seen", decided[0]}, {"propagation", decided[1]}, {"sight", decided[2]}};
  entry["uncertain_points"] = decided[3];
  entry["uncertain_fraction"] = share(decided[3], all_points);
  entry["frustrated_fraction"] = signs.frustrated;
  if (all.agree + all.disagree > 0)
    entry["agreement"] = {
        {"agree", all.agree},
        {"disagree", all.disagree},
        {"fraction", share(all.agree, all.agree + all.disagree)},
        {"near_axis",
         {{"agree", near.agree},
          {"disagree", near.disagree},
          {"fraction", share(near.agree, near.agree + near.disagree)}}},
        {"fraction_up_to_component_sign", share(up_to_sign.agree, up_to_sign.agree + up_to_sign.disagree)}};
}

}  // namespace tessera
