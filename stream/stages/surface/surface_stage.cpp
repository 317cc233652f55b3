#include "stream/stages/surface/surface_stage.h"

#include <algorithm>
#include <array>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/field/field.h"
#include "kernels/mesh/patch_components.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/meshes/patch_store.h"
#include "stream/points/multipole_store.h"
#include "stream/points/plan.h"
#include "stream/points/point_overlay.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/closing_stages.h"
#include "stream/stages/surface/dense_bricks.h"
#include "stream/stages/surface/first_pass.h"

namespace tessera {
namespace {

constexpr std::uint64_t kFixedTaskBytes = 12u << 20;  ///< write buffers and the largest single patch

/// Most faces in an aligned cube of so many bricks that meets the tile.
std::uint64_t max_faces(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                        const Tile& tile, int halo_cells, int edge) {
  Int3 first, end;
  for (std::size_t a = 0; a < 3; ++a)
    first[a] = tile.brick[a] / edge * edge, end[a] = tile.brick[a] + tile.bricks;
  std::uint64_t maximum = 0;
  for (int z = first[2]; z < end[2]; z += edge)
    for (int y = first[1]; y < end[1]; y += edge)
      for (int x = first[0]; x < end[0]; x += edge)
        maximum = std::max(maximum, tile_faces(bricks, closing, {{x, y, z}, edge}, halo_cells));
  return maximum;
}

class SurfaceStage : public Stage {
 public:
  explicit SurfaceStage(const JobState& state)
      : plan_(Plan::of_work(state.work)), store_(PointStore::of_surface(state.work)) {
    const ReconstructOptions options = reconstruct_options(state);
    field_ = field_options(plan_, options.feature_angle_deg);
    field_.firm_boundary = HolesMode(options.holes).close;
    field_.bodies = store_.has_bodies();
    const auto files = closing_files(state.work);
    if (!files.empty()) {
      closing_ = std::make_unique<BrickSectionStore>(files);
      multipoles_ = std::make_unique<MultipoleStore>(state.work);
      closing_options_ = load_closing_options(state.work);
    }
    TilingOptions tiling = surface_tiling(state, field_);
    tiling.closing = closing_.get();
    bytes_limit_ = tiling.tile_bytes_limit;
    groups_ = make_tile_groups(store_.bricks(), tiling);
    state_ = state;
    fused_ = options.fuses_stores(plan_);
    extract_ = extract_options(options, fused_);
  }

