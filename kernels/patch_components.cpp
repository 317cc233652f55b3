#include "kernels/patch_components.h"

#include "octree/union_find.h"

namespace tessera {

PatchComponents find_components(const Patch& patch) {
  const std::size_t own = patch.position.size();
  const std::size_t all = own + patch.foreign.size();
  UnionFind sets(all);
  for (const PatchFace& f : patch.faces) {
    sets.unite(f[0], f[1]);
    sets.unite(f[1], f[2]);
  }
  PatchComponents out;
  out.of_vertex.resize(all);
  for (std::uint32_t v = 0; v < all; ++v) {
    const std::uint32_t root = sets.find(v);
    out.of_vertex[v] = root == v ? out.count++ : out.of_vertex[root];
  }
  out.vertices.assign(out.count, 0);
  out.faces.assign(out.count, 0);
  for (std::size_t v = 0; v < own; ++v) ++out.vertices[out.of_vertex[v]];
  for (const PatchFace& f : patch.faces) ++out.faces[out.of_vertex[f[0]]];
  return out;
}

}  // namespace tessera
