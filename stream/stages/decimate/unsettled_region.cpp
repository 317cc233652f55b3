#include "stream/stages/decimate/unsettled_region.h"

#include <algorithm>
#include <array>
#include <limits>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/mesh/box_mask.h"
#include "kernels/mesh/mesh_block_ops.h"

namespace tessera {
namespace {

constexpr std::size_t kCells = 64;

MeshBox box_of(const MeshBlock& block, const std::array<std::uint32_t, 3>& face) {
  MeshBox box{block.position[face[0]], block.position[face[0]]};
  for (const std::uint32_t v : {face[1], face[2]})
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], block.position[v][k]);
      box.high[k] = std::max(box.high[k], block.position[v][k]);
    }
  return box;
}

/// The corners of faces with a reached corner are reached as well.
void grow(const MeshBlock& block, std::vector<std::uint8_t>& region_mark) {
  const std::vector<std::uint8_t> before = region_mark;
  for (const auto& f : block.faces)
    if (before[f[0]] || before[f[1]] || before[f[2]])
      region_mark[f[0]] = region_mark[f[1]] = region_mark[f[2]] = 1;
}

}  // namespace

ActiveRegion find_active(const MeshBlock& block) {
  ActiveRegion region;
  std::vector<std::uint8_t> region_mark(block.key.size(), 0);
  bool any = false;
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    if ((block.face_flags[f] & kFaceDone) == 0) {
      for (const std::uint32_t v : block.faces[f]) region_mark[v] = 1;
      any = true;
    }
  grow(block, region_mark);
  for (std::size_t v = 0; v < region_mark.size(); ++v)
    if (!region_mark[v]) region.done_keys.push_back(block.key[v]);
  if (!any) return region;
  region.near.resize(block.faces.size());
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (const std::uint32_t v : block.faces[f]) region.near[f] |= region_mark[v];
  return region;
}

MeshBlock load_near_faces(const MeshStore& store, const MeshBlock& block,
                          const std::vector<std::uint8_t>& marked, double margin) {
  MeshBox all;
  all.low.fill(std::numeric_limits<double>::infinity());
  all.high.fill(-std::numeric_limits<double>::infinity());
  for (const Double3& p : block.position)
    for (std::size_t k = 0; k < 3; ++k) {
      all.low[k] = std::min(all.low[k], p[k]);
      all.high[k] = std::max(all.high[k], p[k]);
    }
  all = grown(all, margin);
  BoxMask mask(all.low, all.high, kCells);
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    if (marked[f]) {
      const MeshBox box = grown(box_of(block, block.faces[f]), margin);
      mask.mark(box.low, box.high);
    }
  std::vector<MeshBlock> pieces;
  for (const std::size_t p : store.select(all)) {
    if (!mask.meets(store.patches()[p].box.low, store.patches()[p].box.high)) continue;
    MeshBlock piece = store.load({&p, 1});
    std::vector<std::uint8_t> keep(piece.faces.size());
    std::size_t kept = 0;
    for (std::size_t f = 0; f < keep.size(); ++f) {
      const MeshBox box = box_of(piece, piece.faces[f]);
      keep[f] = overlap(box, all) && mask.meets(box.low, box.high);
      kept += keep[f];
    }
    if (kept == 0) continue;
    pieces.push_back(kept == keep.size() ? std::move(piece) : select_faces(piece, keep));
  }
  if (pieces.size() == 1) return std::move(pieces[0]);
  std::vector<const MeshBlock*> pointers;
  for (const MeshBlock& piece : pieces) pointers.push_back(&piece);
  return merge_blocks(pointers, {}, nullptr);
}

}  // namespace tessera
