#include "stream/stages/tiles/colour_stage.h"

#include <algorithm>
#include <utility>

#include "kernels/decimate/mean_colours.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/meshes/mesh_blocking.h"
#include "stream/stages/decimate/simplify_needs.h"

namespace tessera {
namespace {

constexpr std::uint64_t kColourBlockFaces = 1u << 14;  ///< with four times as many of the level below
constexpr std::uint64_t kColourTaskFaces = 1u << 17;   ///< a task is worth a file from here

/// \param coarse_bytes, below_bytes  MeshStore::block_bytes of a block and of what lies below it
std::uint64_t colour_task_bytes(std::uint64_t coarse_bytes, std::uint64_t below_bytes) {
  return 2 * (2 * coarse_bytes + below_bytes) + (std::uint64_t{4} << 20);
}

class ColourStage : public Stage {
 public:
  ColourStage(MeshStore decimated, MeshStore below, double radius)
      : coarse_(std::move(decimated)), below_(std::move(below)), radius_(radius) {
    blocks_ = make_blocks(coarse_, {kColourBlockFaces});
    first_ = tasks_by_faces(blocks_, kColourTaskFaces);
  }

  std::string name() const override { return "colours"; }
  std::size_t task_count() const override { return first_.size() - 1; }
  std::uint64_t units() const override { return coarse_.face_count(); }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t b = first_[task]; b < first_[task + 1]; ++b) {
      // Faces at the block reach no farther than the boxes of the patches that they lie in.
      const MeshBox star = coarse_.box_of(coarse_.select(coarse_.box_of(blocks_[b].patches)));
      maximum =
          std::max(maximum, colour_task_bytes(coarse_.block_bytes(coarse_.select(grown(star, 2.0 * radius_))),
                                              below_.block_bytes(below_.select(grown(star, radius_)))));
    }
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter writer(context.create(kColourFolder + task_file_stem(task) + ".tmm"), coarse_.info());
    for (std::size_t b = first_[task]; b < first_[task + 1]; ++b) {
      context.check_stop();
      const MeshBlockCut& cut = blocks_[b];
      const MeshBox star = box_of_stars(cut);
      const MeshBlock near = coarse_.load_box(grown(star, 2.0 * radius_));
      const std::vector<std::uint32_t> rgba =
          mean_colours(near, below_.load_box(grown(star, radius_)), radius_);
      for (const std::size_t p : cut.patches) {
        MeshBlock patch = coarse_.load(std::array{p});
        for (std::size_t v = 0; v < patch.key.size(); ++v) {
          const auto at = std::lower_bound(near.key.begin(), near.key.end(), patch.key[v]);
          patch.rgba[v] = rgba[static_cast<std::size_t>(at - near.key.begin())];
        }
        writer.add(coarse_.patches()[p].key, patch);
      }
      context.count_read(coarse_.block_bytes(cut.patches));
      context.advance(cut.faces);
    }
    context.count_written(writer.finish());
    return Json::object();
  }

  std::uint64_t finish_bytes() const override { return 0; }
  Json finish(const std::vector<Json>& tasks, TaskContext&) const override {
    return {{"tasks", tasks.size()}};
  }

 private:
  /// Of all faces with a corner in the block.
  MeshBox box_of_stars(const MeshBlockCut& cut) const {
    const MeshBox core = coarse_.box_of(cut.patches);
    MeshBox box = core;
    const MeshBlock touching = coarse_.load_box(core);
    const auto inside = [&](const Double3& p) { return overlap({p, p}, core); };
    for (const auto& f : touching.faces) {
      if (std::none_of(f.begin(), f.end(), [&](std::uint32_t v) { return inside(touching.position[v]); }))
        continue;
      for (const std::uint32_t v : f)
        for (std::size_t k = 0; k < 3; ++k) {
          box.low[k] = std::min(box.low[k], touching.position[v][k]);
          box.high[k] = std::max(box.high[k], touching.position[v][k]);
        }
    }
    return box;
  }

  MeshStore coarse_, below_;
  double radius_;
  std::vector<MeshBlockCut> blocks_;
  std::vector<std::size_t> first_;  ///< block per task, one more at the end
};

}  // namespace

std::uint64_t level_colour_bytes(std::uint64_t faces, std::uint64_t around) {
  const std::uint64_t coarse = std::min(faces / 4, around * kColourBlockFaces);
  return colour_task_bytes(surface_block_bytes(coarse), surface_block_bytes(4 * coarse));
}

std::unique_ptr<Stage> make_level_colour_stage(MeshStore decimated, MeshStore below, double radius) {
  return std::make_unique<ColourStage>(std::move(decimated), std::move(below), radius);
}

}  // namespace tessera
