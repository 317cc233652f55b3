#include <algorithm>

#include <fmt/format.h>

#include "kernels/edit/plane_cells.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/import/crs_sidecar.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/onto_files.h"
#include "stream/stages/deform/onto_stages.h"
#include "stream/survey/measured_points.h"

namespace tessera {
namespace {

constexpr std::size_t kReadAhead = 3;  ///< slices of a scan
constexpr double kCellsPerDiagonal = 1024.0;

class ScanCellsStage : public SerialStage {
 public:
  ScanCellsStage(const JobState& state, const DeformOptions& options)
      : options_(options),
        mesh_(state.inputs.at(0)),
        scan_(state.inputs.at(1)),
        store_(open_imported_mesh(state.work, kDeformImport)),
        points_(open_measured_scans({state.inputs.begin() + 1, state.inputs.end()}, {}, kReadAhead)) {
    if (store_.face_count() == 0) throw EmptyError(mesh_.string() + ": has no faces to bring onto a scan");
    const Crs own = crs_of_wkt(crs_of_mesh(mesh_));
    if (own.known() && points_->crs.known() && !may_be_same(own, points_->crs))
      throw InputError(mesh_.string() + ": is in " + own.name + ", the scan is in " + points_->crs.name +
                       "; give both in one system");
  }
  std::string name() const override { return "scan-cells"; }
  std::uint64_t units() const override { return 1; }
  std::string unit_name() const override { return "passes"; }
  std::uint64_t finish_bytes() const override { return scan_cells_bytes(); }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const double diagonal = store_.diagonal(), reach = onto_distance(options_, diagonal);
    if (!(diagonal > 0.0)) throw InputError(mesh_.string() + ": has no extent");
    if (reach > diagonal)
      throw UsageError(fmt::format("--max-distance {:g}: is more than the diagonal of {}, {:g}", reach,
                                   mesh_.string(), diagonal));
    const MeshBox box = grown(store_.box(), reach);
    PlaneCells cells(box.low, box.high, diagonal / kCellsPerDiagonal);
    const Double3 by = points_->shift - store_.info().shift;
    points_->read([&](const PointChunk& chunk) {
      context.check_stop();
      const bool normals = chunk.nx.size() == chunk.size();
      for (std::size_t i = 0; i < chunk.size(); ++i)
        cells.add(Double3{chunk.x[i], chunk.y[i], chunk.z[i]} + by,
                  normals ? wide(Float3{chunk.nx[i], chunk.ny[i], chunk.nz[i]}) : Double3{});
    });
    PlaneCellReport report;
    ScanCells out;
    out.cells = cells.finish(report);
    out.edge = report.edge;
    context.advance(1);
    if (report.points == 0)
      throw EmptyError(
          fmt::format("{}: no point lies within {:g} of the box of {}: are both in one system? else raise "
                      "--max-distance",
                      scan_.string(), reach, mesh_.string()));
    context.count_written(save_scan_cells(context.create(kScanCellsFile), out));
    Json result = {
        {"points_near", report.points}, {"points_elsewhere", report.outside}, {"left_out", points_->left_out},
        {"cells", report.cells},        {"planar_cells", out.cells.size()},   {"cell_edge", out.edge},
        {"max_distance", reach}};
    if (const std::vector<std::string> notices = points_->notices(); !notices.empty())
      result["warnings"] = notices;
    return result;
  }

 private:
  DeformOptions options_;
  std::filesystem::path mesh_, scan_;
  MeshStore store_;
  std::unique_ptr<MeasuredPoints> points_;
};

}  // namespace

std::unique_ptr<Stage> make_scan_cells_stage(const JobState& state, const DeformOptions& options) {
  return std::make_unique<ScanCellsStage>(state, options);
}

}  // namespace tessera
