#include <algorithm>
#include <bit>
#include <map>

#include "octree/error.h"
#include "stream/check/mesh_compare.h"
#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/resample/resample_stages.h"

namespace tessera {
namespace {

constexpr std::size_t kScaleTaskPatches = 64;
constexpr double kDefaultTolerance = 1e-3;  ///< of the diagonal

/// Eight classes to a factor of two.
std::uint32_t length_class(double length) {
  return std::bit_cast<std::uint32_t>(static_cast<float>(length)) >> 20;
}
double length_of_class(std::uint32_t c) {
  return static_cast<double>(std::bit_cast<float>((c << 20) + (1u << 19)));
}

constexpr std::uint64_t kFinishBytes = std::uint64_t{8} << 20;

std::uint64_t resample_scale_task_bytes(std::uint64_t patch_bytes) {
  return 2 * patch_bytes + (std::uint64_t{1} << 20);
}

class ResampleScaleStage : public Stage {
 public:
  ResampleScaleStage(const JobState& state, const ResampleOptions& options)
      : store_(open_imported_mesh(state.work, kResampleImport)),
        options_(options),
        output_(state.output),
        placement_(store_placement(state.output, store_, options.tolerance)) {
    if (!options_.edits()) tolerance_before_rounding(output_, options_.tolerance, placement_);
    if (options_.tolerance > 0.0) require_provable(store_, options_.tolerance);
    if (options_.tolerance > 0.0 && !(options_.tolerance < store_.diagonal()))
      throw UsageError("--tolerance " + number_text(options_.tolerance) +
                       " is more than the whole mesh, which is " + number_text(store_.diagonal()) +
                       " wide: give less");
  }
  std::string name() const override { return "scale"; }
  std::size_t task_count() const override {
    return (store_.patches().size() + kScaleTaskPatches - 1) / kScaleTaskPatches;
  }
  std::uint64_t task_bytes(std::size_t) const override {
    return resample_scale_task_bytes(store_.largest_patch_bytes());
  }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }

  Json run(std::size_t task, TaskContext& context) const override {
    std::map<std::uint32_t, std::uint64_t> count;
    const std::size_t end = std::min(store_.patches().size(), (task + 1) * kScaleTaskPatches);
    for (std::size_t p = task * kScaleTaskPatches; p < end; ++p) {
      context.check_stop();
      const MeshBlock block = store_.load({&p, 1});
      for (const auto& f : block.faces)
        for (std::size_t k = 0; k < 3; ++k)
          ++count[length_class(norm(block.position[f[(k + 1) % 3]] - block.position[f[k]]))];
      context.advance(block.faces.size());
    }
    Json out = Json::array();
    for (const auto& [c, n] : count) out.push_back({c, n});
    return {{"lengths", out}};
  }

  std::uint64_t finish_bytes() const override { return kFinishBytes; }
  Json finish(const std::vector<Json>& tasks, TaskContext& context) const override {
    std::map<std::uint32_t, std::uint64_t> count;
    std::uint64_t all = 0, below = 0;
    for (const Json& task : tasks)
      for (const Json& bin : task.at("lengths")) {
        count[bin[0].get<std::uint32_t>()] += bin[1].get<std::uint64_t>();
        all += bin[1].get<std::uint64_t>();
      }
    if (all == 0) throw EmptyError("the mesh has no face: there is nothing to resample");
    MeshScale scale;
    for (const auto& [c, n] : count) {
      below += n;
      if (2 * below < all) continue;
      scale.edge = length_of_class(c);
      break;
    }
    scale.tolerance = options_.tolerance > 0.0 ? options_.tolerance : kDefaultTolerance * store_.diagonal();
    if (!options_.edits()) scale.tolerance = tolerance_before_rounding(output_, scale.tolerance, placement_);
    if (!(scale.edge > 0.0))
      throw EmptyError("most edges of the mesh have no length: there is nothing to resample");
    scale.save(context.create(MeshScale::kFile));
    return {{"edge", scale.edge}, {"tolerance", scale.tolerance}, {"diagonal", store_.diagonal()}};
  }

 private:
  MeshStore store_;
  ResampleOptions options_;
  std::filesystem::path output_;
  MeshPlacement placement_;
};

}  // namespace

std::uint64_t resample_scale_bytes(std::uint64_t patch_bytes) {
  return std::max(resample_scale_task_bytes(patch_bytes), kFinishBytes);
}

std::unique_ptr<Stage> make_resample_scale_stage(const JobState& state, const ResampleOptions& options) {
  return std::make_unique<ResampleScaleStage>(state, options);
}

}  // namespace tessera
