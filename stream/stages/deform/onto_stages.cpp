#include "stream/stages/deform/onto_stages.h"

#include "kernels/edit/plane_cells.h"
#include "kernels/edit/scan_fit.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/runtime/report.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/vertex_batches.h"
#include "stream/survey/measured_points.h"

namespace tessera {
namespace {

constexpr double kDistancePerDiagonal = 0.1;
constexpr std::uint64_t kOntoSlackBytes = std::uint64_t{16} << 20;
constexpr std::uint64_t kUntoldVertices = std::uint64_t{1} << 32;  ///< headers of text tell none

}  // namespace

std::vector<StageEntry> onto_stages(const DeformOptions& options) {
  std::vector<StageEntry> stages = import_stages({0, kDeformImport});
  stages.push_back({"scan-cells", [=](const JobState& s) { return make_scan_cells_stage(s, options); }});
  stages.push_back({"onto-fit", [=](const JobState& s) { return make_onto_fit_stage(s, options); }});
  stages.push_back({"write", [=](const JobState& s) { return make_onto_write_stage(s, options); }});
  stages.push_back({"deviation", [=](const JobState& s) { return make_onto_deviation_stage(s, options); }});
  return stages;
}

double onto_distance(const DeformOptions& options, double diagonal) {
  return options.max_distance > 0.0 ? options.max_distance : kDistancePerDiagonal * diagonal;
}

std::uint64_t scan_cells_bytes() {
  return PlaneCells::kBytes + 3 * kSliceMemory + kOntoSlackBytes;
}

std::uint64_t onto_fit_bytes(std::uint64_t cells, std::uint64_t fullest) {
  return scan_fit_bytes(cells) + fullest + kOntoSlackBytes;
}

std::uint64_t onto_write_bytes(const JobState& state) {
  return kMaxFitNodes * sizeof(Double3) * 2 + sort_bytes(state.run) +
         vertex_window(state.run) * kDisplacedVertices * DisplacedBatch::kVertexBytes + kOntoSlackBytes +
         rounding_check_bytes(state.output, true, kUntoldVertices);
}

std::uint64_t onto_deviation_bytes(const RunOptions& run) {
  return run.memory_bytes / 4 + kOntoSlackBytes;
}

std::vector<StageNeed> onto_needs(const JobState& state) {
  std::vector<StageNeed> needs =
      import_needs(state.run, {0, kDeformImport}, claimed_mesh_size(state.inputs.at(0)));
  needs.push_back({"scan-cells", scan_cells_bytes(), 0});
  needs.push_back({"onto-fit", onto_fit_bytes(0, 0), onto_fit_bytes(PlaneCells::kMaxCells, 0)});
  needs.push_back({"write", onto_write_bytes(state), 0});
  needs.push_back({"deviation", onto_deviation_bytes(state.run), 0});
  return needs;
}

void summarise_onto(Json& report) {
  report["mesh"] = result_of(report, "write");
  const Json fit = result_of(report, "onto-fit");
  if (!fit.is_object()) return;
  report["input"] = import_report(report, kDeformImport);
  report["onto"] = {{"scan", result_of(report, "scan-cells")}, {"fit", fit}};
  for (const char* part : {"scan", "fit"}) report["onto"][part].erase("warnings");
  const Json deviation = result_of(report, "deviation");
  if (!deviation.is_object()) return;
  report["onto"]["before"] = deviation.at("before");
  report["onto"]["after"] = deviation.at("after");
}

}  // namespace tessera
