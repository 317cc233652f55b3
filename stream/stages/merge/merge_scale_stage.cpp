/// Stage "scale" of a merge: how long edges are, which mesh is better, where the lattice lies.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/patch_runs.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/merge/merge_stages.h"

namespace tessera {
namespace {

constexpr std::uint64_t kScaleTaskFaces = 200'000;
constexpr double kApartEdges = 3.0;   ///< of the coarsest mesh: its own error, and what registration leaves
constexpr double kBeyondEdges = 1.5;  ///< of the coarsest mesh: borders of one place differ by about an edge
constexpr double kFadeEdges = 4.0;
constexpr double kOtherUnits = 1000.0;  ///< diagonals that differ so much: a warning
constexpr double kFarthest = 0x1p62;    ///< of any node from zero: squares of distances must stay floats

class ScaleStage : public Stage {
 public:
  ScaleStage(const JobState& state, const MergeOptions& options) : state_(state), options_(options) {
    for (std::size_t i = 0; i < options.meshes; ++i) {
      const ImportNames names(merge_import(i));
      confidence_.push_back(
          fields_from_json<ImportPlan>(parse_json(read_text(state.work / names.plan()))).confidence);
      stores_.push_back(open_imported_mesh(state.work, merge_import(i)));
      for (const PatchRun& run : patch_runs(stores_.back(), kScaleTaskFaces))
        tasks_.push_back({i, run.first, run.end});
    }
  }

  std::string name() const override { return "scale"; }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override {
    std::uint64_t sum = 0;
    for (const MeshStore& s : stores_) sum += s.face_count();
    return sum;
  }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    return stores_[tasks_[task].rank].largest_patch_bytes() + (std::uint64_t{1} << 20);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const MergeTask& t = tasks_[task];
    double length = 0.0;
    std::uint64_t edges = 0;
    for (std::size_t p = t.first; p < t.end; ++p) {
      context.check_stop();
      const MeshBlock block = stores_[t.rank].load({&p, 1});
      for (const auto& f : block.faces)
        for (std::size_t k = 0; k < 3; ++k)
          length += norm(block.position[f[(k + 1) % 3]] - block.position[f[k]]);
      edges += 3 * block.faces.size();
      context.advance(block.faces.size());
    }
    return {{"length", length}, {"edges", edges}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    std::vector<double> length(stores_.size(), 0.0), count(stores_.size(), 0.0);
    for (std::size_t t = 0; t < tasks_.size(); ++t) {
      length[tasks_[t].rank] += summaries[t].at("length").get<double>();
      count[tasks_[t].rank] += summaries[t].at("edges").get<double>();
    }
    std::vector<double> edge(stores_.size());
    for (std::size_t i = 0; i < edge.size(); ++i) edge[i] = length[i] / count[i];
    const auto [finest, coarsest] = std::minmax_element(edge.begin(), edge.end());
    if (!(*finest > 0.0))
      throw InputError(state_.inputs[static_cast<std::size_t>(finest - edge.begin())].string() +
                       ": all vertices lie at one place: there is no surface to merge");
    MergePlan plan;
    plan.lattice.h = options_.resolution > 0.0 ? options_.resolution : round_up_2_digits(*finest);
    plan.range.apart = options_.distance > 0.0 ? options_.distance : kApartEdges * *coarsest;
    plan.range.beyond = kBeyondEdges * *coarsest;
    plan.order = ranks(edge);
    for (const std::size_t i : plan.order) {
      plan.edge.push_back(edge[i]);
      plan.fade.push_back(options_.blend > 0.0 ? options_.blend
                                               : kFadeEdges * std::max(edge[i], plan.lattice.h));
    }
    join_infos(plan);
    const auto [minimum, maximum] = place_lattice(plan);
    plan.save(context.create(MergePlan::kFile));
    Json meshes = Json::array();
    for (std::size_t r = 0; r < plan.order.size(); ++r) {
      meshes.push_back({{"input", plan.order[r] + 1},
                        {"faces", stores_[plan.order[r]].face_count()},
                        {"edge", plan.edge[r]},
                        {"fade", plan.fade[r]}});
      if (const auto& confidence = confidence_[plan.order[r]]) meshes.back()["confidence"] = *confidence;
    }
    Json out = {
        {"h", plan.lattice.h},
        {"resolution_reason", options_.resolution > 0.0 ? "given" : "the mean edge of the finest mesh"},
        {"distance", plan.range.apart},
        {"ranks", meshes}};
    if (maximum > kOtherUnits * minimum)
      out["warnings"] = {"the meshes are " + number_text(minimum) + " and " + number_text(maximum) +
                         " wide: are they in the same units?"};
    return out;
  }

