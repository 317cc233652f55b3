#include "stream/stages/weld/numbered_patches.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr std::size_t kRemaps = 256;  ///< patches that lost an island and are named by others, held at once

}  // namespace

std::vector<std::size_t> kept_patches_around(const PatchStore& store, const Numbering& numbering,
                                             const Int3& brick) {
  std::vector<std::size_t> around;
  for (int d = 0; d < 27; ++d) {
    const Int3 n = {brick[0] + d % 3 - 1, brick[1] + d / 3 % 3 - 1, brick[2] + d / 9 - 1};
    if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
    const std::int64_t at = store.find(brick_key(n));
    if (at >= 0 && numbering.patches[static_cast<std::size_t>(at)].kept_faces > 0)
      around.push_back(static_cast<std::size_t>(at));
  }
  std::sort(around.begin(), around.end());
  return around;
}

std::vector<std::uint32_t> NumberedPatches::make_remap(std::size_t patch) const {
  const PatchSeam seam = store_->load_seam(patch);
  std::vector<std::uint32_t> map(store_->patches()[patch].vertices);
  std::uint32_t next = 0;
  for (std::size_t v = 0; v < map.size(); ++v) {
    const bool kept =
        numbering_->kept[numbering_->patches[patch].first_component + seam.components.of_vertex[v]] != 0;
    map[v] = kept ? next++ : kGone;
  }
  return map;
}

std::vector<std::uint32_t> NumberedPatches::kept_vertices(std::size_t patch) const {
  std::vector<std::uint32_t> out;
  const std::vector<std::uint32_t> map = make_remap(patch);
  for (std::uint32_t v = 0; v < map.size(); ++v)
    if (map[v] != kGone) out.push_back(v);
  return out;
}

std::uint64_t NumberedPatches::output_index(const VertexSlot& slot) {
  const std::uint64_t base = numbering_->patches[slot.patch].first_vertex;
  if (numbering_->patches[slot.patch].kept_vertices == store_->patches()[slot.patch].vertices)
    return base + slot.vertex;
  auto [it, fresh] = remaps_.try_emplace(slot.patch);
  if (fresh) it->second = make_remap(slot.patch);
  const std::uint32_t v = it->second[slot.vertex];
  return v == kGone ? PatchFaces::kDropped : base + v;
}

void NumberedPatches::load_faces(std::size_t patch, PatchFaces& out) {
  const PatchEntry& entry = store_->patches()[patch];
  const auto file = static_cast<std::int64_t>(store_->file_of(patch));
  if (file != open_file_) {
    slots_ = std::make_unique<WeldFile>(work_ / weld_file_name(static_cast<std::size_t>(file)));
    open_file_ = file;
  }
  if (remaps_.size() > kRemaps) remaps_.clear();
  store_->load_faces(patch, out.faces, &out.synthetic);
  out.foreign.resize(entry.foreign);
  slots_->file.read_part(slots_->slots, numbering_->patches[patch].foreign_offset, out.foreign.data(),
                         out.foreign.size() * sizeof(VertexSlot));
  out.index.resize(std::size_t{entry.vertices} + entry.foreign);
  for (std::uint32_t v = 0; v < entry.vertices; ++v)
    out.index[v] = output_index({static_cast<std::uint32_t>(patch), v});
  for (std::size_t f = 0; f < out.foreign.size(); ++f)
    out.index[entry.vertices + f] = output_index(out.foreign[f]);
}

void NumberedPatches::load_kept_vertices(std::size_t patch, std::vector<Float3>& position,
                                         std::vector<std::uint32_t>& rgba) {
  if (!positions_) positions_ = std::make_shared<PatchPositions>(work_, *store_);
  positions_->load(patch, position, rgba);
  const std::uint32_t kept = numbering_->patches[patch].kept_vertices;
  if (kept == position.size()) return;
  const std::vector<std::uint32_t> map = make_remap(patch);
  for (std::size_t v = 0; v < map.size(); ++v) {
    if (map[v] == kGone) continue;
    position[map[v]] = position[v];
    if (!rgba.empty()) rgba[map[v]] = rgba[v];
  }
  position.resize(kept);
  if (!rgba.empty()) rgba.resize(kept);
}

}  // namespace tessera
