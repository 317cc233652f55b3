#include "stream/stages/reconstruct/weld_stages.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

#include "stream/import/import_bytes.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_stages.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/plan/forecast_rates.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/first_pass.h"
#include "stream/stages/surface/output_frame.h"
#include "stream/stages/surface/samples_stage.h"
#include "stream/stages/surface/uncross_holes_stage.h"
#include "stream/stages/surface/write_stage.h"
#include "stream/stages/weld/blunt_stage.h"
#include "stream/stages/weld/border_stage.h"
#include "stream/stages/weld/uncross_stage.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

const std::string kRawMesh = "mesh";  ///< the store that it comes back as

/// Of an import stage of the raw mesh: microseconds a face.
struct ImportRate {
  const char* stage;
  double time;
  bool in_buckets;  ///< of vertices, a task each
};
constexpr ImportRate kImportRates[] = {{"mesh-read", 0.05, false},
                                       {"mesh-vertices", 0.1, true},
                                       {"mesh-corners", 0.1, false},
                                       {"mesh-tiles", 0.4, true}};

StageForecast forecast_raw_import(const PlannedScan& scan, const std::string& stage) {
  if (stage == "mesh-repair") {
    StageForecast repair = idle_forecast();
    repair.task_bytes = import_repair_task_bytes(surface_block_bytes(4 * ImportPlan::kBrickVertices));
    return repair;
  }
  const double faces = scan.faces * rates::kFacesMargin * rates::kFacesMargin;
  const MeshSize mesh = {bytes_of(faces, kVerticesPerFace), bytes_of(faces, 1.0)};
  const std::uint64_t buckets = mesh.vertices / ImportPlan::kBucketVertices + 1;
  const auto sure = import_needs(scan.run, {0, kRawMesh}, {}),
             needs = import_needs(scan.run, {0, kRawMesh}, mesh);
  for (std::size_t i = 0; i < needs.size(); ++i) {
    if (needs[i].stage != stage) continue;
    const ImportRate& rate = kImportRates[i];
    StageForecast told;
    (rate.in_buckets ? told.task_bytes : told.finish_bytes) = std::max(needs[i].sure, needs[i].likely);
    told.tasks = rate.in_buckets ? buckets : 0;
    told.sure_bytes = sure[i].sure;
    told.disk_bytes = scan.output_bytes;  // about as much as the file
    told.files = rate.in_buckets ? 2 * buckets : 1;
    told.processor_us = scan.faces * rate.time;
    told.moved_bytes = static_cast<double>(scan.output_bytes);
    return told;
  }
  return idle_forecast();
}

/// The raw mesh comes back as a store.
std::vector<StageEntry> raw_import_stages() {
  std::vector<StageEntry> stages = import_stages({0, kRawMesh, kRawMeshFile});
  for (StageEntry& entry : stages)
    entry.forecast = [stage = entry.name](const PlannedScan& scan) {
      return forecast_raw_import(scan, stage);
    };
  return stages;
}

}  // namespace

SimplifyStores welded_stores() {
  return imported_stores(kRawMesh);
}

StageEntry points_stage(const std::function<MeshStore(const JobState&)>& full) {
  return {"points",
          [=](const JobState& state) {
            return make_samples_stage(state, {reconstruct_tolerance(state), full, true});
          },
          [](const PlannedScan& scan) { return forecast_samples(scan, true); }};
}

std::vector<StageEntry> weld_stages(const ReconstructOptions& options) {
  std::vector<StageEntry> stages = {{"weld", make_weld_stage, forecast_weld},
                                    {"border", make_border_stage, forecast_border},
                                    {"blunt", make_blunt_stage, forecast_blunt}};
  const auto append = [&](std::vector<StageEntry> more) {
    std::move(more.begin(), more.end(), std::back_inserter(stages));
  };
  append(uncross_stages(written_by(true)));
  append(hole_stages());
  if (!options.decimates()) return stages;
  append({{"raw", make_raw_write_stage, forecast_write}});
  append(raw_import_stages());
  if (options.reference == "points") append({points_stage(welded_stores().full)});
  return stages;
}

}  // namespace tessera
