#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "kernels/decimate/decimate.h"
#include "kernels/mesh/block_components.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/uncross_block.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/first_pass.h"
#include "stream/stages/surface/islands_stage.h"
#include "stream/stages/surface/sides_stage.h"

namespace tessera {
namespace {

/// A block that loses parts, or in which vertices go back, or both.
struct PrunedBlock {
  std::uint64_t file = 0, brick = 0, bricks = 0;
  std::vector<std::uint32_t> components;  ///< those that go
  bool moved = false;
};

/// The block of these bricks, of a store: merged as the first pass had it. \param patches  out: its patches
MeshBlock load_island_block(const MeshStore& store, std::uint64_t brick, std::uint64_t bricks,
                            std::vector<std::size_t>& patches) {
  patches.clear();
  for (std::uint64_t b = brick; b < brick + bricks; ++b)
    if (const std::int64_t patch = store.find(b); patch >= 0)
      patches.push_back(static_cast<std::size_t>(patch));
  return store.load(patches);
}

class PruneStage : public Stage {
 public:
  explicit PruneStage(const JobState& state)
      : full_(list_task_files(state.work / kFullFolder, ".tmm")),
        pass_(list_task_files(state.work / kFirstPassFolder, ".tmm")),
        moved_(load_side_moves(state.work)),
        kernel_(first_pass_kernel(state, full_.info().double_positions)) {
    const PackedFile file(state.work / kDroppedFile, kDroppedKind, sizeof(Section));
    const auto sections = file.table<Section>();
    for (std::size_t f = 0; f < sections.size(); ++f)
      for (const IslandPart& part : file.load<IslandPart>(sections[f])) {
        if (blocks_.empty() || blocks_.back().file != f || blocks_.back().brick != part.brick)
          blocks_.push_back({f, part.brick, part.bricks, {}, false});
        blocks_.back().components.push_back(part.component);
      }
    const std::size_t losing = blocks_.size();
    for (const MovedBlock& moved : load_moved_blocks(state.work)) {
      const auto at = std::lower_bound(blocks_.begin(), blocks_.begin() + static_cast<std::ptrdiff_t>(losing),
                                       std::pair(moved.file, moved.brick), before);
      if (at == blocks_.begin() + static_cast<std::ptrdiff_t>(losing) || at->file != moved.file ||
          at->brick != moved.brick)
        blocks_.push_back({moved.file, moved.brick, moved.bricks, {}, true});
      else
        at->moved = true;
    }
    std::sort(blocks_.begin(), blocks_.end(), [](const PrunedBlock& a, const PrunedBlock& b) {
      return before(a, std::pair(b.file, b.brick));
    });
    for (std::size_t i = 0; i < blocks_.size(); ++i)
      if (i == 0 || blocks_[i].file != blocks_[i - 1].file) first_.push_back(i);
    first_.push_back(blocks_.size());
  }

  std::string name() const override { return "prune"; }
  std::size_t task_count() const override { return first_.size() - 1; }
  std::uint64_t units() const override { return blocks_.size(); }
  std::string unit_name() const override { return "blocks"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t i = first_[task]; i < first_[task + 1]; ++i) {
      std::vector<std::size_t> patches;
      std::uint64_t faces = 0;
      for (std::uint64_t b = blocks_[i].brick; b < blocks_[i].brick + blocks_[i].bricks; ++b)
        if (const std::int64_t at = full_.find(b); at >= 0) {
          patches.push_back(static_cast<std::size_t>(at));
          faces += full_.patches()[patches.back()].faces;
        }
      const bool anew = blocks_[i].moved && !pass_.patches().empty();
      maximum = std::max(maximum, full_.block_bytes(patches) + (anew ? decimate_bytes(faces, 0) / 2 : 0));
    }
    return prune_task_bytes(maximum);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter full(context.create(kPrunedFullFolder + task_file_stem(task) + ".tmm"), full_.info());
    std::optional<MeshFileWriter> pass;
    if (!pass_.patches().empty())
      pass.emplace(context.create(kPrunedPassFolder + task_file_stem(task) + ".tmm"), pass_.info());
    for (std::size_t i = first_[task]; i < first_[task + 1]; ++i) {
      context.check_stop();
      const PrunedBlock& block = blocks_[i];
      std::vector<std::size_t> patches;
      MeshBlock merged = load_island_block(full_, block.brick, block.bricks, patches);
      std::vector<std::uint64_t> gone;
      if (!block.components.empty()) {
        const BlockComponents components = find_components(merged, complete_stars(merged));
        std::vector<std::uint8_t> goes(components.faces.size(), 0);
        for (const std::uint32_t component : block.components) goes.at(component) = 1;
        for (std::size_t v = 0; v < merged.key.size(); ++v)
          if (goes[components.of_vertex[v]]) gone.push_back(merged.key[v]);
      }
      for (const std::size_t p : patches) rewrite(full_, p, gone, full);
      if (pass && block.moved) {
        take_back(merged, moved_);
        decimate_anew(block, without_vertices(merged, gone), *pass);
      } else if (pass) {
        for (std::uint64_t b = block.brick; b < block.brick + block.bricks; ++b)
          if (const std::int64_t p = pass_.find(b); p >= 0)
            rewrite(pass_, static_cast<std::size_t>(p), gone, *pass);
      }
      context.advance(1);
    }
    context.count_written(full.finish() + (pass ? pass->finish() : 0));
    return Json::object();
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }
  Json finish(const std::vector<Json>&, TaskContext&) const override {
    std::size_t parts = 0, anew = 0;
    for (const PrunedBlock& b : blocks_) parts += b.components.size(), anew += b.moved;
    return {{"parts", parts}, {"vertices_back", moved_.size()}, {"blocks_anew", anew}};
  }
  std::vector<std::string> obsolete() const override {
    std::vector<std::string> folders = side_folders();
    folders.emplace_back(kIslandFolder);
    return folders;
  }

