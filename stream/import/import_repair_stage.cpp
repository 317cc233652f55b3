/// Stage "repair" of an import: what tiles know of the patches of others.
#include <algorithm>
#include <map>
#include <stdexcept>

#include "kernels/mesh/mesh_block_ops.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/import/import_bytes.h"
#include "stream/import/import_stages.h"

namespace tessera {
namespace {

/// Patches of which other tiles know more: the fixes of a run of faces, in the order of their smallest
/// corner.
class ImportRepairStage : public Stage {
 public:
  ImportRepairStage(const JobState& state, ImportSource source)
      : work_(state.work),
        source_(std::move(source)),
        names_(source_.folder),
        tiles_(open_imported_mesh(state.work, source_.folder)),
        fixes_(state.work / names_.all_fixes()) {}

  std::string name() const override { return source_.folder + "-repair"; }
  std::size_t task_count() const override { return fixes_.size() > 0 ? 1 : 0; }
  std::uint64_t units() const override { return fixes_.size() / sizeof(PlacedFix); }
  std::string unit_name() const override { return "fixes"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return import_repair_task_bytes(tiles_.largest_patch_bytes());
  }
  std::uint64_t finish_bytes() const override { return 1u << 20; }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return {{"patches", summaries.empty() ? 0 : summaries[0].at("patches").get<std::uint64_t>()}};
  }
  std::vector<std::string> obsolete() const override { return {names_.all_fixes()}; }

  Json run(std::size_t task, TaskContext& context) const override {
    MeshFileWriter writer(context.create(names_.repaired(task)), tiles_.info());
    std::vector<PlacedFix> page(1u << 14);
    std::vector<RepairFix> pending;
    std::uint64_t brick = 0;
    std::uint64_t patches = 0;
    const auto flush = [&] {
      if (pending.empty()) return;
      context.check_stop();
      const std::int64_t patch = tiles_.find(brick);
      if (patch < 0) throw std::logic_error("import: a fix names a brick without a patch");
      MeshBlock block = tiles_.load(std::vector<std::size_t>{static_cast<std::size_t>(patch)});
      apply(block, pending);
      writer.add(brick, block);
      pending.clear();
      ++patches;
    };
    for (std::uint64_t at = 0; at < fixes_.size();) {
      const std::uint64_t bytes =
          std::min<std::uint64_t>(page.size() * sizeof(PlacedFix), fixes_.size() - at);
      fixes_.read_at(at, page.data(), bytes);
      at += bytes;
      for (std::size_t i = 0; i < bytes / sizeof(PlacedFix); ++i) {
        if (page[i].brick != brick) flush();
        brick = page[i].brick;
        pending.push_back(page[i].fix);
        context.advance(1);
      }
    }
    flush();
    context.count_written(writer.finish());
    return {{"patches", patches}};
  }

 private:
  static void apply(MeshBlock& block, const std::vector<RepairFix>& fixes) {
    struct Corners {
      RepairFace sorted;
      std::uint32_t face;
    };
    std::vector<Corners> faces;
    const auto number = [&](std::uint32_t v) {
      return static_cast<std::uint32_t>(block.key[v] >> kVertexCopyBits);
    };
    for (std::uint32_t f = 0; f < block.faces.size(); ++f) {
      RepairFace c = {number(block.faces[f][0]), number(block.faces[f][1]), number(block.faces[f][2])};
      std::sort(c.begin(), c.end());
      faces.push_back({c, f});
    }
    std::sort(faces.begin(), faces.end(),
              [](const Corners& a, const Corners& b) { return a.sorted < b.sorted; });
    std::map<std::uint64_t, std::uint32_t> copies;
    for (const RepairFix& fix : fixes) {
      const auto at = std::lower_bound(faces.begin(), faces.end(), fix.face,
                                       [](const Corners& c, const RepairFace& f) { return c.sorted < f; });
      if (at == faces.end() || at->sorted != fix.face)
        throw std::logic_error("import: a fix names a face that its patch does not hold");
      auto& corners = block.faces[at->face];
      const auto corner_of = [&](std::uint32_t n) {
        return number(corners[0]) == n   ? std::size_t{0}
               : number(corners[1]) == n ? std::size_t{1}
                                         : std::size_t{2};
      };
      if (fix.slot >= 3) {
        const std::size_t i = corner_of(fix.face[fix.slot - 3]);
        const std::size_t j = corner_of(fix.face[(fix.slot - 2) % 3]);
        const std::size_t edge = (i + 1) % 3 == j ? i : j;
        block.face_flags[at->face] = static_cast<std::uint8_t>(block.face_flags[at->face] | 1u << edge);
        continue;
      }
      const std::size_t corner = corner_of(fix.face[fix.slot]);
      const std::uint32_t old = corners[corner];
      const auto [it, fresh] = copies.try_emplace(vertex_copy_key(fix.face[fix.slot], fix.copy), 0);
      if (fresh) {
        it->second = static_cast<std::uint32_t>(block.key.size());
        block.key.push_back(it->first);
        block.position.push_back(Double3(block.position[old]));
        block.vertex_class.push_back(block.vertex_class[old]);
        if (!block.rgba.empty()) block.rgba.push_back(std::uint32_t{block.rgba[old]});
      }
      corners[corner] = it->second;
    }
    canonicalise(block);
  }

  std::filesystem::path work_;
  ImportSource source_;
  ImportNames names_;
  MeshStore tiles_;
  ReadFile fixes_;
};

}  // namespace

std::unique_ptr<Stage> make_import_repair_stage(const JobState& state, const ImportSource& source) {
  return std::make_unique<ImportRepairStage>(state, source);
}

}  // namespace tessera
