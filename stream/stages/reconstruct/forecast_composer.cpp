#include "stream/stages/reconstruct/forecast.h"

#include <algorithm>

#include "kernels/field/field.h"
#include "kernels/mesh/mesh_repair.h"
#include "stream/import/import_bytes.h"
#include "stream/meshes/mesh_store_output.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/points/closing_store.h"
#include "stream/points/multipole_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/coverage/coverage_stage.h"
#include "stream/stages/coverage/seen_stages.h"
#include "stream/stages/decimate/certify_stage.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/reconstruct/brick_needs.h"
#include "stream/stages/reconstruct/forecast_list.h"
#include "stream/stages/reconstruct/forecast_rates.h"
#include "stream/stages/reconstruct/planned_patches.h"
#include "stream/stages/scan/distribute_stage.h"
#include "stream/stages/scan/normals_mode.h"
#include "stream/stages/scan/normals_stage.h"
#include "stream/stages/scan/order_stage.h"
#include "stream/stages/scan/orient_needs.h"
#include "stream/stages/scan/orient_solution.h"
#include "stream/stages/smooth/smooth_needs.h"
#include "stream/stages/smooth/smooth_stage.h"
#include "stream/stages/surface/closing_stages.h"
#include "stream/stages/surface/first_pass.h"
#include "stream/stages/surface/hole_limit.h"
#include "stream/stages/surface/islands_stage.h"
#include "stream/stages/surface/level_surface_stage.h"
#include "stream/stages/surface/loops_stage.h"
#include "stream/stages/surface/samples_stage.h"
#include "stream/stages/surface/surface_stage.h"
#include "stream/stages/surface/write_stage.h"
#include "stream/stages/weld/border_stage.h"
#include "stream/stages/weld/mesh_around.h"
#include "stream/stages/weld/uncross_stage.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

using namespace rates;

std::uint64_t times(double count, double each) {
  return static_cast<std::uint64_t>(count * each);
}

using Memory = ForecastMemory;
Memory known(std::uint64_t task, std::uint64_t finish) {
  return {task, finish, std::max(task, finish)};
}

/// One forecast at work: its stages in order of the job.
class Composer {
 public:
  Composer(const Plan& plan, const std::vector<PlanBrick>& bricks, const InputTasks& inputs,
           const JobState& job)
      : plan_(plan),
        run_(job.run),
        options_(reconstruct_options(job)),
        mode_(options_, job.inputs.size(), plan, agreement_where_measured(job.work)),
        inputs_(inputs),
        plan_bricks_(bricks),
        bricks_(planned_bricks(bricks, options_.max_brick_points)),
        points_(static_cast<double>(plan.points())),
        faces_(expected_level_faces(plan, options_)),
        run_bytes_(times(points_, kRunBytes)),
        store_bytes_(times(points_, kStoreBytes)),
        overlay_bytes_(mode_.needed() ? times(points_, kOverlayBytes) : 0) {
    FieldOptions field = field_options(plan, options_.feature_angle_deg);
    closes_ = field.firm_boundary = HolesMode(options_.holes).close;
    halo_ = field_halo_cells(field);
    groups_ = make_tile_groups(bricks_, surface_tiling(job, field));
    patches_ = plan_patches(bricks_, groups_, plan.faces_estimate);
    for (const BrickEntry& b : bricks_) {
      largest_brick_ = std::max(largest_brick_, b.points);
      max_blocks_ = std::max(max_blocks_, b.blocks);
      blocks_ += b.blocks;
    }
    for (const PatchEntry& e : patches_.entries)
      if (e.faces > largest_.faces) largest_ = e;
  }