  std::string name() const override { return "surface"; }
  std::size_t task_count() const override { return groups_.size(); }
  std::uint64_t units() const override { return store_.point_count(); }
  std::string unit_name() const override { return "points"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (const Tile& tile : groups_[task]) {
      const std::uint64_t near = multipoles_ ? multipoles_->near_bytes(tile.corner(), tile.edges()) : 0;
      maximum = std::max(maximum, cut(tile).bytes + surface_extra_bytes(store_.bricks(), closing_.get(), tile,
                                                                        halo(), fused_, near));
    }
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    std::unique_ptr<PatchFileWriter> writer;
    std::unique_ptr<FirstPass> pass;
    if (fused_)
      pass = std::make_unique<FirstPass>(state_, context, task);
    else
      writer = std::make_unique<PatchFileWriter>(context.create("mesh/" + task_file_stem(task) + ".tsm"));
    std::uint64_t patches = 0;
    std::uint64_t vertices = 0;
    std::uint64_t faces = 0;
    std::uint64_t synthetic = 0;
    ExtractReport total;
    FieldOptions options = field_;
    options.pause = [&context] { context.check_stop(); };
    for (const Tile& tile : groups_[task]) store_.prefetch(tile.corner(), tile.edges(), halo());
    for (const Tile& tile : groups_[task]) {
      context.check_stop();
      DirectedField field;
      std::uint64_t own_points = 0;
      if (const TileCut parts = cut(tile); parts.edge > 0) {
        field = field_in_parts(store_, tile, parts.edge, options, own_points, context);
        if (field.leaves.empty()) continue;
      } else {
        const std::vector<ClosingLeaf> closing =
            closing_ ? closing_->cells_around(tile.corner(), tile.edges()) : std::vector<ClosingLeaf>{};
        const PointBlock points =
            store_.load(tile.corner(), tile.edges(), closing.empty() ? halo() : closing_halo());
        if (points.size() == 0 && closing.empty()) continue;
        own_points = core_points(points);
        field = evaluate_field(points, options);
        context.count_read(points.size() * sizeof(PointRecord));
        if (!closing.empty()) {
          const MultipoleTree near = multipoles_->near(points);
          add_closing(field, closing,
                      ClosingField(multipoles_->far(), near, static_cast<float>(plan_.radius_cells),
                                   static_cast<float>(plan_.noise_cells)),
                      closing_options_);
        }
      }
      const ExtractReport report = extract_surface(field, extract_, [&](Patch&& patch) {
        ++patches;
        vertices += patch.position.size();
        faces += patch.faces.size();
        for (const std::uint8_t flag : patch.synthetic) synthetic += flag;
        if (pass)
          pass->add(patch);
        else
          writer->add(patch, find_components(patch));
      });
      total.loops += report.loops;
      total.crease_samples += report.crease_samples;
      total.corner_samples += report.corner_samples;
      total.flips += report.flips;
      total.rejected_samples += report.rejected_samples;
      context.advance(own_points);
    }
    Json summary = {{"patches", patches},
                    {"vertices", vertices},
                    {"faces", faces},
                    {"synthetic_faces", synthetic},
                    {"loops", total.loops},
                    {"crease_samples", total.crease_samples},
                    {"corner_samples", total.corner_samples},
                    {"flips", total.flips},
                    {"rejected_samples", total.rejected_samples}};
    if (writer) context.count_written(writer->finish());
    if (pass) summary["first_pass"] = pass->finish();
    return summary;
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    Json sum = {{"tiles", 0}, {"h", plan_.lattice.h}, {"radius_cells", plan_.radius_cells}};
    for (const TileGroup& group : groups_) sum["tiles"] = sum["tiles"].get<std::uint64_t>() + group.size();
    return sum_counts(summaries, std::move(sum));
  }

 private:
  int halo() const { return field_halo_cells(field_); }

  /// Whole leaves, so that each has all its dipoles.
  int closing_halo() const {
    return std::max(MultipoleStore::kHaloCells, (halo() + kLeafCells - 1) / kLeafCells * kLeafCells);
  }

  TileCut cut(const Tile& tile) const {
    return cut_tile(store_, closing_.get(), tile, closing_ ? closing_halo() : halo(), bytes_limit_);
  }

