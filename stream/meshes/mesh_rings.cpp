#include "stream/meshes/mesh_rings.h"

#include <algorithm>
#include <deque>
#include <limits>
#include <set>
#include <vector>

#include "kernels/mesh/face_corners.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/key_table.h"

namespace tessera {
namespace {

using Fits = std::function<bool(std::uint64_t, std::uint64_t)>;

constexpr std::uint32_t kFar = std::numeric_limits<std::uint32_t>::max();

bool holds(const MeshBox& box, const Double3& p) {
  for (std::size_t a = 0; a < 3; ++a)
    if (p[a] < box.low[a] || p[a] > box.high[a]) return false;
  return true;
}

/// Breadth first, patch by patch: a patch is searched again when a way through another one turns out to be shorter.
class RingSearch {
 public:
  RingSearch(const MeshStore& store, std::uint32_t rings, const Fits& fits)
      : store_(store), rings_(rings), fits_(fits) {}

  /// \returns whether what was found fits
  bool search(std::span<const std::size_t> patches, std::span<const std::uint64_t> keys) {
    for (const std::uint64_t key : keys) lower(key, 0);
    all_of_ = keys.empty() ? patches : std::span<const std::size_t>{};
    for (const std::size_t p : patches) enqueue(p);
    while (!queue_.empty()) {
      const std::size_t next = queue_.front();
      queue_.pop_front();
      waits_.erase(next);
      visit(next);
      if (!fits_(depths_.size(), 0)) return false;
    }
    return true;
  }

  std::optional<MeshRings> block() const {
    MeshRings out;
    std::vector<MeshBlock> pieces;
    std::uint64_t faces = 0;
    for (const std::size_t p : visited_) {
      MeshBlock piece = store_.load({&p, 1});
      std::vector<std::uint8_t> inside(piece.key.size()), keep(piece.faces.size());
      for (std::size_t v = 0; v < inside.size(); ++v) inside[v] = depth(piece.key[v]) < rings_;
      std::size_t kept = 0;
      for (std::size_t f = 0; f < keep.size(); ++f) {
        const auto& c = piece.faces[f];
        keep[f] = inside[c[0]] | inside[c[1]] | inside[c[2]];
        kept += keep[f];
      }
      if (kept == 0) continue;
      faces += kept;
      if (!fits_(depths_.size(), faces)) return std::nullopt;
      pieces.push_back(kept == keep.size() ? std::move(piece) : select_faces(piece, keep));
    }
    std::vector<const MeshBlock*> pointers;
    for (const MeshBlock& piece : pieces) pointers.push_back(&piece);
    out.block = pieces.size() == 1 ? std::move(pieces[0]) : merge_blocks(pointers, {});
    for (const std::uint64_t key : out.block.key) out.first_patch.push_back(first_patch_[depths_.find(key)]);
    return out;
  }

 private:
  std::uint32_t depth(std::uint64_t key) const {
    const std::size_t at = depths_.find(key);
    return at < depths_.size() ? depth_[at] : kFar;
  }
  /// \returns its number
  std::uint32_t lower(std::uint64_t key, std::uint32_t to) {
    const auto [at, is_new] = depths_.add(key);
    if (is_new) {
      depth_.push_back(to);
      first_patch_.push_back(kFar);
    } else {
      depth_[at] = std::min(depth_[at], to);
    }
    return at;
  }
  void enqueue(std::size_t patch) {
    if (waits_.insert(patch).second) queue_.push_back(patch);
  }

  void visit(std::size_t patch) {
    const MeshBlock block = store_.load({&patch, 1});
    const bool first = visited_.insert(patch).second;  // what others may share is not known to them yet
    if (first && std::binary_search(all_of_.begin(), all_of_.end(), patch))
      for (const std::uint64_t key : block.key) lower(key, 0);
    std::vector<std::uint32_t> before(block.key.size());
    std::vector<std::vector<std::uint32_t>> ring(rings_ + 1);
    for (std::uint32_t v = 0; v < before.size(); ++v) {
      before[v] = depth(block.key[v]);
      if (before[v] < rings_) ring[before[v]].push_back(v);
    }
    std::vector<std::uint32_t> now = before;
    const FaceCorners corners(block);
    for (std::uint32_t d = 0; d < rings_; ++d)
      for (const std::uint32_t v : ring[d]) {
        if (now[v] != d) continue;  // reached by a shorter way meanwhile
        for (const std::uint32_t corner : corners.at(v))
          for (const std::uint32_t w : block.faces[corner >> 2])
            if (now[w] > d + 1) now[w] = d + 1, ring[d + 1].push_back(w);
      }
    std::vector<std::size_t> around = store_.select(store_.box_of({&patch, 1}));
    std::erase(around, patch);
    for (std::size_t v = 0; v < now.size(); ++v) {
      if (now[v] == kFar || (now[v] == before[v] && !first)) continue;
      std::uint32_t& first_patch = first_patch_[lower(block.key[v], now[v])];
      first_patch = std::min(first_patch, static_cast<std::uint32_t>(patch));
      if (now[v] == rings_) continue;
      for (const std::size_t p : around)
        if (holds(store_.patches()[p].box, block.position[v])) enqueue(p);
    }
  }

  const MeshStore& store_;
  std::uint32_t rings_;
  const Fits& fits_;
  KeyTable depths_;
  /// By number in depths_: edges from the nearest of the vertices asked for; the first patch seen to have it.
  std::vector<std::uint32_t> depth_, first_patch_;
  std::span<const std::size_t> all_of_;  ///< patches whose vertices are all asked for
  std::deque<std::size_t> queue_;
  std::set<std::size_t> waits_, visited_;
};

}  // namespace

std::optional<MeshRings> load_rings(const MeshStore& store, std::span<const std::size_t> patches,
                                    std::span<const std::uint64_t> keys, int rings, const Fits& fits) {
  RingSearch search(store, static_cast<std::uint32_t>(rings), fits);
  if (!search.search(patches, keys)) return std::nullopt;
  return search.block();
}

std::uint64_t mesh_rings_bytes(std::uint64_t vertices, std::uint64_t faces, std::uint64_t patch_bytes) {
  return MeshStore::block_bytes(vertices, faces) + KeyTable::bytes(vertices) + 20 * vertices +
         2 * patch_bytes;
}

}  // namespace tessera