  Forecast compose() {
    scan();
    const std::uint64_t closing = closes_ ? close() : 0;
    const bool fused = fuses_stores(options_);
    const std::uint64_t patches = times(faces_, fused ? kFirstPassBytes : kPatchBytes);
    const std::uint64_t smoothed = options_.smooths() ? times(faces_, 2 * kPatchBytes) : 0;
    options_.has_levels() ? level_surface(patches) : surface(fused, patches);
    forecast_.output_bytes = times(faces_, kOutputBytes);
    fused ? islands() : weld(patches);
    if (options_.decimates()) {
      if (!fused) import();
      if (options_.smooths()) smooth();
      decimate(patches + smoothed / 2);
    }
    const auto cover = planned_coverage_bytes(fused || options_.decimates(), largest_, filling_bytes());
    add("coverage", groups_.size(), {cover, coverage_finish_bytes(), coverage_finish_bytes()}, 0,
        2 * groups_.size(), faces_ * (options_.decimates() ? 0.1 : 1.0) * kCoverageTime, 0.0);
    if (!options_.decimates()) add_write("write", patch_write(), patches);
    forecast_.peak_disk_bytes =
        std::max({inputs_.unpacked_bytes + run_bytes_, run_bytes_ + store_bytes_,
                  top_bytes_ > 0 ? 2 * store_bytes_ + overlay_bytes_ + top_bytes_ : 0,
                  store_bytes_ + overlay_bytes_ + closing + patches,
                  patches + smoothed + forecast_.output_bytes + store_bytes_ + overlay_bytes_ + closing});
    if (options_.decimates() && !fused)  // the raw mesh, its vertices and faces dealt out, its store
      forecast_.peak_disk_bytes =
          std::max(forecast_.peak_disk_bytes,
                   store_bytes_ + overlay_bytes_ +
                       times(static_cast<double>(forecast_.output_bytes), 1 + 3 * kImportBytes) + smoothed);
    forecast_.stages = list_.in_order_of_the_run(options_);
    return std::move(forecast_);
  }

 private:
  void add(const std::string& stage, std::uint64_t tasks, const Memory& memory, std::uint64_t disk,
           std::uint64_t files, double processor_us, double moved_bytes) {
    list_.add(stage, tasks, memory, disk, files, processor_us, moved_bytes);
  }

  void scan() {
    const std::uint64_t buckets = plan_.buckets.size();
    add("distribute", inputs_.count,
        known(distribute_task_bytes(run_, plan_, inputs_.largest_bytes),
              distribute_finish_bytes(run_, plan_, inputs_.count)),
        run_bytes_, inputs_.count + 1, points_ * kDistributeTime, 2.0 * static_cast<double>(run_bytes_));
    std::uint64_t order = 0;
    const std::uint64_t runs = distribute_runs(run_, plan_, inputs_.count);
    for (const PlanBucket& b : plan_.buckets)
      order = std::max(
          order, order_task_bytes(b, plan_bricks_, std::min(runs, b.points), options_.max_brick_points));
    add("order", buckets, known(order, OrderStage::kFinishBytes), store_bytes_, buckets, points_ * kOrderTime,
        static_cast<double>(run_bytes_ + store_bytes_));
    add("seen-spacing", 0, known(0, seen_spacing_bytes(bricks_)), 0, 1, 0.0, 0.0);
    add("seen", buckets, known(planned_seen_bytes(plan_, bricks_), seen_finish_bytes()), 0, 2 * buckets,
        points_ * kSeenTime, static_cast<double>(store_bytes_));
    if (!mode_.needed()) return;
    add("normals", buckets, known(normals_task_bytes(bricks_, 0, bricks_.size()), 0), overlay_bytes_, buckets,
        points_ * (mode_.estimate ? kEstimateTime : kShapeTime),
        static_cast<double>(store_bytes_ + overlay_bytes_));
    if (!mode_.propagate()) return;
    // Rooms and objects are oriented in one piece, and nobody knows yet what this scan is of.
    const bool in_blocks = mode_.each_seen() || options_.from == "above";
    const OrientNeeds orient =
        orient_needs(bricks_.size(), blocks_, max_blocks_, plan_.noise_cells, in_blocks);
    const auto overlay = static_cast<double>(overlay_bytes_);
    add("links", buckets, {orient.links_task, orient.links_finish, links_finish_bytes(0, 0, 0, 0)},
        orient.links_disk, buckets, points_ * kLinksTime, overlay);
    add("orient", buckets, {orient.task, orient.finish, block_orientation_bytes(0, 0, 0, 0)}, 0, buckets,
        points_ * kOrientTime, overlay);
    if (!may_have_top(options_)) return;
    top_bytes_ = forecast_top(run_, options_, plan_, bricks_, store_bytes_, overlay_bytes_, list_);
  }

