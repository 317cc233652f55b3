/// Stage "offset" of solids: what lies between two distances of their surface, tile by tile, from the faces around.

#include "kernels/mesh/patch_components.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/meshes/patch_store.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/solid/distance_tiles.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {
namespace {

constexpr std::uint64_t kPatchBytes = std::uint64_t{512} * 24'000;  ///< a brick while it is extracted

class OffsetStage : public Stage {
 public:
  OffsetStage(const JobState& state, const SolidModel& model)
      : model_(model),
        layer_(model.layer(Plan::of_work(state.work).lattice.h)),
        tiles_(state, layer_.max_distance() + OffsetSampler::kMargin, sampled_field_bytes(1)) {}

  std::string name() const override { return "offset"; }
  std::size_t task_count() const override { return tiles_.groups().size(); }
  std::uint64_t units() const override { return tiles_.cubes(); }
  std::string unit_name() const override { return "cubes"; }
  std::uint64_t task_bytes(std::size_t task) const override { return tiles_.task_bytes(task) + kPatchBytes; }

  Json run(std::size_t task, TaskContext& context) const override {
    PatchFileWriter writer(context.create("mesh/" + task_file_stem(task) + ".tsm"));
    std::uint64_t patches = 0, vertices = 0, faces = 0, roots = 0;
    const auto pause = [&context] { context.check_stop(); };
    for (const std::uint64_t cube : tiles_.groups()[task]) {
      for (const Tile& tile : tiles_.tiles_of(cube)) {
        context.check_stop();
        MeshBlock block = tiles_.load(tile);
        if (block.faces.empty()) continue;
        const OffsetSampler sampler(std::move(block), tile.corner(), tiles_.signs(), layer_);
        const std::vector<Int3> leaves = sampler.leaves(tile.edges());
        if (leaves.empty()) continue;
        const DirectedField field =
            build_sampled_field(tile.corner(), tile.edges(), leaves, sampler, sampler.near(), pause);
        roots += field.roots.size();
        extract_surface(field, model_.extract, [&](Patch&& patch) {
          ++patches;
          vertices += patch.position.size();
          faces += patch.faces.size();
          writer.add(patch, find_components(patch));
        });
      }
      context.advance(1);
    }
    context.count_written(writer.finish());
    return {{"patches", patches}, {"vertices", vertices}, {"faces", faces}, {"roots", roots}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    Json sum = sum_counts(summaries, {{"offset", model_.offset}, {"shell", model_.shell}});
    if (sum.value("roots", std::uint64_t{0}) == 0)
      throw EmptyError("nothing is left: nothing of the solid is thicker than twice the offset of " +
                       number_text(model_.offset));
    return sum;
  }

  std::vector<std::string> obsolete() const override { return {"solid/"}; }

 private:
  SolidModel model_;
  OffsetLayer layer_;
  DistanceTiles tiles_;
};

}  // namespace

std::uint64_t solid_offset_bytes(std::uint64_t near_faces) {
  return DistanceTiles::brick_task_bytes(near_faces, sampled_field_bytes(1)) + kPatchBytes;
}

std::unique_ptr<Stage> make_solid_offset_stage(const JobState& state, const SolidModel& model) {
  return std::make_unique<OffsetStage>(state, model);
}

}  // namespace tessera
