#include <algorithm>
#include <array>
#include <limits>
#include <list>
#include <map>

#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/normal_sample.h"
#include "stream/points/patch_blocks.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/normals_mode.h"
#include "stream/stages/scan/normals_stage.h"
#include "stream/stages/scan/orient_needs.h"
#include "stream/stages/scan/orient_sight.h"
#include "stream/stages/scan/orient_viewers.h"

namespace tessera {
namespace {

constexpr std::size_t kCachedBricks = 256;
/// Surfels of a brick's shell, two sheets everywhere.
constexpr std::uint64_t kMaxBoundary = 6 * 32 * 32 * 2;
/// Of the scene's columns, per brick: as many as it holds if up is an axis, twice, and a quarter more before they are merged.
constexpr std::uint64_t kColumnsPerBrick = (kBrickCells / kCoarseCells) * (kBrickCells / kCoarseCells);
constexpr std::uint64_t kColumnBytes = kColumnsPerBrick * 2 * 5 / 4 * sizeof(TopColumns::Column);

/// Boundary surfels of the bricks around the current one, by voxel.
class BoundaryCache {
 public:
  explicit BoundaryCache(const PointOverlay& overlay) : overlay_(overlay) {}
  const std::vector<Surfel>& get(std::size_t brick) {
    const auto found = cache_.find(brick);
    if (found != cache_.end()) return found->second;
    if (order_.size() >= kCachedBricks) {
      cache_.erase(order_.front());
      order_.pop_front();
    }
    order_.push_back(brick);
    return cache_[brick] = overlay_.load_boundary(brick);
  }

 private:
  const PointOverlay& overlay_;
  std::map<std::size_t, std::vector<Surfel>> cache_;
  std::list<std::size_t> order_;
};

std::uint32_t voxel_order(const Surfel& s) {
  return (std::uint32_t{s.voxel[2]} << 16) | (std::uint32_t{s.voxel[1]} << 8) | s.voxel[0];
}

/// The surfels of one voxel in a boundary.
std::span<const Surfel> surfels_of(const std::vector<Surfel>& boundary, const Surfel& voxel) {
  const auto range =
      std::equal_range(boundary.begin(), boundary.end(), voxel,
                       [](const Surfel& l, const Surfel& r) { return voxel_order(l) < voxel_order(r); });
  return {range.first, range.second};
}

/// Links of one block, merged now and then.
struct BlockLinks {
  std::vector<PatchVote> inner, outer;
  std::size_t merge_at = 1 << 14;

  void merge(bool always) {
    if (!always && inner.size() + outer.size() < merge_at) return;
    merge_votes(inner), merge_votes(outer);
    merge_at = 2 * (inner.size() + outer.size()) + (1 << 14);
  }
};

class LinksStage : public Stage {
 public:
  explicit LinksStage(const JobState& state)
      : work_(state.work),
        memory_bytes_(state.run.memory_bytes),
        plan_(Plan::of_work(state.work)),
        mode_(reconstruct_options(state), state.inputs.size(), plan_, agreement_of_work(state.work)),
        viewers_(viewers_of(mode_, plan_, reconstruct_options(state).from)),
        overlay_(list_task_files(state.work / PointOverlay::kFolder, PointOverlay::kExtension)),
        blocks_(mode_.propagate() ? list_patch_blocks(overlay_) : std::vector<PatchBlock>{}),
        tasks_(group_patch_blocks(blocks_)) {}