  /// \returns what it leaves on disk
  std::uint64_t close() {
    const std::uint64_t multipoles = times(faces_, kMultipoleBytes), ends = times(faces_, kBoundaryBytes);
    const auto read = static_cast<double>(store_bytes_ + overlay_bytes_);
    add("multipole", plan_.buckets.size(), known(multipole_task_bytes(largest_brick_), 0), multipoles,
        plan_.buckets.size(), points_ * kMultipoleTime, read);
    std::uint64_t bytes = 0;
    for_each_tile([&](const Tile& t) { bytes = std::max(bytes, boundaries_tile_bytes(bricks_, t, halo_)); });
    add("rims", groups_.size(), known(bytes, 0), ends, groups_.size(), faces_ * kBoundaryTime, read);
    const std::uint64_t lent = planned_close_bytes(run_, bricks_);
    add("close", 0, {0, lent, close_bytes(run_, {})}, 0, 1, 0.0, 0.0);
    return multipoles + ends;
  }

  void level_surface(std::uint64_t patches) {
    add("surface", groups_.size(), known(level_surface_task_bytes(max_points_near(bricks_)), 0), patches,
        groups_.size(), faces_ * surface_time(plan_.noise_cells),
        static_cast<double>(store_bytes_ + overlay_bytes_ + patches));
  }
  void surface(bool fused, std::uint64_t patches) {
    const BrickSectionStore no_cells({});
    std::uint64_t maximum = 0, open = 0;
    for_each_tile([&](const Tile& t) {
      const std::uint64_t near = closes_ ? MultipoleStore::near_bytes(bricks_, t.corner(), t.edges()) : 0;
      const BrickSectionStore* closing = closes_ ? &no_cells : nullptr;
      maximum = std::max(maximum, surface_tile_bytes(bricks_, closing, t, halo_, fused, near));
      if (closes_) open = std::max(open, surface_tile_bytes(bricks_, closing, t, halo_, fused, 0));
    });
    add("surface", groups_.size(), {maximum, 0, closes_ ? open : maximum}, patches, groups_.size(),
        faces_ * (surface_time(plan_.noise_cells) + (fused ? kFirstPassTime : 0.0)),
        static_cast<double>(store_bytes_ + overlay_bytes_ + patches));
  }

  void islands() {
    std::uint64_t parts = 0;
    for (const PatchEntry& e : patches_.entries) parts += e.components;
    add("islands", 0, {0, islands_bytes(run_, parts), islands_bytes(run_, 0)}, 0, 1, 0.0, 0.0);
    add("prune", groups_.size(), {prune_task_bytes(8 * surface_block_bytes(largest_.faces)), 0, 0}, 0, 0, 0.0,
        0.0);
  }

