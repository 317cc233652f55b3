#include "kernels/mesh/patch_components.h"

#include <utility>

#include "kernels/mesh/face_components.h"

namespace tessera {

PatchComponents find_components(const Patch& patch) {
  const std::size_t own = patch.position.size();
  const std::size_t all = own + patch.foreign.size();
  FaceComponents found = find_components(all, patch.faces);
  PatchComponents out;
  out.count = static_cast<std::uint32_t>(found.faces.size());
  out.of_vertex = std::move(found.of_vertex);
  out.faces = std::move(found.faces);
  out.vertices.assign(out.count, 0);
  out.border.assign(out.count, 0);
  for (std::size_t v = 0; v < own; ++v) {
    ++out.vertices[out.of_vertex[v]];
    out.border[out.of_vertex[v]] += patch.vertex_class[v] == VertexClass::kBorder ? 1 : 0;
  }
  out.folded = count_folded<float>(patch.position, patch.faces, out.of_vertex, out.faces, out.border);
  return out;
}

}  // namespace tessera
