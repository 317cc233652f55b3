#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "kernels/edit/anisotropic_metric.h"
#include "kernels/edit/edit_regions.h"
#include "octree/error.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/deform/deform_files.h"
#include "stream/stages/deform/deform_needs.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/edit_script.h"

namespace tessera {
namespace {

using json = nlohmann::json;

class BasisStage : public Stage {
 public:
  BasisStage(const JobState& state, const DeformOptions& options)
      : input_(state.inputs.at(0)),
        loose_(options.islands == "follow"  ? LoosePieces::kFollow
               : options.islands == "fixed" ? LoosePieces::kFix
                                            : LoosePieces::kRefuse),
        script_(parse_edit(options.edit, "the edit")),
        base_(load_base(state.work / kBaseFile)) {}
  std::string name() const override { return "basis"; }
  std::size_t task_count() const override { return 0; }
  std::uint64_t task_bytes(std::size_t) const override { return 0; }
  std::uint64_t units() const override { return base_.position.size(); }
  std::string unit_name() const override { return "vertices"; }
  json run(std::size_t, TaskContext&) const override { return {}; }
  std::uint64_t finish_bytes() const override { return basis_stage_bytes(base_.position.size(), script_); }

  json finish(const std::vector<json>&, TaskContext& context) const override {
    using Clock = std::chrono::steady_clock;
    const auto seconds = [](Clock::time_point from) {
      return std::chrono::duration<double>(Clock::now() - from).count();
    };
    context.check_stop();
    const auto start = Clock::now();
    DeformBasis out;
    out.base = base_;
    const std::vector<EditRegion> listed = with_vertices(context);
    EditRegions regions = resolve_regions(listed, base_.position, base_.faces, script_.order);
    regions.loose = loose_;
    pose_of(script_, regions.handles);  // a motion of an unknown handle is told before anything is solved
    Laplacian metric = laplacian({base_.position, base_.faces});
    const bool healed = metric.report.degenerate_faces > 0 && !script_.anisotropic;
    if (healed)
      metric = laplacian({base_.position, base_.faces}, {.weights = LaplacianWeights::kIntrinsicDelaunay});
    AnisotropicReport anisotropic;
    if (script_.anisotropic)
      metric = anisotropic_metric({base_.position, base_.faces}, regions.role, script_.order, anisotropic);
    context.check_stop();
    EditBasisReport report;
    out.edit = edit_basis(
        base_.position, metric, regions,
        {.order = script_.order, .memory_bytes = system_bytes(base_.position.size(), script_)}, report);
    context.check_stop();
    Double3 low = base_.position.front(), high = low;
    for (const Double3& p : base_.position)
      for (std::size_t c = 0; c < 3; ++c) low[c] = std::min(low[c], p[c]), high[c] = std::max(high[c], p[c]);
    const BoundaryModelReport& model = report.model;
    json result = {
        {"order", script_.order},
        {"unknowns", model.unknowns},
        {"handles", regions.handles.size()},
        {"solutions", out.edit.width()},
        {"solver", std::to_string(model.unknowns) + " unknowns of order " + std::to_string(script_.order) +
                       (model.symmetric ? ": Cholesky, the system is symmetric"
                                        : ": LU, the smoothness differs along the boundary")},
        {"factor_entries", model.factor.factor_entries},
        {"factor_bytes", model.factor.peak_bytes},
        {"residual", model.residual},
        {"refinements", model.refinements},
        {"energy", report.energy},
        {"loose_pieces", report.loose_pieces},
        {"loose_vertices", report.loose_vertices},
        {"intrinsic_weights", healed},
        {"degenerate_faces", metric.report.degenerate_faces},
        {"negative_weights", metric.report.negative_weights},
        {"base_vertices", base_.position.size()},
        {"base_faces", base_.faces.size()}};
    if (script_.anisotropic)
      result["anisotropic"] = {{"ratio", anisotropic.ratio},
                               {"flipped_faces", anisotropic.flipped},
                               {"mean_quasi_conformal", anisotropic.mean_quasi_conformal}};
    out.about = json{
        {"handles", regions.handles},
        {"volumes", script_.volumes},
        {"keep_volume", script_.keep_volume},
        {"diagonal", norm(high - low)},
        {"basis",
         result}}.dump();
    BasisWriter writer(context.create(kBasisFile), out);
    context.count_written(writer.finish(out.about));
    context.advance(base_.position.size());
    result["prepare_s"] = seconds(start);
    return result;
  }

 private:
  /// Regions with the positions of the vertices that they name.
  std::vector<EditRegion> with_vertices(TaskContext& context) const {
    std::vector<EditRegion> regions = script_.regions;
    struct Named {
      std::uint64_t vertex;
      std::size_t region, place;
      bool operator<(const Named& o) const { return vertex < o.vertex; }
    };
    std::vector<Named> named;
    for (std::size_t r = 0; r < regions.size(); ++r) {
      for (std::size_t k = 0; k < script_.vertices[r].size(); ++k)
        named.push_back({script_.vertices[r][k], r, regions[r].points.size() + k});
      regions[r].points.resize(regions[r].points.size() + script_.vertices[r].size());
    }
    if (named.empty()) return regions;
    std::stable_sort(named.begin(), named.end());
    std::uint64_t first = 0;
    std::size_t at = 0;
    open_mesh_file(input_)->read_vertices(
        [&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
          context.check_stop();
          for (; at < named.size() && named[at].vertex < first + batch.size(); ++at)
            regions[named[at].region].points[named[at].place] = batch[named[at].vertex - first];
          first += batch.size();
        });
    if (at < named.size())
      throw InputError("region " + std::to_string(named[at].region + 1) + " names vertex " +
                       std::to_string(named[at].vertex) + ", but the mesh has " + std::to_string(first) +
                       ": they count from 0");
    return regions;
  }

  std::filesystem::path input_;
  LoosePieces loose_;
  EditScript script_;
  BaseSurface base_;
};

}  // namespace

std::unique_ptr<Stage> make_basis_stage(const JobState& state, const DeformOptions& options) {
  return std::make_unique<BasisStage>(state, options);
}

}  // namespace tessera