  void weld(std::uint64_t patches) {
    std::uint64_t components = 0;
    for (const PatchEntry& e : patches_.entries) components += e.components;
    const std::uint64_t groups = groups_.size();
    add("weld", groups,
        {patches_.most_of_tasks(weld_task_bytes), weld_finish_bytes(patches_.entries.size(), components),
         weld_finish_bytes(0, 0)},
        0, groups, faces_ * kWeldTime, 0.0);
    const auto each = [&](auto of) { return Memory{patches_.most_of_tasks(of), 0, of({})}; };
    if (options_.smooths_border() && plan_.noise_cells > 0.0)
      add("border", groups, each(border_task_bytes), 0, groups, faces_ * kBorderTime, 0.0);
    for (const StageEntry& round : uncross_stages())  // only the first looks at all bricks
      add(round.name, groups, each(uncross_task_bytes), 0, groups,
          round.name == "uncross-1" ? faces_ * kUncrossTime : 0.0, 0.0);
    if (const HoleLimit holes = hole_limit(options_, plan_, true); holes.edges > 0) {
      Memory find = each(loops_task_bytes), fill = each(MeshAround::bytes);
      find.finish = loops_finish_bytes(run_, holes.edges, patches_.entries);
      find.sure = loops_finish_bytes(run_, holes.edges, {});
      add("loops", groups, find, 0, groups, 0.0, static_cast<double>(patches));
      fill.task += hole_task_bytes(holes.edges), fill.sure += hole_task_bytes(holes.edges);
      add("holes", groups, fill, 0, groups, 0.0, 0.0);
    }
    if (options_.decimates()) add_write("raw", patch_write(), patches);
  }

  /// The raw mesh comes back as a store.
  void import() {
    const auto vertices = times(faces_ * kFacesMargin * kFacesMargin, kVerticesPerFace);
    const auto in_bucket = std::min(vertices, times(double{ImportPlan::kBucketVertices}, kFacesMargin));
    const auto faces = times(static_cast<double>(in_bucket), kFacesMargin / kVerticesPerFace);
    const std::uint64_t buckets = vertices / ImportPlan::kBucketVertices + 1;
    const auto bytes = static_cast<double>(forecast_.output_bytes);
    add("mesh-read", 0, known(0, import_read_bytes(run_)), times(bytes, kImportBytes), 1,
        faces_ * kImportReadTime, bytes);
    add("mesh-vertices", buckets,
        {import_vertices_task_bytes(in_bucket, kDealtVertexBytes), kImportVerticesFinishBytes, 0},
        times(bytes, kImportBytes), 2 * buckets, faces_ * kImportVerticesTime, bytes);
    add("mesh-corners", 0, {0, import_corners_bytes(run_, vertices), import_corners_bytes(run_, 0)},
        times(bytes, kImportBytes), 1, faces_ * kImportCornersTime, bytes);
    add("mesh-tiles", buckets,
        {import_tiles_task_bytes(in_bucket, faces, repair_bytes(faces)), kImportTilesFinishBytes,
         kImportTilesFinishBytes},
        times(bytes, kImportBytes), 2 * buckets, faces_ * kImportTilesTime, bytes);
    add("mesh-repair", 0,
        {import_repair_task_bytes(surface_block_bytes(ImportPlan::kBrickVertices * 4)), kIdleBytes, 0}, 0, 0,
        0.0, 0.0);
  }

  void smooth() {
    const std::uint64_t disk = times(faces_, kPatchBytes);
    const double faces = faces_ * kFacesMargin * kFacesMargin;
    const MeshSize mesh = {times(faces, kVerticesPerFace), times(faces, 1.0)};
    for (const StageNeed& need :
         smooth_before_needs(options_.smooth, mesh, times(largest_.faces, kFacesMargin * kVerticesPerFace))) {
      const bool moves = need.stage.starts_with("smooth-"), fits = need.stage == "smooth-1";
      add(need.stage, groups_.size(), Memory{need.likely, 0, kTileSlackBytes}, moves ? disk : 0,
          groups_.size(),
          faces_ * (fits    ? kFitTime
                    : moves ? kFilterTime
                            : kRangeTime),
          (moves ? 2.0 : 1.0) * static_cast<double>(disk));
    }
  }

