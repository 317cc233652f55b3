#include "stream/stages/decimate/unsettled_region.h"

#include <algorithm>
#include <array>
#include <limits>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/runtime/memory_budget.h"

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

MeshBox box_of(const MeshBlock& block) {
  MeshBox box;
  box.low.fill(std::numeric_limits<double>::infinity());
  box.high.fill(-std::numeric_limits<double>::infinity());
  for (const Double3& p : block.position)
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], p[k]);
      box.high[k] = std::max(box.high[k], p[k]);
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

NearFaceLoader::NearFaceLoader(const MeshStore& store, const MeshBlock& block,
                               const std::vector<std::uint8_t>& marked, double margin)
    : store_(store), all_(grown(box_of(block), margin)), mask_(all_.low, all_.high, kCells) {
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    if (marked[f]) {
      const MeshBox box = grown(box_of(block, block.faces[f]), margin);
      mask_.mark(box.low, box.high);
    }
  select();
}

NearFaceLoader::NearFaceLoader(const MeshStore& store, const MeshBox& box)
    : store_(store), all_(box), mask_(box.low, box.high, 1) {
  mask_.mark(box.low, box.high);
  select();
}

void NearFaceLoader::select() {
  for (const std::size_t p : store_.select(all_)) {
    const MeshPatchEntry& e = store_.patches()[p];
    if (!mask_.meets(e.box.low, e.box.high)) continue;
    patches_.push_back(p);
    faces_ += e.faces;
    bytes_ += MeshStore::block_bytes(e.vertices, e.faces);
  }
}

MeshBlock NearFaceLoader::read(std::size_t patch) const {
  MeshBlock piece = store_.load({&patch, 1});
  // A face lies beyond a side that all of its corners lie beyond.
  const std::vector<std::uint8_t> beyond = beyond_sides(piece.position, all_.low, all_.high);
  std::vector<std::uint8_t> keep(piece.faces.size());
  std::size_t kept = 0;
  for (const std::uint32_t f : mask_.faces_that_meet(piece.position, piece.faces)) {
    const auto& [a, b, c] = piece.faces[f];
    keep[f] = (beyond[a] & beyond[b] & beyond[c]) == 0;
    kept += keep[f];
  }
  return kept == keep.size() ? std::move(piece) : select_faces(piece, keep);
}

void NearFaceLoader::count() {
  std::vector<std::size_t> meeting;
  std::uint64_t largest = 0;
  faces_ = bytes_ = 0;
  for (const std::size_t p : patches_) {
    const MeshBlock piece = read(p);
    const MeshPatchEntry& e = store_.patches()[p];
    largest = std::max(largest, MeshStore::block_bytes(e.vertices, e.faces));
    if (piece.faces.empty()) continue;
    meeting.push_back(p);
    faces_ += piece.faces.size();
    bytes_ += MeshStore::block_bytes(piece.key.size(), piece.faces.size());
  }
  bytes_ += largest;
  patches_ = std::move(meeting);
}

void NearFaceLoader::require_fits(
    const std::function<std::uint64_t(std::uint64_t bytes, std::uint64_t faces)>& needed,
    std::uint64_t available, const std::string& who) {
  if (needed(bytes_, faces_) <= available) return;
  count();
  const std::uint64_t bytes = needed(bytes_, faces_);
  if (bytes <= available) return;
  throw ResourceError(who + ": a block with " + std::to_string(faces_) +
                      " faces of the reference near it needs " + format_bytes(bytes) +
                      "; raise --memory to " + std::to_string(cap_mib_for_guess(bytes)) + "M");
}

MeshBlock NearFaceLoader::load() const {
  std::vector<MeshBlock> pieces;
  for (const std::size_t p : patches_)
    if (MeshBlock piece = read(p); !piece.faces.empty()) pieces.push_back(std::move(piece));
  if (pieces.size() == 1) return std::move(pieces[0]);
  std::vector<const MeshBlock*> pointers;
  for (const MeshBlock& piece : pieces) pointers.push_back(&piece);
  return merge_blocks(pointers, {}, nullptr);
}

}  // namespace tessera
