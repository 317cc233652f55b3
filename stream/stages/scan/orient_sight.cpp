#include "stream/stages/scan/orient_sight.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "stream/runtime/parallel.h"
#include "stream/stages/scan/orient_groups.h"

namespace tessera {
namespace {

constexpr PackedKind kSightKind = {"TSSIGHT3", "a file of what surfels see"};
/// Votes of what surfels see, of one surfel, against those of its links.
constexpr double kVisibilityScale = kVoteScale;
/// Of the job's memory: disks of surfels, as many bytes again while they are made, and rays. What else is held takes 75 MiB in large
/// scans, and no stage that every scan has needs much more: with these shares this one fits wherever those do.
constexpr std::uint64_t kDisksShare = 16, kRaysShare = 20;
constexpr std::uint64_t kRayBytes = 64 * (sizeof(SightRay) + 4);  ///< of one looker
constexpr std::uint64_t kMinLookers = 256, kMaxLookers = 1u << 16;

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

SightRun sight_sizes(std::uint64_t coarse, std::uint64_t memory) {
  SightRun run;
  run.bytes = std::min(memory / kDisksShare, SurfelDisks::bytes(coarse));
  run.lookers = std::clamp(memory / kRaysShare / kRayBytes, kMinLookers, kMaxLookers);
  return run;
}

SightRun sight_run(std::uint64_t coarse, std::uint64_t memory, const TaskContext& context) {
  SightRun run = sight_sizes(coarse, memory);
  run.for_each = [&context](std::size_t count, const std::function<void(std::size_t)>& body) {
    parallel_for(count, [&](std::size_t i) {
      context.check_stop();
      body(i);
    });
  };
  return run;
}

/// Of a group: a patch that speaks for it, and its sign there.
struct Speaker {
  std::uint32_t patch = 0;
  std::int8_t sign = 1;
};

/// The groups of all pairs that join blocks, as patches.
class Speakers {
 public:
  Speakers(const std::vector<PatchBlock>& blocks, const PatchLinks& links) : blocks_(blocks), links_(links) {}
  /// \pre ascending
  void find(const std::vector<std::uint32_t>& groups) {
    for (std::size_t i = 0, b = 0; i < groups.size();) {
      while (!has(b, groups[i])) ++b;
      const PatchGroups of = links_.groups(b, std::vector<std::uint64_t>(blocks_[b].patches, 0));
      const auto first = static_cast<std::uint32_t>(blocks_[b].first_patch);
      std::vector<std::uint32_t> speaker(of.count(), 0);
      for (std::uint32_t p = blocks_[b].patches; p-- > 0;) speaker[of.of[p]] = p;
      for (; i < groups.size() && has(b, groups[i]); ++i) {
        const std::uint32_t p = speaker[groups[i] - first];
        of_[groups[i]] = {first + p, of.sign[p]};
      }
    }
  }
  PatchVote as_patches(const PatchVote& v) const {
    const Speaker &a = of_.at(v.a), &b = of_.at(v.b);
    const bool keep = a.sign * b.sign > 0;
    return {std::min(a.patch, b.patch), std::max(a.patch, b.patch), keep ? v.same : v.opposite,
            keep ? v.opposite : v.same};
  }
  /// Whether a block has a group of the job.
  bool has(std::size_t b, std::uint32_t group) const {
    return group - static_cast<std::uint32_t>(blocks_[b].first_patch) < blocks_[b].patches;
  }