 private:
  static bool before(const PrunedBlock& a, const std::pair<std::uint64_t, std::uint64_t>& b) {
    return std::pair(a.file, a.brick) < b;
  }

  void rewrite(const MeshStore& store, std::size_t patch, const std::vector<std::uint64_t>& gone,
               MeshFileWriter& writer) const {
    const std::uint64_t brick = store.patches()[patch].key;
    MeshBlock loaded = store.load(std::vector<std::size_t>{patch});
    take_back(loaded, moved_);
    const MeshBlock left = without_vertices(loaded, gone);
    if (left.faces.empty())
      writer.remove(brick);
    else
      writer.add(brick, left, store.patches()[patch].content & (kPatchAlone | kPatchCompact | kPatchOctant));
  }

  /// The first pass over a block whose vertices have moved since.
  void decimate_anew(const PrunedBlock& of, MeshBlock block, MeshFileWriter& writer) const {
    std::uint64_t next = of.brick;
    const auto empty_until = [&](std::uint64_t brick) {
      for (; next < brick; ++next)
        if (pass_.find(next) >= 0) writer.remove(next);
    };
    if (!block.faces.empty())
      decimate_first_block(block, of.brick, of.bricks, full_.info().lattice, kernel_,
                           [&](std::uint64_t brick, MeshBlock&& patch) {
                             empty_until(brick);
                             writer.add(brick, patch);
                             next = brick + 1;
                           });
    empty_until(of.brick + of.bricks);
  }

  MeshStore full_;
  MeshStore pass_;
  std::vector<SafePlace> moved_;  ///< vertices that go back, keys ascending
  DecimateOptions kernel_;
  std::vector<PrunedBlock> blocks_;
  std::vector<std::size_t> first_;  ///< into blocks_ per task, one more at the end
};

}  // namespace

std::uint64_t prune_task_bytes(std::uint64_t block_bytes) {
  return 2 * block_bytes + 2 * DirectFile::kDefaultBuffer + (std::uint64_t{2} << 20);
}

namespace {

StageForecast forecast_prune(const PlannedScan& scan) {
  const std::uint64_t anew = FirstPass::max_block_faces(scan.largest_patch.faces);
  return {.tasks = scan.groups.size(),
          .task_bytes = prune_task_bytes(std::max(8 * surface_block_bytes(scan.largest_patch.faces),
                                                  surface_block_bytes(anew) + decimate_bytes(anew, 0) / 2))};
}

}  // namespace

std::vector<StageEntry> store_end_stages(const ReconstructOptions& options) {
  std::vector<StageEntry> stages;
  if (!options.has_levels()) stages = side_stages();
  stages.push_back({"islands", make_islands_stage, forecast_islands});
  stages.push_back(
      {"prune", [](const JobState& state) { return std::make_unique<PruneStage>(state); }, forecast_prune});
  return stages;
}

}  // namespace tessera
