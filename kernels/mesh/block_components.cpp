#include "kernels/mesh/block_components.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "kernels/mesh/face_components.h"
#include "kernels/mesh/mesh_block_ops.h"

namespace tessera {

BlockComponents find_components(const MeshBlock& block, std::span<const std::uint8_t> complete) {
  FaceComponents found = find_components(block.key.size(), block.faces);
  BlockComponents out{std::move(found.of_vertex), std::move(found.faces), {}, {}, {}};
  out.border.assign(out.faces.size(), 0);
  constexpr unsigned kBorder = kFaceBorder01 | kFaceBorder12 | kFaceBorder20;
  for (std::size_t f = 0; f < block.face_flags.size(); ++f)
    out.border[out.of_vertex[block.faces[f][0]]] +=
        static_cast<std::uint32_t>(std::popcount(block.face_flags[f] & kBorder));
  out.folded = count_folded<double>(block.position, block.faces, out.of_vertex, out.faces, out.border);
  out.open.assign(out.faces.size(), 0);
  for (std::size_t v = 0; v < complete.size(); ++v) {
    if (!complete[v]) out.open[out.of_vertex[v]] = 1;
  }
  return out;
}

MeshBlock without_vertices(const MeshBlock& block, std::span<const std::uint64_t> gone) {
  std::vector<std::uint8_t> keep(block.faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f)
    keep[f] = !std::binary_search(gone.begin(), gone.end(), block.key[block.faces[f][0]]);
  return select_faces(block, keep);
}

}  // namespace tessera