  std::string name() const override { return "links"; }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override { return mode_.propagate() ? overlay_.bricks().size() : 0; }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t boundary = 0, patches = 0;
    for (std::size_t b = tasks_[task].first; b < tasks_[task].last; ++b) {
      patches = std::max<std::uint64_t>(patches, blocks_[b].patches);
      for (std::size_t k = blocks_[b].first_brick; k < blocks_[b].last_brick; ++k)
        boundary = std::max<std::uint64_t>(boundary, overlay_.bricks()[k].boundary);
    }
    return links_task_bytes(boundary, patches);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    LinksFileWriter file(context.create(std::string(PatchLinks::kFolder) + "/" + task_file_stem(task) +
                                        PatchLinks::kExtension));
    BoundaryCache cache(overlay_);
    for (std::size_t b = tasks_[task].first; b < tasks_[task].last; ++b) {
      const PatchBlock& block = blocks_[b];
      BlockLinks links;
      for (std::size_t k = block.first_brick; k < block.last_brick; ++k) {
        context.check_stop();
        const auto first = static_cast<std::uint32_t>(overlay_.first_patch()[k] - block.first_patch);
        for (const PatchVote& v : overlay_.load_votes(k))
          links.inner.push_back({first + v.a, first + v.b, v.same, v.opposite});
        collect_links(k, block, cache, links);
        links.merge(false);
        context.advance(1);
      }
      links.merge(true);
      std::vector<std::uint64_t> weight;
      for (const PatchStats& s : load_stats(overlay_, block)) weight.push_back(s.surfels);
      // Own sensors know the side of every patch: nothing is joined before they are asked.
      const ContractionLimits limits =
          viewers_.own ? ContractionLimits{std::numeric_limits<double>::infinity(), 1.0} : kGroupLimits;
      file.block(overlay_.bricks()[block.first_brick].key, links.inner, links.outer,
                 group_patches(weight, links.inner, limits));
    }
    context.count_written(file.finish());
    return Json::object();
  }

  std::uint64_t finish_bytes() const override {
    if (!mode_.propagate()) return 1u << 20;
    std::uint64_t outer = 0, surfels = 0, patches = 0, coarse = 0;
    const PatchLinks links(work_);
    for (std::size_t b = 0; b < links.block_count(); ++b) outer += links.outer_count(b);
    for (const PatchBlock& block : blocks_) {
      surfels = std::max(surfels, block.coarse);
      patches = std::max<std::uint64_t>(patches, block.patches);
      coarse += block.coarse;
    }
    const std::uint64_t bricks = overlay_.bricks().size();
    const std::uint64_t above = links_finish_bytes(viewers_.unknown() ? bricks : 0, outer, surfels, patches);
    if (viewers_.own || told_from_above()) return above;
    return std::max(above, look_around_bytes(coarse, surfels, patches, outer, bricks, memory_bytes_));
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    if (!mode_.propagate()) return Json::object();
    OrientationScene scene;
    const PatchLinks links(work_);
    if (viewers_.unknown()) look_from_above(links, context, scene);
    const bool looks = !viewers_.own && !scene.from_above;
    const std::filesystem::path sight = looks ? context.create(SightVotes::kFile) : std::filesystem::path{};
    if (looks) look_around(overlay_, blocks_, links, viewers_, memory_bytes_, context, sight);
    const auto is_linked = [&](const std::vector<PatchVote>& votes) {
      for (const PatchVote& v : votes) scene.border.push_back(v.a), scene.border.push_back(v.b);
    };
    is_linked(links.outer());
    if (looks) is_linked(SightVotes(sight).outer());
    std::sort(scene.border.begin(), scene.border.end());
    scene.border.erase(std::unique(scene.border.begin(), scene.border.end()), scene.border.end());
    scene.save(context.create(OrientationScene::kFile));
    return {{"blocks", blocks_.size()}, {"border_patches", scene.border.size()}};
  }

 private:
  /// The user says so, and no sensor says otherwise.
  bool told_from_above() const { return viewers_.unknown() && viewers_.scene == "above"; }

  /// Whether the scene was seen from above, and its tops where it was.
  void look_from_above(const PatchLinks& links, const TaskContext& context, OrientationScene& scene) const {
    const TopSurface tops(viewers_.up, [&](const SurfelBatch& visit) {
      for (std::size_t b = 0; b < blocks_.size(); ++b) {
        context.check_stop();
        const std::vector<PatchStats> stats = load_stats(overlay_, blocks_[b]);
        const PatchGroups groups = links.groups(b, std::vector<std::uint64_t>(stats.size(), 0));
        visit(load_surfels(overlay_, blocks_[b], stats), groups.of);
      }
    });
    scene.covered = tops.covered_share(), scene.roofed = tops.roofed_share(),
    scene.level = tops.level_share(), scene.ground = tops.ground_share();
    scene.from_above = told_from_above() || (viewers_.scene == "auto" && tops.seen_from_above());
    if (scene.from_above)
      scene.columns.assign(tops.columns().columns().begin(), tops.columns().columns().end());
  }

