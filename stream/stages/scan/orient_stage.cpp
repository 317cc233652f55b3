#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <list>
#include <map>
#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/points/normal_sample.h"
#include "stream/points/point_overlay.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/scan/normals_mode.h"
#include "stream/stages/scan/normals_stage.h"
#include "stream/stages/scan/orient_solution.h"
#include "stream/stages/scan/uncertain_picture.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::size_t kCachedBricks = 256;
/// Surfels of a brick's shell, two sheets everywhere.
constexpr std::uint64_t kMaxBoundary = 6 * 32 * 32 * 2;
// Outliers: fewer supporters than a share of the median point has, within limits that neither rim points of a thin
// scan (above) nor pairs of stray points (below) fall foul of.
constexpr std::uint64_t kMedianShare = 8;
constexpr std::uint32_t kFewestSupporters = 3;
constexpr std::uint32_t kMaxSupporters = 16;
// Strays are rare. Where a share of the median calls more points so, density varies, as around a terrestrial scanner:
// sparse samples are as true as dense ones, and only the lower limit tells strays.
constexpr std::uint64_t kMaxStrays = 20;  ///< one in so many

constexpr double kNotable = 0.01;  ///< share of points in doubt from which the user is told

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

std::string votes_file(std::size_t task) {
  return "votes/" + task_file_stem(task) + ".tsv";
}

class OrientStage : public Stage {
 public:
  explicit OrientStage(const JobState& state)
      : work_(state.work),
        output_(state.output),
        max_uncertain_(reconstruct_options(state).max_uncertain),
        from_(reconstruct_options(state).from),
        vegetation_(reconstruct_options(state).vegetation),
        models_top_(reconstruct_options(state).models_top()),
        memory_bytes_(state.run.memory_bytes),
        plan_(Plan::of_work(state.work)),
        mode_(reconstruct_options(state), state.inputs.size(), plan_, agreement_of_work(state.work)),
        overlay_(list_task_files(state.work / PointOverlay::kFolder, PointOverlay::kExtension)) {}

