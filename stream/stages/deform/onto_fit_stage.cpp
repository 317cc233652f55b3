#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kernels/edit/scan_fit.h"
#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/onto_files.h"
#include "stream/stages/deform/onto_stages.h"
#include "stream/survey/point_distances.h"

namespace tessera {
namespace {

constexpr double kToldShare = 0.2;                             ///< of cells that do not lie on the result
constexpr std::uint64_t kFeetBytes = std::uint64_t{32} << 20;  ///< of points on their way to their cells

class OntoFitStage : public SerialStage {
 public:
  OntoFitStage(const JobState& state, const DeformOptions& options)
      : options_(options),
        work_(state.work),
        run_(state.run),
        store_(open_imported_mesh(state.work, kDeformImport)),
        scan_(load_scan_cells(state.work / kScanCellsFile)) {}
  std::string name() const override { return "onto-fit"; }
  std::uint64_t units() const override { return scan_.cells.size(); }
  std::string unit_name() const override { return "cells"; }
  std::uint64_t finish_bytes() const override {
    const PointFeet feet(store_, onto_distance(options_, store_.diagonal()), work_, kFeetBytes);
    return onto_fit_bytes(scan_.cells.size(), feet.fullest_bytes() + kFeetBytes);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    WorkerPool pool(run_.threads);
    ScanFitOptions o;
    o.order = static_cast<int>(options_.order);
    o.wavelength = options_.wavelength;
    o.max_distance = onto_distance(options_, store_.diagonal());
    o.cell_edge = scan_.edge;
    o.low = store_.box().low, o.high = store_.box().high;
    o.check_stop = [&] { context.check_stop(); };
    ScanFitReport report;
    const DisplacementLattice lattice = fit_scan(
        scan_.cells,
        [&](std::span<const Double3> points, double reach) { return find_feet(points, reach, pool); }, o,
        report);
    context.count_written(save_lattice(context.create(kLatticeFile), lattice));
    context.advance(scan_.cells.size());
    Json scales = Json::array();
    for (const ScanFitScale& s : report.scales)
      scales.push_back({{"wavelength", s.wavelength},
                        {"held_out_rms_before", s.held_before},
                        {"held_out_rms_after", s.held_after},
                        {"kept", s.kept}});
    Json result = {{"order", o.order},
                   {"scales", scales},
                   {"wavelength", report.wavelength},
                   {"bound", report.bound},
                   {"cells",
                    {{"matched", report.matched},
                     {"far", report.far},
                     {"normals_disagree", report.disagreeing},
                     {"border", report.border}}},
                   {"cells_rms", report.rms},
                   {"nodes", lattice.node_count()}};
    const double off = 1.0 - static_cast<double>(report.matched) / static_cast<double>(scan_.cells.size());
    if (off > kToldShare)
      result["warnings"].push_back(
          fmt::format("{:.0f} % of the planar places of the scan within {:g} of the mesh do not lie on the "
                      "result: they are something else, or the mesh is not what was scanned there",
                      100.0 * off, o.max_distance));
    return result;
  }

 private:
  std::vector<SurfaceFoot> find_feet(std::span<const Double3> points, double reach, WorkerPool& pool) const {
    PointFeet search(store_, reach, work_, kFeetBytes);
    for (const Double3& p : points) search.add(p);
    MemoryBudget budget(run_.memory_bytes, resident_bytes());
    search.measure(pool, budget);
    std::vector<SurfaceFoot> feet;
    feet.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const PointFoot foot = search.next();
      feet.push_back({std::isfinite(foot.distance), foot.border, foot.at, foot.normal});
    }
    return feet;
  }

  DeformOptions options_;
  std::filesystem::path work_;
  RunOptions run_;
  MeshStore store_;
  ScanCells scan_;
};

}  // namespace

std::unique_ptr<Stage> make_onto_fit_stage(const JobState& state, const DeformOptions& options) {
  return std::make_unique<OntoFitStage>(state, options);
}

}  // namespace tessera
