#include <fmt/format.h>
#include <algorithm>
#include <optional>
#include <utility>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/points/normal_sample.h"
#include "stream/points/point_overlay.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/normals_mode.h"
#include "stream/stages/scan/normals_stage.h"
#include "stream/stages/scan/orient_needs.h"
#include "stream/stages/scan/orient_solution.h"
#include "stream/stages/scan/orient_viewers.h"
#include "stream/stages/scan/uncertain_picture.h"

namespace tessera {
namespace {

// Outliers: fewer supporters than a share of the median point has, within limits that neither rim points of a thin
// scan (above) nor pairs of stray points (below) fall foul of.
constexpr std::uint64_t kMedianShare = 8;
constexpr std::uint32_t kFewestSupporters = 3;
constexpr std::uint32_t kMaxSupporters = 16;
// Strays are rare. Where a share of the median calls more points so, density varies, as around a terrestrial scanner:
// sparse samples are as true as dense ones, and only the lower limit tells strays.
constexpr std::uint64_t kMaxStrays = 20;  ///< one in so many

/// Share of level area from which a scene shows a top that can stand in for points: a lamp post has 0.22, a cliff 0.5.
constexpr double kMinTopLevel = 0.3;
constexpr double kNotable = 0.01;  ///< share of points in doubt from which the user is told

/// Shares of the points.
struct Doubts {
  double surface = 0.0;
  double strewn = 0.0;
  double all() const { return surface + strewn; }
};

class OrientStage : public Stage {
 public:
  explicit OrientStage(const JobState& state)
      : work_(state.work),
        output_(state.output),
        max_uncertain_(reconstruct_options(state).max_uncertain),
        from_(reconstruct_options(state).from),
        vegetation_(reconstruct_options(state).vegetation),
        surface_(reconstruct_options(state).surface),
        models_top_(reconstruct_options(state).models_top()),
        memory_bytes_(state.run.memory_bytes),
        plan_(Plan::of_work(state.work)),
        mode_(reconstruct_options(state), state.inputs.size(), plan_, agreement_of_work(state.work)),
        viewers_(viewers_of(mode_, plan_, from_)),
        overlay_(list_task_files(state.work / PointOverlay::kFolder, PointOverlay::kExtension)),
        links_(work_),
        tops_(viewers_.up) {
    if (!mode_.propagate()) return;
    scene_ = OrientationScene::load(work_ / OrientationScene::kFile);
    tops_ = TopColumns(viewers_.up, std::move(scene_.columns));
    blocks_ = list_patch_blocks(overlay_);
    tasks_ = group_patch_blocks(blocks_);
    if (!viewers_.own && !scene_.from_above) sight_.emplace(work_ / SightVotes::kFile);
  }

  std::string name() const override { return "orient"; }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override { return mode_.propagate() ? overlay_.bricks().size() : 0; }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t b = tasks_[task].first; b < tasks_[task].last; ++b)
      maximum =
          std::max(maximum, solve_block_bytes(blocks_[b].patches, links_.inner_count(b), blocks_[b].coarse));
    return maximum + scene_.border.size() * sizeof(std::uint32_t) +
           tops_.columns().size() * sizeof(TopColumns::Column);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    AnchorsFileWriter file(context.create(std::string(PatchAnchors::kFolder) + "/" + task_file_stem(task) +
                                          PatchAnchors::kExtension));
    for (std::size_t b = tasks_[task].first; b < tasks_[task].last; ++b) {
      context.check_stop();
      file.block(overlay_.bricks()[blocks_[b].first_brick].key,
                 solve_block(overlay_, links_, b, blocks_[b], scene_, tops_, sight(), viewers_));
      context.advance(blocks_[b].last_brick - blocks_[b].first_brick);
    }
    context.count_written(file.finish());
    return Json::object();
  }

  std::uint64_t finish_bytes() const override {
    const std::uint64_t patches = overlay_.first_patch().back();
    if (!mode_.propagate()) return patches + (1u << 20);  // a decision each, nothing to solve
    std::uint64_t outer = sight_ ? sight_->outer_count() : 0, largest = 0, surfels = 0, coarse = 0;
    for (std::size_t b = 0; b < links_.block_count(); ++b) {
      outer += links_.outer_count(b);
      largest = std::max<std::uint64_t>(largest, blocks_[b].patches);
      surfels = std::max(surfels, blocks_[b].coarse);
      coarse += blocks_[b].coarse;
    }
    const std::uint64_t solving = block_orientation_bytes(patches, largest, scene_.border.size(),
                                                          outer + PatchAnchors(work_).vote_count());
    if (!sight_) return solving;
    return std::max(solving, settle_doubt_bytes(patches, largest, coarse, surfels, overlay_.bricks().size(),
                                                memory_bytes_));
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    if (!mode_.needed()) return {{"needed", false}};
    OverlayDecisions decisions;
    Json entry = {{"needed", true}};
    if (mode_.clean) clean(decisions, entry);
    if (mode_.propagate()) {
      decisions.volumetric =
          volumetric_use(viewers_.own ? is_from_above(viewers_.scene) : scene_.from_above && shows_top());
      if (viewers_.unknown())
        entry.update({{"covered_fraction", scene_.covered},
                      {"roofed_fraction", scene_.roofed},
                      {"level_fraction", scene_.level},
                      {"ground_fraction", scene_.ground}});
      if (viewers_.own || scene_.from_above) entry["scene"] = viewers_.own ? viewers_.scene : kSeenFromAbove;
      if (sight_) sight_->tell(entry);
      solve_block_orientation(overlay_, links_, scene_, PatchAnchors(work_), sight(), viewers_, memory_bytes_,
                              context, decisions, entry);
      const Doubts doubts = {entry.at("uncertain_fraction").get<double>(),
                             entry.at("uncertain_strewn_fraction").get<double>()};
      if (doubts.all() > std::min(kNotable, max_uncertain_)) tell(doubts, decisions, context, entry);
    } else {
      decisions.patch.assign(overlay_.first_patch().back(), 0);
    }
    const std::string scene = entry.value("scene", "");
    if (surface_ != "all" && !is_from_above(scene))
      throw UsageError("--surface " + surface_ + ": the scene was not seen from above (" + scene +
                       "); give --from above if it was, or leave --surface out");
    if (mode_.propagate())
      entry["vegetation"] = {
          {"points", volumetric_count()},
          {"as", name_of(vegetation_ == "drop" ? VolumetricUse::kDrop : decisions.volumetric)}};
    if (sight_ && sight_->is_room())
      write_text(context.create(kRoomFile), dump_json({{"scene", scene}}) + "\n");
    decisions.save(context.create(PointOverlay::kDecisionsFile));
    return entry;
  }