  /// Links of the voxel pairs that cross from this brick into a neighbour, each pair seen from its lower voxel.
  void collect_links(std::size_t brick, const PatchBlock& block, BoundaryCache& cache, BlockLinks& to) const {
    const std::vector<Surfel> own = cache.get(brick);  // a copy: the cache may drop it
    const Int3 at = brick_of_key(overlay_.bricks()[brick].key);
    std::vector<SurfelLink> links;
    for (std::size_t i = 0; i < own.size();) {
      const std::span<const Surfel> here = surfels_of(own, own[i]);
      for (int d = 14; d < 27; ++d) {
        const std::array<int, 3> step = {d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1};
        Surfel wanted;
        Int3 other = at;
        Float3 shift{};
        for (std::size_t a = 0; a < 3; ++a) {
          const int v = own[i].voxel[a] + step[a];
          const int carry = v < 0 ? -1 : (v >= kSurfelsPerBrick ? 1 : 0);
          other[a] += carry;
          shift[a] = static_cast<float>(carry * kBrickCells);
          wanted.voxel[a] = static_cast<std::uint8_t>(v - carry * kSurfelsPerBrick);
        }
        if (other == at || other[0] < 0 || other[1] < 0 || other[2] < 0) continue;
        const std::int64_t there = overlay_.find(brick_key(other));
        if (there < 0) continue;
        const std::span<const Surfel> ahead = surfels_of(cache.get(static_cast<std::size_t>(there)), wanted);
        links.clear();
        link_voxels(here, ahead, shift, links);
        const bool inside = block.first_brick <= static_cast<std::size_t>(there) &&
                            static_cast<std::size_t>(there) < block.last_brick;
        const std::uint64_t zero = inside ? block.first_patch : 0;
        const std::uint64_t first_here = overlay_.first_patch()[brick] - zero;
        const std::uint64_t first_there = overlay_.first_patch()[static_cast<std::size_t>(there)] - zero;
        for (const SurfelLink& l : links) {
          auto a = static_cast<std::uint32_t>(first_here + here[l.a].patch);
          auto b = static_cast<std::uint32_t>(first_there + ahead[l.b].patch);
          if (a > b) std::swap(a, b);
          (inside ? to.inner : to.outer).push_back({a, b, std::max(l.vote, 0), std::max(-l.vote, 0)});
        }
      }
      i += here.size();
    }
  }

  std::filesystem::path work_;
  std::uint64_t memory_bytes_;
  Plan plan_;
  NormalsMode mode_;
  Viewers viewers_;
  PointOverlay overlay_;
  std::vector<PatchBlock> blocks_;
  std::vector<PatchBlockRange> tasks_;
};

}  // namespace

std::uint64_t links_task_bytes(std::uint64_t boundary, std::uint64_t patches) {
  return std::min(boundary, kMaxBoundary) * sizeof(Surfel) * kCachedBricks +
         2 * 13 * patches * sizeof(PatchVote) + patches * 200 + (8u << 20);
}

std::uint64_t links_finish_bytes(std::uint64_t bricks, std::uint64_t outer, std::uint64_t surfels,
                                 std::uint64_t patches) {
  return bricks * kColumnBytes + outer * (sizeof(PatchVote) + 8) + surfels * sizeof(JobSurfel) +
         patches * (sizeof(PatchStats) + 24) + (8u << 20);
}

std::unique_ptr<Stage> make_links_stage(const JobState& state) {
  return std::make_unique<LinksStage>(state);
}

namespace {

constexpr double kLinksTime = 0.06,
                 kSeenLinksTime = 0.02;  ///< microseconds a point; where each knows its side

}  // namespace

StageForecast forecast_links(const PlannedScan& scan) {
  if (!scan.estimates_normals) return idle_forecast();
  const OrientNeeds needs = orient_needs(scan);
  const std::uint64_t buckets = scan.plan.buckets.size();
  return all_sure({.tasks = buckets,
                   .task_bytes = needs.links_task,
                   .finish_bytes = needs.links_finish,
                   .disk_bytes = needs.links_disk,
                   .files = buckets,
                   .processor_us = scan.points * (scan.knows_sides ? kSeenLinksTime : kLinksTime),
                   .moved_bytes = static_cast<double>(scan.overlay_bytes)});
}

}  // namespace tessera