 private:
  const std::vector<PatchBlock>& blocks_;
  const PatchLinks& links_;
  std::map<std::uint32_t, Speaker> of_;
};

std::vector<PatchVote> numbered_inside(std::vector<PatchVote> votes, const PatchBlock& block, bool pairs) {
  const auto first = static_cast<std::uint32_t>(block.first_patch);
  for (PatchVote& v : votes) v.a -= first, v.b = pairs ? v.b - first : 0;
  return votes;
}

/// Votes of a list sorted by `a` that begin in a block; takes them out of what is left.
std::vector<PatchVote> take_of(const PatchBlock& block, std::span<const PatchVote>& votes) {
  const auto end = std::find_if(votes.begin(), votes.end(),
                                [&](const PatchVote& v) { return v.a >= block.first_patch + block.patches; });
  std::vector<PatchVote> of(votes.begin(), end);
  votes = votes.subspan(of.size());
  return of;
}

}  // namespace

SightVotes::SightVotes(const std::filesystem::path& path)
    : file_(path, kSightKind, sizeof(Entry), sizeof(Facts)), table_(file_.table<Entry>()) {
  std::memcpy(&facts_, file_.info().data(), sizeof facts_);
}

std::vector<PatchVote> SightVotes::sides(std::size_t block) const {
  return file_.load<PatchVote>(table_.at(block).sides);
}

std::vector<PatchVote> SightVotes::pairs(std::size_t block) const {
  return file_.load<PatchVote>(table_.at(block).pairs);
}

std::vector<PatchVote> SightVotes::outer() const {
  return file_.load<PatchVote>(table_.back().pairs);
}

void SightVotes::tell(Json& entry) const {
  if (facts_.by_sensors != 0) return;
  entry["enclosed_fraction"] = facts_.enclosed;
  entry["shell_fraction"] = facts_.shells;
  entry["density_spread"] = facts_.density_spread;
  entry["facing_fraction"] = facts_.facing;
  entry["scene"] = name_of(facts_.scene);
}

void look_around(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks, const PatchLinks& links,
                 const Viewers& viewers, std::uint64_t memory, const TaskContext& context,
                 const std::filesystem::path& path) {
  const bool sensors = !viewers.sensors.empty();
  SurfelParts parts;
  std::uint64_t coarse = 0;
  for (const PatchBlock& b : blocks) {
    parts.parts.push_back({b.coarse, static_cast<std::uint32_t>(b.first_patch)});
    coarse += b.coarse;
  }
  std::optional<JobGroups> joined;
  if (!sensors) {
    joined.emplace(overlay, blocks, links, context);
    parts.first_shared = joined->first_shared(), parts.shared = joined->count();
  }
  parts.load = [&](std::size_t b) {
    context.check_stop();
    const auto first = static_cast<std::uint32_t>(blocks[b].first_patch);
    const std::vector<PatchStats> stats = load_stats(overlay, blocks[b]);
    std::vector<JobSurfel> surfels = load_surfels(overlay, blocks[b], stats);
    if (sensors) {
      for (JobSurfel& s : surfels) s.patch += first;
      return surfels;
    }
    const PatchGroups groups = links.groups(b, std::vector<std::uint64_t>(blocks[b].patches, 0));
    std::vector<const SharedGroup*> shared(groups.count());
    for (std::uint32_t g = 0; g < shared.size(); ++g) shared[g] = joined->find(first + g);
    for (JobSurfel& s : surfels) {
      const std::uint32_t group = groups.of[s.patch];
      const int sign = groups.sign[s.patch] * (shared[group] != nullptr ? shared[group]->sign : 1);
      for (float& a : s.area) a *= static_cast<float>(sign);
      s.patch = shared[group] != nullptr ? shared[group]->shared : first + group;
    }
    return surfels;
  };
  const SightRun run = sight_run(coarse, memory, context);
  PackedWriter file(path, kSightKind);
  std::vector<SightVotes::Entry> table;
  SightVotes::Facts facts;
  const auto add = [&](const std::vector<PatchVote>& sides, const std::vector<PatchVote>& pairs) {
    const Section s = file.append(bytes_of(sides));
    table.push_back({s, file.append(bytes_of(pairs))});
  };
  std::vector<PatchVote> outer;
  if (sensors) {
    facts.by_sensors = 1;
    vote_by_sensors(parts, viewers.sensors, kVisibilityScale, run,
                    [&](std::size_t b, std::vector<PatchVote> sides) {
                      add(numbered_inside(std::move(sides), blocks[b], false), {});
                    });
  } else {
    std::optional<SceneKind> known;
    if (viewers.scene == "around") known = SceneKind::kObject;
    if (viewers.scene == "inside") known = SceneKind::kRoom;
    VisibilityVotes seen = vote_by_visibility(parts, viewers.up, kVisibilityScale, known, run);
    joined->share_out(seen);
    facts.enclosed = seen.enclosed, facts.shells = seen.shells;
    facts.density_spread = seen.density_spread, facts.facing = seen.facing, facts.sight = seen.sight,
    facts.scene = seen.scene;
    std::span<const PatchVote> sides = seen.sides, pairs = seen.pairs;
    std::vector<std::uint32_t> groups;
    for (const PatchBlock& block : blocks) {
      std::vector<PatchVote> inner = take_of(block, pairs);
      std::erase_if(inner, [&](const PatchVote& v) {
        if (v.b < block.first_patch + block.patches) return false;
        outer.push_back(v), groups.push_back(v.a), groups.push_back(v.b);
        return true;
      });
      add(numbered_inside(take_of(block, sides), block, false),
          numbered_inside(std::move(inner), block, true));
    }
    std::sort(groups.begin(), groups.end());
    groups.erase(std::unique(groups.begin(), groups.end()), groups.end());
    seen = {}, joined.reset();
    Speakers speakers(blocks, links);
    speakers.find(groups);
    for (PatchVote& v : outer) v = speakers.as_patches(v);
    merge_votes(outer);
  }
  add({}, outer);
  const std::array<SightVotes::Facts, 1> info = {facts};
  file.finish(table, std::as_bytes(std::span(info)));
}

std::vector<float> look_again(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks,
                              const PatchLinks& links, const Viewers& viewers, const SightVotes& sight,
                              const std::vector<std::uint8_t>& asked, std::uint64_t memory,
                              const TaskContext& context) {
  std::vector<float> leans(asked.size(), 0.0f);
  SurfelParts parts;
  std::uint64_t coarse = 0;
  for (const PatchBlock& b : blocks) {
    parts.parts.push_back({b.coarse, static_cast<std::uint32_t>(b.first_patch)});
    coarse += b.coarse;
  }
  const auto groups_of = [&](std::size_t b) {
    return links.groups(b, std::vector<std::uint64_t>(blocks[b].patches, 0));
  };
  parts.load = [&](std::size_t b) {
    context.check_stop();
    std::vector<JobSurfel> surfels = load_surfels(overlay, blocks[b], load_stats(overlay, blocks[b]));
    const PatchGroups groups = groups_of(b);
    for (JobSurfel& s : surfels) {
      for (float& a : s.area) a *= static_cast<float>(groups.sign[s.patch]);
      s.patch = static_cast<std::uint32_t>(blocks[b].first_patch) + groups.of[s.patch];
    }
    return surfels;
  };
  std::vector<std::uint8_t> asks(asked.size(), 0);  // by group
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const PatchGroups groups = groups_of(b);
    for (std::size_t p = 0; p < groups.of.size(); ++p)
      asks[blocks[b].first_patch + groups.of[p]] |= asked[blocks[b].first_patch + p];
  }
  const std::vector<GroupView> views = look_from_groups(
      parts, viewers.up, [&](std::uint32_t g) { return asks[g] != 0; }, sight.sight(),
      sight_run(coarse, memory, context));
  auto view = views.begin();
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const PatchGroups groups = groups_of(b);
    std::vector<float> of(groups.count(), 0.0f);
    for (; view != views.end() && view->group < blocks[b].first_patch + blocks[b].patches; ++view)
      of[view->group - blocks[b].first_patch] = static_cast<float>(view->lean);
    for (std::size_t p = 0; p < groups.of.size(); ++p)
      leans[blocks[b].first_patch + p] = of[groups.of[p]] * static_cast<float>(groups.sign[p]);
  }
  return leans;
}

/// \param patches  of the largest block
std::uint64_t look_again_bytes(std::uint64_t coarse, std::uint64_t largest, std::uint64_t patches,
                               std::uint64_t bricks, std::uint64_t memory) {
  // Answers of the groups of one block are held beside its surfels.
  return sight_bytes(sight_sizes(coarse, memory), coarse, largest, bricks) + largest * 2 * sizeof(JobSurfel) +
         patches * (sizeof(PatchStats) + 200) + (4u << 20);
}

std::uint64_t look_around_bytes(std::uint64_t coarse, std::uint64_t largest, std::uint64_t patches,
                                std::uint64_t outer, std::uint64_t bricks, std::uint64_t memory) {
  const std::uint64_t looks =
      sight_bytes(sight_sizes(coarse, memory), coarse, largest, bricks) + JobGroups::held_bytes(outer);
  return std::max(looks, JobGroups::bytes(outer)) + patches * (sizeof(PatchStats) + 40) + (4u << 20);
}

}  // namespace tessera
