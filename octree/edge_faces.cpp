#include "octree/edge_faces.h"

namespace tessera {

std::vector<std::uint32_t> opposite_half_edges(std::size_t vertices, std::span<const EdgeFaces::Face> faces) {
  std::vector<std::uint32_t> opposite(3 * faces.size(), kNoHalfEdge);
  EdgeFaces(vertices, faces).for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
    if (half.size() != 2) return;
    opposite[half[0]] = half[1];
    opposite[half[1]] = half[0];
  });
  return opposite;
}

}  // namespace tessera
