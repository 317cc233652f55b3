#include "stream/stages/tiles/cluster_stage.h"

#include <algorithm>

#include "kernels/decimate/block_clustering.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/meshes/mesh_blocking.h"
#include "stream/meshes/mesh_store.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/tiles/tile_levels.h"

namespace tessera {
namespace {

constexpr std::uint64_t kClusterBlockFaces = 1u << 16;
constexpr std::uint64_t kClusterTaskFaces = 1u << 18;  ///< a task is worth a file from here

class ClusterStage : public Stage {
 public:
  ClusterStage(const std::filesystem::path& work, int level)
      : below_(open_level(work, level - 1)),
        grid_{below_.box().low, level_tolerance(work, level), level},
        blocks_(make_blocks(below_, {kClusterBlockFaces})) {
    first_ = tasks_by_faces(blocks_, kClusterTaskFaces);
  }

  std::string name() const override { return "cluster"; }
  std::size_t task_count() const override { return first_.size() - 1; }
  std::uint64_t units() const override { return below_.face_count(); }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t b = first_[task]; b < first_[task + 1]; ++b)
      maximum = std::max(
          maximum, below_.block_bytes(below_.select(grown(below_.box_of(blocks_[b].patches), margin()))));
    return cluster_task_bytes(maximum);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter writer(context.create(kClusterFolder + task_file_stem(task) + ".tmm"), below_.info());
    double bound = 0.0;
    std::uint64_t kept = 0, faces = 0;
    for (std::size_t b = first_[task]; b < first_[task + 1]; ++b) {
      context.check_stop();
      const MeshBlockCut& cut = blocks_[b];
      const MeshHaloBlock near = below_.load_near(cut.patches, margin());
      const ClusteredBlock out = cluster_block(near.block, near.core, grid_, !below_.info().double_positions);
      bound = std::max(bound, out.bound);
      kept += out.faces_kept;
      faces += out.block.faces.size();
      write_block(cut, below_.info().lattice, out.block, writer);
      context.count_read(below_.block_bytes(cut.patches));
      context.advance(cut.faces);
    }
    context.count_written(writer.finish());
    return {{"bound", bound}, {"faces_kept", kept}, {"faces", faces}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& tasks, TaskContext&) const override {
    double bound = 0.0;
    std::uint64_t kept = 0, faces = 0;
    for (const Json& task : tasks) {
      bound = std::max(bound, task.at("bound").get<double>());
      kept += task.at("faces_kept").get<std::uint64_t>();
      faces += task.at("faces").get<std::uint64_t>();
    }
    return {{"cell", grid_.cell}, {"certified_max", bound}, {"faces", faces}, {"faces_kept", kept}};
  }

 private:
  /// Whatever lies in a cell that a face of the block touches. A little more, for cells are rounded.
  double margin() const { return grid_.cell * (1.0 + 0x1p-20); }

  MeshStore below_;
  ClusterGrid grid_;
  std::vector<MeshBlockCut> blocks_;
  std::vector<std::size_t> first_;  ///< block per task, one more at the end
};

}  // namespace

std::uint64_t cluster_task_bytes(std::uint64_t block_bytes) {
  // What is loaded is merged from pieces; then sums and order of its cells and faces, and what comes of it.
  return 3 * block_bytes + (std::uint64_t{4} << 20);
}

std::uint64_t level_cluster_bytes(std::uint64_t faces, std::uint64_t around) {
  return cluster_task_bytes(surface_block_bytes(std::min(faces, around * kClusterBlockFaces)));
}

std::unique_ptr<Stage> make_level_cluster_stage(const JobState& state, int level) {
  return std::make_unique<ClusterStage>(state.work.parent_path(), level);
}

}  // namespace tessera