  std::vector<std::string> obsolete() const override { return {"links/", "anchors/"}; }

 private:
  static bool is_from_above(const std::string& scene) {
    return scene == kAirborne || scene == kSeenFromAbove;
  }

  /// What stands upright alone, as a mast, would become pillars.
  bool shows_top() const { return from_ != "auto" || surface_ != "all" || scene_.level >= kMinTopLevel; }

  VolumetricUse volumetric_use(bool from_above) const {
    if (vegetation_ == "keep") return VolumetricUse::kBodies;
    if (models_top_ && (vegetation_ == "top" || from_above)) return VolumetricUse::kTop;
    if (vegetation_ == "drop" || (vegetation_ == "auto" && from_above)) return VolumetricUse::kDrop;
    return VolumetricUse::kSurface;
  }

  /// Null where patches know their sides.
  const SightVotes* sight() const { return sight_ ? &*sight_ : nullptr; }

  /// Many signs in doubt: a picture of where, and a warning, or the end where they are too many.
  void tell(const Doubts& doubts, const OverlayDecisions& decisions, const TaskContext& context,
            Json& entry) const {
    const std::filesystem::path picture = uncertain_picture_path(output_);
    std::string shown = picture.string() + " shows where in red";
    try {
      draw_uncertain(overlay_, decisions, plan_.lattice, output_, memory_bytes_, context);
    } catch (const ResourceError& e) {  // a small cap must not end a job that needs no picture
      shown = fmt::format("without a picture of where ({})", e.what());
    }
    const std::string strewn =
        doubts.strewn > 0.0 ? fmt::format(", and of {:.3g} % that are strewn", 100.0 * doubts.strewn) : "";
    const std::string where = fmt::format(
        "the sides of {:.3g} % of the points are in doubt{}, {}: ", 100.0 * doubts.surface, strewn, shown);
    if (doubts.all() > max_uncertain_)
      throw ValidationError(where +
                            fmt::format("give --viewpoint or --from, or allow more than {:.3g} % with "
                                        "--max-uncertain",
                                        100.0 * max_uncertain_));
    entry["warnings"] = {where + "give --viewpoint or --from if they face the wrong way"};
  }

  std::uint64_t volumetric_count() const {
    std::uint64_t n = 0;
    ReadFile(work_ / kSupportersFile).read_at(kSupporterBins * sizeof n, &n, sizeof n);
    return n;
  }

  /// Threshold from the histogram of supporters over all points; counts what it drops.
  void clean(OverlayDecisions& decisions, Json& entry) const {
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
  std::string surface_;
  bool models_top_;
  std::uint64_t memory_bytes_;
  Plan plan_;
  NormalsMode mode_;
  Viewers viewers_;
  PointOverlay overlay_;
  PatchLinks links_;
  OrientationScene scene_;
  TopColumns tops_;  ///< its columns
  std::optional<SightVotes> sight_;
  std::vector<PatchBlock> blocks_;
  std::vector<PatchBlockRange> tasks_;
};

}  // namespace

std::unique_ptr<Stage> make_orient_stage(const JobState& state) {
  return std::make_unique<OrientStage>(state);
}

namespace {

constexpr double kOrientTime = 0.12,
                 kSeenOrientTime = 0.01;  ///< microseconds a point; where each knows its side

}  // namespace

StageForecast forecast_orient(const PlannedScan& scan) {
  if (!scan.estimates_normals) return idle_forecast();
  const OrientNeeds needs = orient_needs(scan);
  const std::uint64_t buckets = scan.plan.buckets.size();
  return all_sure({.tasks = buckets,
                   .task_bytes = needs.task,
                   .finish_bytes = needs.finish,
                   .files = buckets,
                   .processor_us = scan.points * (scan.knows_sides ? kSeenOrientTime : kOrientTime),
                   .moved_bytes = static_cast<double>(scan.overlay_bytes)});
}

}  // namespace tessera
