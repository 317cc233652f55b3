#include "kernels/mesh/face_components.h"

#include "octree/union_find.h"

namespace tessera {

FaceComponents find_components(std::size_t vertices, std::span<const std::array<std::uint32_t, 3>> faces) {
  UnionFind sets(vertices);
  for (const auto& f : faces) {
    sets.unite(f[0], f[1]);
    sets.unite(f[1], f[2]);
  }
  FaceComponents out;
  out.of_vertex.resize(vertices);
  for (std::uint32_t v = 0; v < vertices; ++v) {
    const std::uint32_t root = sets.find(v);
    if (root == v) {
      out.of_vertex[v] = static_cast<std::uint32_t>(out.faces.size());
      out.faces.push_back(0);
    } else {
      out.of_vertex[v] = out.of_vertex[root];
    }
  }
  for (const auto& f : faces) ++out.faces[out.of_vertex[f[0]]];
  return out;
}

}  // namespace tessera
