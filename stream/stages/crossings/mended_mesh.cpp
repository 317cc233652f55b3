#include "stream/stages/crossings/mended_mesh.h"

#include <algorithm>
#include <utility>

#include "kernels/mesh/mesh_block_ops.h"
#include "stream/stages/crossings/crossing_parts.h"

namespace tessera {
namespace {

MeshBox box_of_vertices(const MeshBlock& block) {
  MeshBox box = {block.position[0], block.position[0]};
  for (const Double3& p : block.position)
    for (std::size_t a = 0; a < 3; ++a)
      box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
  return box;
}

MeshBlock joined(const std::vector<MeshBlock>& pieces) {
  std::vector<const MeshBlock*> pointers;
  for (const MeshBlock& piece : pieces) pointers.push_back(&piece);
  return merge_blocks(pointers, {});
}

}  // namespace

std::optional<MeshBlock> MendedMesh::load(const MeshBox& box, std::size_t max_faces) const {
  std::vector<MeshBlock> pieces;
  std::size_t faces = 0;
  const auto take = [&](const MeshBlock& from, bool of_store) {
    std::vector<std::uint8_t> keep = faces_in_box(from, box);
    if (of_store && !gone_.empty())
      for (std::size_t f = 0; f < keep.size(); ++f)
        if (keep[f] != 0 && is_gone(face_keys(from, f))) keep[f] = 0;
    MeshBlock piece = select_faces(from, keep);
    faces += piece.faces.size();
    if (!piece.faces.empty()) pieces.push_back(std::move(piece));
    return faces <= max_faces;
  };
  for (const std::size_t p : store_.select(box))
    if (!take(store_.load({&p, 1}), true)) return std::nullopt;
  for (const Added& a : added_)
    if (!a.block.faces.empty() && overlap(a.box, box) && !take(a.block, false)) return std::nullopt;
  return joined(pieces);
}

void MendedMesh::apply(const MeshBlock& block, CrossingMend&& mend) {
  std::optional<FaceKeys> anchor;
  MeshBox box = {block.position[block.faces[mend.removed[0]][0]],
                 block.position[block.faces[mend.removed[0]][0]]};
  for (const std::uint32_t f : mend.removed) {
    const FaceKeys face = face_keys(block, f);
    for (const std::uint32_t v : block.faces[f])
      for (std::size_t a = 0; a < 3; ++a) {
        box.low[a] = std::min(box.low[a], block.position[v][a]);
        box.high[a] = std::max(box.high[a], block.position[v][a]);
      }
    bool of_store = true;
    for (Added& a : added_) {
      for (std::size_t g = 0; g < a.block.faces.size() && of_store; ++g) {
        if (face_keys(a.block, g) != face) continue;
        std::vector<std::uint8_t> keep(a.block.faces.size(), 1);
        keep[g] = 0;
        a.block = select_faces(a.block, keep);
        if (!anchor) anchor = a.anchor;
        of_store = false;
      }
      if (!of_store) break;
    }
    if (!of_store) continue;
    gone_.insert(face);
    anchor = anchor.value_or(face);
  }
  gone_boxes_.push_back(box);
  if (mend.added.faces.empty()) return;
  const MeshBox around = box_of_vertices(mend.added);
  added_.push_back({std::move(mend.added), *anchor, around});
}

std::uint64_t MendedMesh::write(const std::filesystem::path& path) const {
  MeshFileWriter writer(path, store_.info());
  std::set<std::size_t> near;
  for (const MeshBox& box : gone_boxes_)
    for (const std::size_t p : store_.select(box)) near.insert(p);
  for (const std::size_t p : near) {
    const MeshBlock patch = store_.load({&p, 1});
    std::vector<std::uint8_t> keep(patch.faces.size(), 1);
    std::vector<MeshBlock> pieces(1);
    bool changed = false;
    for (std::size_t f = 0; f < keep.size(); ++f) {
      const FaceKeys face = face_keys(patch, f);
      if (!is_gone(face)) continue;
      keep[f] = 0;
      changed = true;
      for (const Added& a : added_)
        if (a.anchor == face && !a.block.faces.empty()) pieces.push_back(a.block);
    }
    if (!changed) continue;
    pieces[0] = select_faces(patch, keep);
    if (pieces[0].faces.empty()) pieces.erase(pieces.begin());
    if (pieces.empty())
      writer.remove(store_.patches()[p].key);
    else
      writer.add(store_.patches()[p].key, joined(pieces));
  }
  return writer.finish();
}

}  // namespace tessera
