#include <algorithm>
#include <map>

#include "kernels/mesh/mesh_block_ops.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/import/import_stages.h"
#include "stream/stages/resample/resample_stages.h"

namespace tessera {
namespace {

constexpr std::size_t kTaskPatches = 32;

/// A blend that stands, and the patches that it may change.
struct StandingBlend {
  std::size_t number = 0;
  std::uint64_t bytes = 0;
  std::vector<std::size_t> patches;  ///< ascending
};

class ResampleApplyStage : public Stage {
 public:
  explicit ResampleApplyStage(const JobState& state)
      : work_(state.work), store_(open_imported_mesh(state.work, kResampleImport)) {
    for (const std::size_t number : blends_that_stand(work_)) {
      StandingBlend blend{number, std::filesystem::file_size(work_ / blend_file(number)), {}};
      const MeshBlock added = load_blend(work_ / blend_file(number)).added;
      MeshBox box{added.position[0], added.position[0]};
      for (const Double3& p : added.position)
        for (std::size_t a = 0; a < 3; ++a)
          box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
      blend.patches = store_.select(box);
      for (const std::size_t p : blend.patches) at_[p].push_back(blends_.size());
      blends_.push_back(std::move(blend));
    }
    // A store has two layers of files; those of the import that are the newer ones move into this stage's.
    const auto tiles = list_task_files(work_ / kResampleImport / "tiles", ".tmm"),
               repaired = list_task_files(work_ / kResampleImport / "repaired", ".tmm");
    if (!repaired.empty()) {
      const MeshStore newer(repaired), older(tiles);
      for (const MeshPatchEntry& e : newer.patches()) at_[static_cast<std::size_t>(store_.find(e.key))];
      for (const MeshPatchEntry& e : older.patches())
        if (store_.find(e.key) < 0) gone_.push_back(e.key);
    }
    for (const auto& [patch, blends] : at_) patches_.push_back(patch);
  }

  std::string name() const override { return "apply"; }
  std::size_t task_count() const override { return (patches_.size() + kTaskPatches - 1) / kTaskPatches; }
  std::uint64_t units() const override { return patches_.size(); }
  std::string unit_name() const override { return "patches"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t i = task * kTaskPatches; i < end(task); ++i) {
      std::uint64_t bytes = 0, largest = 0;
      for (const std::size_t b : at_.at(patches_[i])) {
        bytes += blends_[b].bytes;
        largest = std::max(largest, blends_[b].bytes);
      }
      // What it gets is at most all of them, twice while blocks merge.
      maximum = std::max(maximum, resample_apply_bytes(store_.largest_patch_bytes(), bytes, largest));
    }
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter writer(context.create("resampled/" + task_file_stem(task) + ".tmm"), store_.info());
    std::uint64_t removed = 0, added = 0, changed = 0;
    for (std::size_t i = task * kTaskPatches; i < end(task); ++i) {
      context.check_stop();
      const std::size_t p = patches_[i];
      const MeshBlock block = store_.load({&p, 1});
      std::vector<std::uint8_t> keep(block.faces.size(), 1);
      std::vector<MeshBlock> pieces;
      for (const std::size_t b : at_.at(p)) {
        const ResampledBlend blend = load_blend(work_ / blend_file(blends_[b].number));
        for (std::size_t f = 0; f < keep.size(); ++f) {
          std::array<std::uint64_t, 3> c;
          for (std::size_t k = 0; k < 3; ++k) c[k] = block.key[block.faces[f][k]];
          std::sort(c.begin(), c.end());
          if (!std::binary_search(blend.removed.begin(), blend.removed.end(), c)) continue;
          keep[f] = 0;
          ++removed;
        }
        pieces.push_back(part_of(blend.added, blends_[b], p));
        added += pieces.back().faces.size();
      }
      const MeshBlock rest = select_faces(block, keep);
      std::vector<const MeshBlock*> all = {&rest};
      for (const MeshBlock& piece : pieces) all.push_back(&piece);
      const MeshBlock merged = merge_blocks(all, {});
      const std::uint64_t brick = store_.patches()[p].key;
      if (merged.faces.empty())
        writer.remove(brick);
      else
        writer.add(brick, merged);
      ++changed;
      context.advance(1);
    }
    context.count_written(writer.finish());
    return {{"removed", removed}, {"added", added}, {"patches", changed}};
  }

  std::uint64_t finish_bytes() const override {
    return (gone_.empty() ? 0 : DirectFile::kDefaultBuffer) + (std::uint64_t{2} << 20);
  }
  Json finish(const std::vector<Json>& tasks, TaskContext& context) const override {
    if (!gone_.empty()) {
      MeshFileWriter writer(context.create("resampled/gone.tmm"), store_.info());
      for (const std::uint64_t brick : gone_) writer.remove(brick);
      context.count_written(writer.finish());
    }
    std::uint64_t removed = 0, added = 0, patches = 0;
    for (const Json& t : tasks) {
      removed += t.at("removed").get<std::uint64_t>();
      added += t.at("added").get<std::uint64_t>();
      patches += t.at("patches").get<std::uint64_t>();
    }
    return {{"faces_removed", removed}, {"faces_added", added}, {"patches", patches}};
  }

 private:
  std::size_t end(std::size_t task) const { return std::min(patches_.size(), (task + 1) * kTaskPatches); }

  /// Its faces that belong to the patch: by their brick, or, where that has none, the first patch near the blend.
  MeshBlock part_of(const MeshBlock& added, const StandingBlend& blend, std::size_t patch) const {
    std::vector<std::uint8_t> mine(added.faces.size());
    for (std::size_t f = 0; f < mine.size(); ++f) {
      const auto& t = added.faces[f];
      const std::uint64_t brick = brick_of_face(store_.info().lattice, added.position[t[0]],
                                                added.position[t[1]], added.position[t[2]]);
      const std::int64_t found = store_.find(brick);
      const bool here = found >= 0 && std::binary_search(blend.patches.begin(), blend.patches.end(),
                                                         static_cast<std::size_t>(found));
      mine[f] = (here ? static_cast<std::size_t>(found) : blend.patches.front()) == patch;
    }
    return select_faces(added, mine);
  }

  std::filesystem::path work_;
  MeshStore store_;
  std::vector<StandingBlend> blends_;
  std::map<std::size_t, std::vector<std::size_t>> at_;  ///< by patch: places in blends_
  std::vector<std::size_t> patches_;
  std::vector<std::uint64_t> gone_;  ///< bricks that repairs emptied
};

}  // namespace

MeshStore open_resampled(const std::filesystem::path& work) {
  return MeshStore(list_task_files(work / kResampleImport / "tiles", ".tmm"),
                   list_task_files(work / "resampled", ".tmm"));
}

std::uint64_t resample_apply_bytes(std::uint64_t patch_bytes, std::uint64_t blend_bytes,
                                   std::uint64_t largest_blend) {
  return 3 * patch_bytes + 4 * blend_bytes + 2 * largest_blend + (std::uint64_t{8} << 20);
}

std::unique_ptr<Stage> make_resample_apply_stage(const JobState& state) {
  return std::make_unique<ResampleApplyStage>(state);
}

}  // namespace tessera