  JobState state_;
  std::uint64_t bytes_limit_ = 0;  ///< of a tile
  bool fused_ = false;             ///< the first pass of decimation runs here
  Plan plan_;
  PointStore store_;
  FieldOptions field_;
  ExtractOptions extract_;
  std::unique_ptr<BrickSectionStore> closing_;  ///< null in an open job
  std::unique_ptr<MultipoleStore> multipoles_;
  ClosingOptions closing_options_;
  std::vector<TileGroup> groups_;
};

}  // namespace

std::uint64_t surface_extra_bytes(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                                  const Tile& tile, int halo_cells, bool fused, std::uint64_t near_bytes) {
  std::uint64_t pass = 0;
  if (fused)
    pass = FirstPass::bytes(max_faces(bricks, closing, tile, halo_cells, kFirstPassEdge),
                            max_faces(bricks, closing, tile, halo_cells, 1));
  return near_bytes + pass + kFixedTaskBytes;
}

std::uint64_t core_points(const PointBlock& p) {
  std::uint64_t n = 0;
  const auto inside = [](float v, int cells) { return v >= 0.0f && v < static_cast<float>(cells); };
  for (std::size_t i = 0; i < p.size(); ++i)
    n += inside(p.x[i], p.cells[0]) && inside(p.y[i], p.cells[1]) && inside(p.z[i], p.cells[2]);
  return n;
}

TilingOptions surface_tiling(const JobState& state, const FieldOptions& field) {
  TilingOptions tiling;
  tiling.halo_cells = field_halo_cells(field);
  // Four bricks an edge keep the recomputed shell small; more gain nothing.
  tiling.tile_bricks = state.run.tile_cells > 0 ? std::max(1, state.run.tile_cells / kBrickCells) : 4;
  tiling.tile_bytes_limit = tile_bytes_limit(state.run);
  return tiling;
}

std::uint64_t tile_bytes_limit(const RunOptions& run) {
  return run.memory_bytes / 2 / static_cast<std::uint64_t>(run.threads);
}

FieldOptions field_options(const Plan& plan, double feature_angle_deg) {
  FieldOptions options;
  options.radius_cells = plan.radius_cells;
  options.noise_cells = plan.noise_cells;
  options.feature_angle_deg = feature_angle_deg;
  return options;
}

ExtractOptions extract_options(const ReconstructOptions& options, bool names) {
  ExtractOptions extract;
  extract.method =
      options.method == "mc" ? ExtractMethod::kMarchingCubes : ExtractMethod::kExtendedMarchingCubes;
  extract.feature_angle_deg = options.feature_angle_deg;
  extract.corner_angle_deg = options.corner_angle_deg;
  extract.names = names;
  return extract;
}

void for_each_band(const std::filesystem::path& work, double feature_angle_deg,
                   const std::function<void(DirectedField&&)>& sink) {
  FieldOptions options = field_options(Plan::of_work(work), feature_angle_deg);
  const PointStore store = PointStore::of_surface(work);
  options.bodies = store.has_bodies();
  const int halo = field_halo_cells(options);
  const TilingOptions tiling{halo, 2, nullptr, ~std::uint64_t{0}};
  for (const TileGroup& group : make_tile_groups(store.bricks(), tiling))
    for (const Tile& tile : group) {
      const PointBlock points = store.load(tile.corner(), tile.edges(), halo);
      if (points.size() > 0) sink(evaluate_field(points, options));
    }
}

std::unique_ptr<Stage> make_surface_stage(const JobState& state) {
  return std::make_unique<SurfaceStage>(state);
}

double surface_face_time(const PlannedScan& scan) {
  struct Measured {
    double noise, time;
  };
  // From field scans of six kinds, and without noise from simulated ones.
  constexpr std::array<Measured, 6> kMeasured = {
      {{0.0, 0.42}, {0.05, 1.5}, {0.1, 2.4}, {0.17, 2.7}, {0.4, 1.4}, {0.6, 0.75}}};
  const double noise = scan.columns && !scan.is_room() ? scan.plan.noise_cells
                                                       : std::min(scan.plan.noise_cells, kMeasured[3].noise);
  const double share = scan.is_room() ? 0.7 : 1.0;  // walls seen from near; one field scan
  for (std::size_t i = 1; i < kMeasured.size(); ++i) {
    const auto &a = kMeasured[i - 1], &b = kMeasured[i];
    if (noise < b.noise)
      return share * (a.time + (b.time - a.time) * (noise - a.noise) / (b.noise - a.noise));
  }
  return share * kMeasured.back().time;
}

StageForecast forecast_surface(const PlannedScan& scan) {
  const BrickSectionStore no_cells({});
  const std::uint64_t limit = tile_bytes_limit(scan.run);
  struct Needs {
    std::uint64_t all = 0, open = 0;
  };
  std::vector<Needs> of_groups(scan.groups.size());
  parallel_for(of_groups.size(), [&](std::size_t k) {
    for (const Tile& t : scan.groups[k]) {
      const std::uint64_t near =
          scan.closes ? MultipoleStore::near_bytes(scan.bricks, t.corner(), t.edges()) : 0;
      const BrickSectionStore* closing = scan.closes ? &no_cells : nullptr;
      const std::uint64_t bytes =
          expected_tile_bytes(scan.bricks, closing, t, scan.halo, limit) +
          surface_extra_bytes(scan.bricks, closing, t, scan.halo, scan.fuses_stores, 0);
      of_groups[k] = {std::max(of_groups[k].all, bytes + near), std::max(of_groups[k].open, bytes)};
    }
  });
  Needs most;
  for (const Needs& needs : of_groups)
    most = {std::max(most.all, needs.all), std::max(most.open, needs.open)};
  const double time = surface_face_time(scan) + (scan.fuses_stores ? kFirstPassFaceTime : 0.0);
  return {.tasks = scan.groups.size(),
          .task_bytes = most.all,
          .sure_bytes = most.open,
          .disk_bytes = scan.surface_bytes,
          .files = scan.groups.size(),
          .processor_us = scan.faces * time,
          .moved_bytes = static_cast<double>(scan.store_bytes + scan.overlay_bytes + scan.surface_bytes)};
}

}  // namespace tessera
