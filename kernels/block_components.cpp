#include "kernels/block_components.h"

#include <algorithm>

#include "kernels/mesh_block_ops.h"
#include "octree/union_find.h"

namespace tessera {

BlockComponents find_components(const MeshBlock& block, std::span<const std::uint8_t> complete) {
  const std::size_t n = block.key.size();
  UnionFind sets(n);
  for (const auto& f : block.faces) {
    sets.unite(f[0], f[1]);
    sets.unite(f[1], f[2]);
  }
  BlockComponents out;
  out.of_vertex.resize(n);
  for (std::uint32_t v = 0; v < n; ++v) {
    const std::uint32_t root = sets.find(v);
    if (root == v) {
      out.of_vertex[v] = static_cast<std::uint32_t>(out.faces.size());
      out.faces.push_back(0);
      out.open.push_back(0);
    } else {
      out.of_vertex[v] = out.of_vertex[root];
    }
    if (!complete[v]) out.open[out.of_vertex[v]] = 1;
  }
  for (const auto& f : block.faces) ++out.faces[out.of_vertex[f[0]]];
  return out;
}

MeshBlock without_vertices(const MeshBlock& block, std::span<const std::uint64_t> gone) {
  std::vector<std::uint8_t> keep(block.faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f)
    keep[f] = !std::binary_search(gone.begin(), gone.end(), block.key[block.faces[f][0]]);
  return select_faces(block, keep);
}

}  // namespace tessera