  std::string name() const override { return "orient"; }
  std::size_t task_count() const override { return mode_.propagate() ? overlay_.file_count() : 0; }
  std::uint64_t units() const override { return mode_.propagate() ? overlay_.bricks().size() : 0; }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = overlay_.file_range(task);
    std::uint64_t largest = 0;
    std::uint64_t patches = 0;
    for (std::size_t b = first; b < last; ++b) {
      largest = std::max<std::uint64_t>(largest, overlay_.bricks()[b].boundary);
      patches += overlay_.bricks()[b].patches;
    }
    return orient_task_bytes(largest, patches);
  }

  json run(std::size_t task, TaskContext& context) const override {
    BoundaryCache cache(overlay_);
    std::vector<PatchVote> votes;
    std::size_t compact_at = 1 << 14;
    const auto [first, last] = overlay_.file_range(task);
    for (std::size_t b = first; b < last; ++b) {
      context.check_stop();
      collect_votes(b, cache, votes);
      if (votes.size() > compact_at) {
        merge_votes(votes);
        compact_at = 2 * votes.size() + (1 << 14);
      }
      context.advance(1);
    }
    merge_votes(votes);
    DirectFile file(context.create(votes_file(task)));
    file.write(votes.data(), votes.size() * sizeof(PatchVote));
    context.count_written(file.finish());
    return {{"votes", votes.size()}};
  }

  std::uint64_t finish_bytes() const override {
    if (!mode_.propagate())
      return overlay_.first_patch().back() + (1u << 20);  // a decision each, nothing to solve
    std::uint64_t votes = 0;
    for (std::size_t t = 0; t < task_count(); ++t) {
      std::error_code missing;  // planned before any task ran
      const std::uint64_t bytes = std::filesystem::file_size(work_ / votes_file(t), missing);
      votes += missing ? 0 : bytes / sizeof(PatchVote);
    }
    std::uint64_t coarse = 0;
    for (const OverlayBrick& b : overlay_.bricks()) votes += b.votes, coarse += b.coarse;
    return orient_solution_bytes(overlay_.first_patch().back(), votes, coarse);
  }

  json finish(const std::vector<json>& summaries, TaskContext& context) const override {
    if (!mode_.needed()) return {{"needed", false}};
    OverlayDecisions decisions;
    json entry = {{"needed", true}};
    if (mode_.propagate()) {
      std::vector<PatchVote> votes;
      for (std::size_t task = 0; task < summaries.size(); ++task) {
        const ReadFile file(work_ / votes_file(task));
        const std::size_t old = votes.size();
        votes.resize(old + summaries[task].at("votes").get<std::size_t>());
        file.read_at(0, votes.data() + old, (votes.size() - old) * sizeof(PatchVote));
      }
      solve_orientation(overlay_, std::move(votes), viewers(), context, decisions, entry);
      const double uncertain = entry.at("uncertain_fraction").get<double>();
      if (uncertain > std::min(kNotable, max_uncertain_)) tell(uncertain, decisions, context, entry);
    } else {
      decisions.patch.assign(overlay_.first_patch().back(), 0);
    }
    if (mode_.clean) clean(decisions, entry);
    const std::string scene = entry.value("scene", "");
    const bool from_above = scene == kAirborne || scene == kSeenFromAbove;
    if (mode_.propagate()) {
      if (vegetation_ == "drop" || (vegetation_ == "auto" && from_above))
        decisions.volumetric = VolumetricUse::kDrop;
      if (models_top_ && (vegetation_ == "top" || from_above)) decisions.volumetric = VolumetricUse::kTop;
      if (vegetation_ == "keep") decisions.volumetric = VolumetricUse::kBodies;
      entry["vegetation"] = {{"points", volumetric_count()}, {"as", name_of(decisions.volumetric)}};
    }
    decisions.save(context.create(PointOverlay::kDecisionsFile));
    return entry;
  }

  std::vector<std::string> obsolete() const override { return {"votes/"}; }

 private:
  /// Many signs in doubt: a picture of where, and a warning, or the end where they are too many.
  void tell(double uncertain, const OverlayDecisions& decisions, const TaskContext& context,
            json& entry) const {
    const std::filesystem::path picture = uncertain_picture_path(output_);
    std::string shown = picture.string() + " shows where in red";
    try {
      draw_uncertain(overlay_, decisions, plan_.lattice, output_, memory_bytes_, context);
    } catch (const ResourceError& e) {  // a small cap must not end a job that needs no picture
      shown = fmt::format("without a picture of where ({})", e.what());
    }
    const std::string where =
        fmt::format("the sides of {:.3g} % of the points are in doubt, {}: ", 100.0 * uncertain, shown);
    if (uncertain > max_uncertain_)
      throw ValidationError(where +
                            fmt::format("give --viewpoint or --from, or allow more than {:.3g} % with "
                                        "--max-uncertain",
                                        100.0 * max_uncertain_));
    entry["warnings"] = {where + "give --viewpoint or --from if they face the wrong way"};
  }

  Viewers viewers() const {
    Viewers v;
    v.own = mode_.each_seen();
    v.scene = mode_.completes ? kGivenSides : mode_.airborne ? kAirborne : v.own ? "sensors" : from_;
    v.given = mode_.lines;
    for (std::size_t a = 0; a < 3; ++a) v.up[a] = static_cast<float>(mode_.up[a]);
    if (!mode_.by_sensor || v.own) return v;
    const double cell = plan_.lattice.h;
    for (const Double3& sensor : plan_.sensors) {
      Float3 at;
      for (std::size_t a = 0; a < 3; ++a)
        at[a] = static_cast<float>((sensor[a] - plan_.lattice.world(static_cast<int>(a), 0.0)) / cell);
      v.sensors.push_back(at);
    }
    return v;
  }

  /// Votes of the voxel pairs that cross from this brick into a neighbour, each pair seen from its lower voxel.
  void collect_votes(std::size_t brick, BoundaryCache& cache, std::vector<PatchVote>& votes) const {
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
        for (const SurfelLink& l : links) {
          auto a = static_cast<std::uint32_t>(overlay_.first_patch()[brick] + here[l.a].patch);
          auto b = static_cast<std::uint32_t>(overlay_.first_patch()[static_cast<std::size_t>(there)] +
                                              ahead[l.b].patch);
          if (a > b) std::swap(a, b);
          votes.push_back({a, b, std::max(l.vote, 0), std::max(-l.vote, 0)});
        }
      }
      i += here.size();
    }
  }

  std::uint64_t volumetric_count() const {
    std::uint64_t n = 0;
    ReadFile(work_ / kSupportersFile).read_at(kSupporterBins * sizeof n, &n, sizeof n);
    return n;
  }

  /// Threshold from the histogram of supporters over all points; counts what it drops.
  void clean(OverlayDecisions& decisions, json& entry) const {
    std::vector<std::uint64_t> histogram(kSupporterBins, 0);
    ReadFile(work_ / kSupportersFile).read_at(0, histogram.data(), histogram.size() * sizeof(histogram[0]));
    std::uint64_t all = 0;
    for (const std::uint64_t n : histogram) all += n;
    std::uint64_t below = 0;
    std::uint32_t median = 0;
    while (median + 1 < kSupporterBins && 2 * (below + histogram[median]) < all) below += histogram[median++];
    decisions.min_supporters = static_cast<std::uint32_t>(
        std::clamp<std::uint64_t>(median / kMedianShare, kFewestSupporters, kMaxSupporters));
    std::uint64_t dropped = 0;
    for (std::uint32_t i = 0; i < decisions.min_supporters; ++i) dropped += histogram[i];
    while (decisions.min_supporters > kFewestSupporters && dropped > all / kMaxStrays)
      dropped -= histogram[--decisions.min_supporters];
    entry["median_supporters"] = median;
    entry["min_supporters"] = decisions.min_supporters;
    entry["outliers_dropped"] = dropped;
  }

  std::filesystem::path work_;
  std::filesystem::path output_;
  double max_uncertain_;
  std::string from_;
  std::string vegetation_;
  bool models_top_;
  std::uint64_t memory_bytes_;
  Plan plan_;
  NormalsMode mode_;
  PointOverlay overlay_;
};

}  // namespace

std::uint64_t orient_task_bytes(std::uint64_t boundary, std::uint64_t patches) {
  return std::min(boundary, kMaxBoundary) * sizeof(Surfel) * kCachedBricks +
         2 * 13 * patches * sizeof(PatchVote) + (8u << 20);
}

std::unique_ptr<Stage> make_orient_stage(const JobState& state) {
  return std::make_unique<OrientStage>(state);
}

}  // namespace tessera
