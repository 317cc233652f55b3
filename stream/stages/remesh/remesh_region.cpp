#include "stream/stages/remesh/remesh_region.h"

#include <algorithm>

#include "kernels/mesh/mesh_block_ops.h"

namespace tessera {

std::vector<std::uint8_t> near_active(const MeshBlock& block,
                                      const std::function<bool(std::size_t)>& active) {
  constexpr int kRings = 5;
  std::vector<std::uint8_t> region_mark(block.key.size(), 0), near(block.faces.size(), 0);
  for (std::size_t f = 0; f < near.size(); ++f)
    if (active(f))
      for (const std::uint32_t v : block.faces[f]) region_mark[v] = 1;
  for (int ring = 0; ring < kRings; ++ring) {
    for (std::size_t f = 0; f < near.size(); ++f)
      for (const std::uint32_t v : block.faces[f]) near[f] |= region_mark[v];
    for (std::size_t f = 0; f < near.size(); ++f)
      if (near[f])
        for (const std::uint32_t v : block.faces[f]) region_mark[v] = 1;
  }
  return near;
}

std::vector<std::uint64_t> seam_keys(const MeshBlock& block) {
  const std::vector<std::uint8_t> complete = complete_stars(block);
  std::vector<std::uint64_t> keys;
  for (std::size_t v = 0; v < complete.size(); ++v)
    if (!complete[v]) keys.push_back(block.key[v]);
  return keys;
}

void mark_done(MeshBlock& block, const std::vector<std::uint64_t>& seams, const RemeshReport& report) {
  if (report.by_capacity > 0) return;  // not done at all
  std::vector<std::uint8_t> seam(block.key.size());
  for (std::size_t v = 0; v < seam.size(); ++v)
    seam[v] = std::binary_search(seams.begin(), seams.end(), block.key[v]);
  for (std::size_t f = 0; f < block.faces.size(); ++f) {
    const auto& t = block.faces[f];
    if (!seam[t[0]] && !seam[t[1]] && !seam[t[2]])
      block.face_flags[f] = static_cast<std::uint8_t>(block.face_flags[f] | kFaceDone);
  }
}

}  // namespace tessera