  void decimate(std::uint64_t patches) {
    const SimplifyOptions simplify = reconstruct_simplify_options(options_);
    const std::uint64_t faces = times(faces_, kFacesMargin), largest = largest_.faces;
    const std::uint64_t disk = times(faces_, kPassBytes), blocks = groups_.size() / 2 + 1;
    const std::uint64_t patch_bytes = surface_block_bytes(largest);
    if (options_.reference == "points")
      add_samples("points",
                  std::min(faces, kImportedNear * std::max(largest, 2 * ImportPlan::kBrickVertices)));
    for (int pass = fuses_first_pass(options_) ? 1 : 0; pass < simplify.passes; ++pass) {
      add(SimplifyPass{pass, 0, false}.stage_name(), blocks,
          {simplify_pass_bytes(simplify, pass, faces, largest, 1), std::uint64_t{2} << 20,
           simplify_task_bytes(0, 0, 0, 0)},
          disk, blocks,
          faces_ * (pass == 0   ? kFirstPassTime
                    : pass == 1 ? kPass2Time
                                : kPass3Time),
          (pass < 2 ? 0.5 : 0.2) * static_cast<double>(patches));
    }
    const std::uint64_t both = faces + faces / 4;  // with those of the result
    const std::uint64_t cell = certify_cell_bytes(both, largest, 1);
    add("certify", groups_.size(),
        {certify_task_bytes(cell), certify_finish_bytes(cell, groups_.size()), certify_task_bytes(0)}, 0,
        groups_.size(), faces_ * kCertifyTime, static_cast<double>(patches));
    const Memory write = {0, write_mesh_store_bytes(patch_bytes, patches_.entries.size(), sort_bytes(run_)),
                          write_mesh_store_bytes(0, 0, sort_bytes(run_))};
    if (options_.reference == "points")
      add_samples("samples", std::min<std::uint64_t>(faces / 10, 2 * largest));
    if (options_.keep_raw) add_write("keep-raw", write, patches);
    add_write("write", write, patches);
  }

  /// \param near  faces near one brick
  void add_samples(const char* stage, std::uint64_t near) {
    add(stage, plan_.buckets.size(),
        {samples_task_bytes(largest_brick_, surface_block_bytes(near), near), 0,
         samples_task_bytes(largest_brick_, 0, 0)},
        0, 0, points_ * kSamplesTime, static_cast<double>(store_bytes_));
  }
  void add_write(const char* stage, const Memory& memory, std::uint64_t patches) {
    add(stage, 0, memory, forecast_.output_bytes, 1, faces_ * kWriteTime,
        static_cast<double>(patches + forecast_.output_bytes));
  }
  Memory patch_write() const {
    return {0, write_bytes(patches_.entries, filling_bytes()), write_bytes({}, filling_bytes())};
  }
  template <class Use>
  void for_each_tile(const Use& use) const {
    for (const TileGroup& group : groups_)
      for (const Tile& tile : group) use(tile);
  }
  std::uint64_t filling_bytes() const { return hole_limit(options_, plan_, true).filling_bytes(); }

  const Plan& plan_;
  const RunOptions& run_;
  const ReconstructOptions options_;
  const NormalsMode mode_;
  const InputTasks inputs_;
  const std::vector<PlanBrick>& plan_bricks_;
  const std::vector<BrickEntry> bricks_;
  const double points_, faces_;
  const std::uint64_t run_bytes_, store_bytes_, overlay_bytes_;
  bool closes_ = false;
  int halo_ = 0;
  std::vector<TileGroup> groups_;
  PlannedPatches patches_;
  std::uint64_t largest_brick_ = 0, max_blocks_ = 0, blocks_ = 0, top_bytes_ = 0;
  PatchEntry largest_;  ///< patch
  ForecastList list_{run_.threads};
  Forecast forecast_;
};

}  // namespace

Forecast forecast_job(const Plan& plan, const std::vector<PlanBrick>& bricks, const InputTasks& inputs,
                      const JobState& job) {
  return Composer(plan, bricks, inputs, job).compose();
}

}  // namespace tessera
