#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>

#include "kernels/edit/anisotropic_metric.h"
#include "kernels/edit/base_volume.h"
#include "kernels/edit/fair_positions.h"
#include "kernels/edit/self_intersections.h"
#include "kernels/edit/thin_faces.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/runtime/long_call.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/deform/deform_files.h"
#include "stream/stages/deform/deform_needs.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/edit_roles.h"
#include "stream/stages/deform/edit_script.h"
#include "stream/stages/deform/pose_base.h"
#include "stream/stages/deform/spilled_factor.h"
#include "stream/stages/deform/vertex_batches.h"

namespace tessera {
namespace {

using BasisClock = std::chrono::steady_clock;

double seconds_since(BasisClock::time_point start) {
  return std::chrono::duration<double>(BasisClock::now() - start).count();
}

/// Operators that the base is solved on.
struct BaseMetric {
  Laplacian operators;
  bool intrinsic = false;  ///< of intrinsic Delaunay edges
  std::optional<AnisotropicReport> anisotropic;
};

BaseMetric intrinsic_metric(const BaseSurface& base) {
  return {
      laplacian({base.position, base.faces}, {.weights = LaplacianWeights::kIntrinsicDelaunay}), true, {}};
}

BaseMetric base_metric(const BaseSurface& base, const EditScript& script,
                       std::span<const std::int32_t> role) {
  BaseMetric metric;
  if (script.anisotropic) {
    metric.anisotropic.emplace();
    metric.operators =
        anisotropic_metric({base.position, base.faces}, role, script.order, *metric.anisotropic);
    return metric;
  }
  metric.operators = laplacian({base.position, base.faces});
  ThinArea thin;
  thin.add(base.position, base.faces);
  if (base.split_edge > 0.0 || metric.operators.report.degenerate_faces > 0 || thin.share() > kMaxThin)
    return intrinsic_metric(base);
  return metric;
}

/// All that is solved for is its own: a signal may leave it behind.
struct BasisProblem {
  BaseSurface base;
  BaseMetric metric;
  EditRegions regions;
  BoundaryModelOptions options;
  bool volumes = false;            ///< the levels of the layer too
  std::filesystem::path temp;      ///< for what of a factor does not fit
  std::uint64_t factor_bytes = 0;  ///< of a factor in memory
};

struct BasisSolution {
  EditBasis edit;
  EditBasisReport report;
  std::vector<LayerLevel> levels;
  double levels_s = 0.0;
  std::uint64_t spilled_bytes = 0;  ///< of the factor
};

/// \param problem  its metric is replaced where the one given is singular
BasisSolution solve_basis(BasisProblem& problem) {
  BasisSolution out;
  const TriangleSpan base{problem.base.position, problem.base.faces};
  // Second derivatives of what is held are a condition, too: not those of triangles that were long.
  if (problem.base.split_edge > 0.0 && problem.options.order == 3 && !problem.metric.anisotropic) {
    SpilledFactor factor(problem.temp, problem.factor_bytes);
    problem.regions.fair = fair_positions(base, problem.metric.operators, problem.base.split_edge, &factor);
  }
  const auto solve = [&] {
    SpilledFactor factor(problem.temp, problem.factor_bytes);
    problem.options.store = &factor;
    out.edit = edit_basis(base, problem.metric.operators, problem.regions, problem.options, out.report);
    out.spilled_bytes = factor.spilled_bytes();
  };
  try {
    solve();
  } catch (const SingularSystem&) {
    // Cotangents of thin faces, squared and cubed, lose a pivot to rounding sooner than those of intrinsic edges.
    if (problem.metric.intrinsic || problem.metric.anisotropic) throw;
    problem.metric = intrinsic_metric(problem.base);
    solve();
  }
  if (!problem.volumes) return out;
  const auto start = BasisClock::now();
  out.levels = layer_levels(problem.base.position, problem.base.faces, support_flags(out.edit.role));
  out.levels_s = seconds_since(start);
  return out;
}

double diagonal_of(std::span<const Double3> position) {
  Double3 low = position.front(), high = low;
  for (const Double3& p : position)
    for (std::size_t c = 0; c < 3; ++c) low[c] = std::min(low[c], p[c]), high[c] = std::max(high[c], p[c]);
  return norm(high - low);
}

/// What the report says of the system.
Json system_json(const BasisProblem& problem, const BasisSolution& solved) {
  const BoundaryModelReport& model = solved.report.model;
  const int order = problem.options.order;
  Json json = {{"order", order},
               {"unknowns", model.unknowns},
               {"handles", problem.regions.handles.size()},
               {"solutions", solved.edit.width()},
               {"solver", std::to_string(model.unknowns) + " unknowns of order " + std::to_string(order) +
                              (model.symmetric ? ": Cholesky, the system is symmetric"
                                               : ": LU, the smoothness differs along the boundary")},
               {"factor_entries", model.factor.factor_entries},
               {"factor_bytes", model.factor.peak_bytes + sizeof(double) * model.factor.factor_entries},
               {"residual", model.residual},
               {"refinements", model.refinements},
               {"energy", solved.report.energy},
               {"loose_pieces", solved.report.loose_pieces},
               {"loose_vertices", solved.report.loose_vertices},
               {"intrinsic_weights", problem.metric.intrinsic},
               {"degenerate_faces", problem.metric.operators.report.degenerate_faces},
               {"negative_weights", problem.metric.operators.report.negative_weights},
               {"base_vertices", problem.base.position.size()},
               {"base_faces", problem.base.faces.size()}};
  if (const auto& map = problem.metric.anisotropic)
    json["anisotropic"] = {{"ratio", map->ratio},
                           {"flipped_faces", map->flipped},
                           {"mean_quasi_conformal", map->mean_quasi_conformal}};
  return json;
}

class BasisStage : public SerialStage {
 public:
  BasisStage(const JobState& state, const DeformOptions& options)
      : input_(state.inputs.at(0)),
        work_(state.work),
        run_(state.run),
        loose_(options.islands == "follow"  ? LoosePieces::kFollow
               : options.islands == "fixed" ? LoosePieces::kFix
                                            : LoosePieces::kRefuse),
        script_(parse_edit(options.edit, "the edit")),
        base_(load_base(state.work / kBaseFile)) {}
  std::string name() const override { return "basis"; }
  std::uint64_t units() const override { return base_.position.size(); }
  std::string unit_name() const override { return "vertices"; }
  std::uint64_t finish_bytes() const override {
    return basis_stage_bytes(base_.position.size(), script_, run_);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    context.check_stop();
    if (script_.keep_volume && !encloses_volume(base_.faces))
      throw InputError(
          "\"keep_volume\" wants a closed surface, but the base has borders: leave it out, or close the "
          "mesh");
    const auto start = BasisClock::now();
    const auto problem = std::make_shared<BasisProblem>();
    const auto solved = std::make_shared<BasisSolution>();
    problem->base = base_;
    problem->regions = base_regions(base_, script_, {input_, vertex_window(run_)}, context);
    problem->regions.loose = loose_;
    pose_of(script_, problem->regions.handles);
    problem->metric = base_metric(base_, script_, problem->regions.role);
    problem->options = {.order = script_.order, .memory_bytes = fronts_bytes(base_.position.size(), script_)};
    problem->volumes = script_.volumes;
    problem->temp = work_;
    problem->factor_bytes = held_factor_bytes(base_.position.size(), script_, run_);
    context.check_stop();
    long_call([problem, solved] { *solved = solve_basis(*problem); });
    const double all_s = seconds_since(start);
    context.check_stop();
    Json result = system_json(*problem, *solved);
    DeformBasis out{std::move(problem->base), std::move(solved->edit), std::move(solved->levels), {}};
    out.about = dump_json(
        Json{{"handles", problem->regions.handles},
             {"volumes", script_.volumes},
             {"keep_volume", script_.keep_volume},
             {"crossing_faces",
              base_.split_edge > 0.0
                  ? base_.given_crossings
                  : self_intersections(base_.position, base_.faces, watched_faces(out)).faces.size()},
             {"diagonal", diagonal_of(base_.position)},
             {"basis", result}});
    BasisWriter writer(context.create(kBasisFile), out);
    context.count_written(writer.finish(out.about));
    context.advance(base_.position.size());
    result["prepare_s"] = all_s - solved->levels_s;
    result["levels_s"] = solved->levels_s;
    result["factor_spilled_bytes"] = solved->spilled_bytes;
    return result;
  }

 private:
  std::filesystem::path input_, work_;
  RunOptions run_;
  LoosePieces loose_;
  EditScript script_;
  BaseSurface base_;
};

}  // namespace

std::unique_ptr<Stage> make_basis_stage(const JobState& state, const DeformOptions& options) {
  return std::make_unique<BasisStage>(state, options);
}

}  // namespace tessera
