#include "stream/stages/orient_solution.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "kernels/outside.h"

namespace tessera {
namespace {

using json = nlohmann::json;

/// Votes of looks from outside, against those of a surfel's links: they see only one side of open sheets
/// right.
constexpr double kLookScale = 0.25 * kVoteScale;

struct Agreement {
  std::uint64_t agree = 0;
  std::uint64_t disagree = 0;
};

double share(std::uint64_t part, std::uint64_t all) {
  return all == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(all);
}

std::vector<JobSurfel> job_surfels(const PointOverlay& overlay, const TaskContext& context) {
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
      surfels.push_back(s);
    }
  }
  return surfels;
}

/// Components that nothing told what is outside show upwards, the smallest patch deciding a tie.
void turn_up(std::span<const JobSurfel> surfels, std::uint32_t outside, SignSolution& solution) {
  std::map<std::uint32_t, double> up;
  for (const JobSurfel& s : surfels) {
    const std::uint32_t c = solution.component[s.patch];
    if (c != outside) up[c] += static_cast<double>(s.area[2]) * solution.sign[s.patch];
  }
  for (std::size_t p = 0; p < outside; ++p) {
    const auto it = up.find(solution.component[p]);
    if (it != up.end() && it->second < 0.0) solution.sign[p] = static_cast<std::int8_t>(-solution.sign[p]);
  }
}

}  // namespace

std::uint64_t orient_solution_bytes(const PointOverlay& overlay, std::uint64_t boundary_votes) {
  std::uint64_t inner = 0, coarse = 0;
  for (const OverlayBrick& b : overlay.bricks()) inner += b.votes, coarse += b.coarse;
  const std::uint64_t patches = overlay.first_patch().back() + 1;
  const std::uint64_t votes = boundary_votes + inner + patches;
  // Votes as given and inside the contraction, their adjacency; surfels, their looks and pixels.
  return votes * (2 * sizeof(PatchVote) + 8) + patches * (sizeof(PatchFacts) + 120) +
         coarse * (sizeof(JobSurfel) + 40) + (16u << 20);
}

void solve_orientation(const PointOverlay& overlay, std::vector<PatchVote> boundary_votes, bool seen_known,
                       const TaskContext& context, OverlayDecisions& decisions, json& entry) {
  const auto outside =
      static_cast<std::uint32_t>(overlay.first_patch().back());  // one more node: what is not us
  std::vector<PatchVote> votes = std::move(boundary_votes);
  std::vector<PatchFacts> facts;
  facts.reserve(outside);
  std::vector<std::uint64_t> weight;
  weight.reserve(outside + 1);
  std::uint64_t all_points = 0;
  for (std::size_t b = 0; b < overlay.bricks().size(); ++b) {
    context.check_stop();
    const auto first = static_cast<std::uint32_t>(overlay.first_patch()[b]);
    for (const PatchVote& v : overlay.load_votes(b))
      votes.push_back({first + v.a, first + v.b, v.same, v.opposite});
    for (const PatchFacts& f : overlay.load_facts(b)) facts.push_back(f), weight.push_back(f.surfels);
    all_points += overlay.bricks()[b].points;
  }
  const std::vector<JobSurfel> surfels = job_surfels(overlay, context);
  std::vector<SideVotes> looks;
  if (!seen_known) looks = look_from_outside(surfels, outside, kLookScale);
  for (std::uint32_t p = 0; p < outside; ++p) {
    PatchVote v{p, outside, facts[p].seen, facts[p].hidden};
    if (!seen_known) v.same = looks[p].seen, v.opposite = looks[p].hidden;
    if (v.same != v.opposite) votes.push_back(v);
  }
  weight.push_back(std::uint64_t{1} << 60);  // everything joins outside, never the other way round
  merge_votes(votes);
  context.check_stop();
  SignSolution solution = solve_signs(weight, votes);
  // Signs are relative to the root; outside is the root of its component, with sign +1, unless a flip took it
  // along.
  if (solution.sign[outside] < 0) throw std::logic_error("orient: outside was flipped");
  turn_up(surfels, outside, solution);

  decisions.patch.assign(outside, 0);
  std::map<std::uint32_t, Agreement> by_component;
  Agreement all;
  std::uint64_t seen_points = 0, propagated = 0, uncertain = 0;
  for (std::uint32_t p = 0; p < outside; ++p) {
    const PatchFacts& f = facts[p];
    const bool flip = solution.sign[p] < 0;
    const std::int64_t for_sign = flip ? f.hidden - f.seen : f.seen - f.hidden;
    const bool doubtful = solution.uncertain[p] != 0 || solution.component[p] != outside;
    decisions.patch[p] =
        static_cast<std::uint8_t>((flip ? kPatchFlip : 0) | (doubtful ? kPatchUncertain : 0));
    (doubtful ? uncertain : for_sign > 0 ? seen_points : propagated) += f.points;
    Agreement& a = by_component[solution.component[p]];
    (flip ? a.disagree : a.agree) += f.agree;
    (flip ? a.agree : a.disagree) += f.disagree;
  }
  Agreement up_to_sign;
  for (const auto& [component, a] : by_component) {
    all.agree += a.agree, all.disagree += a.disagree;
    up_to_sign.agree += std::max(a.agree, a.disagree), up_to_sign.disagree += std::min(a.agree, a.disagree);
  }
  entry["patches"] = outside;
  entry["components"] = by_component.size();
  entry["decided"] = {{"seen", seen_points}, {"propagation", propagated}};
  entry["uncertain_points"] = uncertain;
  entry["uncertain_fraction"] = share(uncertain, all_points);
  entry["frustrated_fraction"] = share(solution.frustrated_votes, solution.total_votes);
  if (all.agree + all.disagree > 0)
    entry["agreement"] = {
        {"agree", all.agree},
        {"disagree", all.disagree},
        {"fraction", share(all.agree, all.agree + all.disagree)},
        {"fraction_up_to_component_sign", share(up_to_sign.agree, up_to_sign.agree + up_to_sign.disagree)}};
}

}  // namespace tessera
