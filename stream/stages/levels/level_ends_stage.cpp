// The store of a surface with levels as borders and fillings leave it, patch by patch.
#include <algorithm>

#include "kernels/mesh/mesh_block_ops.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/levels/level_ends.h"
#include "stream/stages/levels/moved_patches.h"
#include "stream/stages/surface/first_pass.h"

namespace tessera {
namespace {

/// Keys of new vertices: those of what is mended later count from 0 (crossing_mend_stage.cpp), far below.
constexpr std::uint64_t kFirstNewKey = ~std::uint64_t{0} << 52 | std::uint64_t{0xfffff} << 32;

/// The rest of one filling.
struct Filling {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;
  std::vector<std::uint64_t> names;
  std::vector<std::array<std::uint32_t, 3>> corners;
};

class LevelEndsStage : public Stage {
 public:
  explicit LevelEndsStage(const JobState& state)
      : work_(state.work),
        due_(level_ends(state).any()),
        store_(open_level_surface(state)),
        first_(patch_runs_of(store_)) {
    std::uint64_t vertices = 0;
    for (const auto& path : list_task_files(work_ / kLevelHoleFolder, ".tsh")) {
      files_.emplace_back(path, kLevelFillingKind, sizeof(LevelFilling));
      for (const LevelFilling& f : files_.back().table<LevelFilling>()) {
        for (const std::uint64_t p : files_.back().load<std::uint64_t>(f.patches))
          at_patch_.push_back({static_cast<std::uint32_t>(p), static_cast<std::uint32_t>(fillings_.size())});
        fillings_.push_back({f, files_.size() - 1, vertices});
        vertices += f.vertices;
      }
    }
    std::sort(at_patch_.begin(), at_patch_.end());
  }

  std::string name() const override { return "ends"; }
  std::size_t task_count() const override { return due_ ? first_.size() - 1 : 0; }
  std::uint64_t units() const override { return due_ ? store_.patches().size() : 0; }
  std::string unit_name() const override { return "bricks"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return level_ends_task_bytes(store_.largest_patch_bytes());
  }

  Json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter writer(context.create(kEndedFolder + task_file_stem(task) + ".tmm"), store_.info());
    MovedPatches mesh(store_, work_);
    std::uint64_t faces = 0, changed_patches = 0;
    for (std::size_t p = first_[task]; p < first_[task + 1]; ++p) {
      context.check_stop();
      context.advance(1);
      bool changed = false;
      MeshBlock block = mesh.load(p, &changed);
      changed = fill(p, block) || changed;
      faces += block.faces.size();
      changed_patches += changed;
      // A compact patch holds places on the lattice, which its vertices leave.
      writer.add(store_.patches()[p].key, block, changed ? 0 : store_.patches()[p].content & kPatchCompact);
    }
    context.count_written(writer.finish());
    return {{"faces", faces}, {"changed_bricks", changed_patches}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries, {{"faces", 0}, {"changed_bricks", 0}});
  }
  std::vector<std::string> obsolete() const override {
    if (!due_) return {};
    return {kFullFolder, kPrunedFullFolder, kLevelBorderFolder, kLevelLoopFolder, kLevelHoleFolder};
  }

 private:
  struct Placed {
    LevelFilling filling;
    std::size_t file = 0;
    std::uint64_t first_vertex = 0;  ///< over all files
  };
  struct AtPatch {
    std::uint32_t patch, filling;
    auto operator<=>(const AtPatch&) const = default;
  };

  /// \return whether the block changes
  bool fill(std::size_t p, MeshBlock& block) const {
    std::vector<MeshBlock> pieces;
    std::vector<std::array<std::uint64_t, 2>> closed;  // edges of faces that end no more
    bool changed = false;
    const auto patch = static_cast<std::uint32_t>(p);
    for (auto at = std::lower_bound(at_patch_.begin(), at_patch_.end(), AtPatch{patch, 0});
         at != at_patch_.end() && at->patch == patch; ++at) {
      const Placed& placed = fillings_[at->filling];
      const PackedFile& file = files_[placed.file];
      const auto names = file.load<std::uint64_t>(placed.filling.names);
      for (std::size_t i = 0; i < names.size(); ++i) {
        closed.push_back({names[(i + 1) % names.size()], names[i]});
        const auto v = std::lower_bound(block.key.begin(), block.key.end(), names[i]);
        if (v == block.key.end() || *v != names[i]) continue;
        block.vertex_class[static_cast<std::size_t>(v - block.key.begin())] = VertexClass::kSmooth;
        changed = true;
      }
      if (placed.filling.patch == p) pieces.push_back(piece_of(placed, names));
    }
    if (!changed) return false;
    std::sort(closed.begin(), closed.end());
    for (std::size_t f = 0; f < block.faces.size(); ++f)
      for (std::size_t i = 0; i < 3; ++i)
        if ((block.face_flags[f] >> i & 1u) != 0 &&
            std::binary_search(
                closed.begin(), closed.end(),
                std::array{block.key[block.faces[f][i]], block.key[block.faces[f][(i + 1) % 3]]}))
          block.face_flags[f] = static_cast<std::uint8_t>(block.face_flags[f] & ~(1u << i));
    if (pieces.empty()) return true;
    std::vector<const MeshBlock*> all = {&block};
    for (const MeshBlock& piece : pieces) all.push_back(&piece);
    block = merge_blocks(all, {}, nullptr);
    return true;
  }

  MeshBlock piece_of(const Placed& placed, const std::vector<std::uint64_t>& names) const {
    const PackedFile& file = files_[placed.file];
    MeshBlock piece;
    piece.key = names;
    for (std::uint64_t v = 0; v < placed.filling.vertices; ++v)
      piece.key.push_back(kFirstNewKey + placed.first_vertex + v);
    piece.position = file.load<Double3>(placed.filling.position);
    piece.rgba = file.load<std::uint32_t>(placed.filling.rgba);
    piece.vertex_class.assign(piece.key.size(), VertexClass::kSmooth);
    piece.faces = file.load<std::array<std::uint32_t, 3>>(placed.filling.corners);
    piece.face_flags.assign(piece.faces.size(), kFaceSynthetic);
    canonicalise(piece);
    return piece;
  }

  std::filesystem::path work_;
  bool due_;
  MeshStore store_;
  std::vector<std::size_t> first_;
  std::vector<PackedFile> files_;
  std::vector<Placed> fillings_;
  std::vector<AtPatch> at_patch_;  ///< ascending
};

}  // namespace

std::uint64_t level_ends_task_bytes(std::uint64_t patch_bytes) {
  return MovedPatches::bytes(patch_bytes) + 4 * patch_bytes + 2 * DirectFile::kDefaultBuffer +
         (std::uint64_t{8} << 20);
}

std::unique_ptr<Stage> make_level_ends_stage(const JobState& state) {
  return std::make_unique<LevelEndsStage>(state);
}

}  // namespace tessera