 private:
  std::vector<std::size_t> ranks(const std::vector<double>& edge) const {
    std::vector<std::size_t> order = read_priority(options_.priority, state_.inputs);
    std::vector<std::size_t> rest;
    for (std::size_t i = 0; i < edge.size(); ++i)
      if (std::find(order.begin(), order.end(), i) == order.end()) rest.push_back(i);
    // A mesh that tells no confidence is neither better nor worse than one that does.
    const bool confident = std::all_of(confidence_.begin(), confidence_.end(),
                                       [](const std::optional<double>& c) { return c.has_value(); });
    std::stable_sort(rest.begin(), rest.end(), [&](std::size_t l, std::size_t r) {
      if (confident && *confidence_[l] != *confidence_[r]) return *confidence_[l] > *confidence_[r];
      return edge[l] < edge[r];
    });
    order.insert(order.end(), rest.begin(), rest.end());
    return order;
  }

  void join_infos(MergePlan& plan) const {
    plan.info.shift = stores_[0].info().shift;
    for (std::size_t i = 0; i < stores_.size(); ++i) {
      const MeshStoreInfo& info = stores_[i].info();
      if (info.shift != plan.info.shift)
        throw InputError(state_.inputs[i].string() + ": its positions are shifted otherwise than those of " +
                         state_.inputs[0].string() + ": write both in one frame first");
      plan.info.double_positions = plan.info.double_positions || info.double_positions;
      plan.info.colour = plan.info.colour || info.colour;
    }
  }

  /// \returns the smallest and the largest diagonal
  std::pair<double, double> place_lattice(MergePlan& plan) const {
    MeshBox box = stores_[0].box();
    double minimum = stores_[0].diagonal(), maximum = minimum;
    for (const MeshStore& s : stores_) {
      for (std::size_t a = 0; a < 3; ++a) {
        box.low[a] = std::min(box.low[a], s.box().low[a]);
        box.high[a] = std::max(box.high[a], s.box().high[a]);
      }
      minimum = std::min(minimum, s.diagonal());
      maximum = std::max(maximum, s.diagonal());
    }
    box = grown(box, plan.range.apart + 4.0 * plan.lattice.h);
    double farthest = 0.0;
    for (std::size_t a = 0; a < 3; ++a)
      farthest = std::max({farthest, std::fabs(box.low[a]), std::fabs(box.high[a])});
    if (!(farthest <= kFarthest))
      throw InputError("the meshes reach " + number_text(farthest) +
                       " from zero: coordinates are too large for a lattice from " + number_text(kFarthest) +
                       " on; scale them first");
    const double brick = plan.lattice.h * kBrickCells;
    for (std::size_t a = 0; a < 3; ++a) {
      const double first = std::floor(box.low[a] / brick) - 1.0, last = std::floor(box.high[a] / brick) + 1.0;
      if (!(std::fabs(first) < 0x1p52) || !((last - first + 1.0) * kBrickCells < double{1 << kMaxCellBits}))
        throw UsageError("--resolution " + number_text(plan.lattice.h) + ": the meshes are " +
                         number_text(norm(box.high - box.low)) +
                         " wide, more than 2^20 cells; the least that can do is " +
                         number_text(round_up_2_digits(norm(box.high - box.low) / 1e6)));
      plan.lattice.origin_brick[a] = static_cast<std::int64_t>(first);
      plan.origin[a] = plan.lattice.world(static_cast<int>(a), 0.0);
    }
    return {minimum, maximum};
  }

  JobState state_;
  MergeOptions options_;
  std::vector<MeshStore> stores_;
  std::vector<std::optional<double>> confidence_;  ///< per input: mean over its vertices
  std::vector<MergeTask> tasks_;                   ///< `rank` is the input here: ranks follow
};

}  // namespace

std::unique_ptr<Stage> make_merge_scale_stage(const JobState& state, const MergeOptions& options) {
  return std::make_unique<ScaleStage>(state, options);
}

}  // namespace tessera
