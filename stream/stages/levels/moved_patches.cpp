#include "stream/stages/levels/moved_patches.h"

#include <algorithm>

#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kMovesKind = {"TSVMOVE1", "a file of moved vertices"};
constexpr std::uint64_t kMovesCache = std::uint64_t{2} << 20, kBlockCache = std::uint64_t{8} << 20;
constexpr std::uint64_t kRunFaces = std::uint64_t{1} << 18;  ///< of a task

}  // namespace

std::string vertex_moves_file(std::size_t task) {
  return kLevelBorderFolder + task_file_stem(task) + ".tsv";
}

VertexMovesWriter::VertexMovesWriter(const std::filesystem::path& path)
    : file_(path, kMovesKind, std::size_t{1} << 18) {}

void VertexMovesWriter::add(std::uint64_t brick, const std::vector<VertexMove>& moves) {
  if (!moves.empty()) table_.push_back({brick, file_.append(bytes_of(moves))});
}

std::vector<std::size_t> patches_near(const MeshStore& store, std::size_t patch, double margin) {
  return store.select(grown(store.patches()[patch].box, margin));
}

std::vector<std::size_t> patch_runs_of(const MeshStore& store) {
  std::vector<std::size_t> first = {0};
  std::uint64_t faces = 0;
  for (std::size_t p = 0; p < store.patches().size(); ++p) {
    if (faces >= kRunFaces) first.push_back(p), faces = 0;
    faces += store.patches()[p].faces;
  }
  first.push_back(store.patches().size());
  return first;
}

MovedPatches::MovedPatches(const MeshStore& store, const std::filesystem::path& work)
    : store_(store),
      tables_(list_task_files(work / kLevelBorderFolder, ".tsv"), kMovesKind),
      moves_(kMovesCache),
      blocks_(kBlockCache) {}

MeshBlock MovedPatches::load(std::size_t patch, bool* moved) {
  MeshBlock block = store_.load({&patch, 1});
  if (moved) *moved = false;
  if (tables_.entries().empty()) return block;
  for (const std::size_t p : patches_near(store_, patch, 0.0)) {
    if (p > patch) break;
    const auto* entry = tables_.find(store_.patches()[p].key);
    if (!entry) continue;
    const Moves& moves =
        moves_.get(p, [&](Moves& out) { out.list = tables_.file_of(*entry).load<VertexMove>(entry->moves); });
    for (const VertexMove& m : moves.list) {
      const auto at = std::lower_bound(block.key.begin(), block.key.end(), m.key);
      if (at == block.key.end() || *at != m.key) continue;
      block.position[static_cast<std::size_t>(at - block.key.begin())] = m.to;
      if (moved) *moved = true;
    }
  }
  return block;
}

const MeshBlock& MovedPatches::get(std::size_t patch) {
  return blocks_.get(patch, [&](Loaded& out) { out.block = load(patch); }).block;
}

std::uint64_t MovedPatches::bytes(std::uint64_t largest_patch_bytes) {
  return kMovesCache + kBlockCache + 3 * largest_patch_bytes;
}

}  // namespace tessera
