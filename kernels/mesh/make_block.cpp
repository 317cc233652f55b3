#include "kernels/mesh/make_block.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"

namespace tessera {
namespace {

/// A side of a face, by its two vertices, lower first.
struct SideOfFace {
  std::uint64_t ends = 0;
  std::uint64_t side = 0;  ///< 6 face + 2 corner, and 1 if it runs from the higher to the lower vertex
  auto operator<=>(const SideOfFace&) const = default;
};

std::string face_name(std::uint64_t face) {
  return "face " + std::to_string(face);
}

void check_face(const std::array<std::uint32_t, 3>& face, std::size_t number, std::size_t vertices) {
  for (std::size_t k = 0; k < 3; ++k) {
    if (face[k] >= vertices)
      throw InputError(face_name(number) + " names vertex " + std::to_string(face[k]) + " of " +
                       std::to_string(vertices));
    if (face[k] == face[(k + 1) % 3])
      throw InputError(face_name(number) + " repeats vertex " + std::to_string(face[k]));
  }
}

/// Sets the border bits of edges with one face.
void mark_borders(std::span<const std::array<std::uint32_t, 3>> faces, std::vector<std::uint8_t>& flags) {
  std::vector<SideOfFace> sides;
  sides.reserve(3 * faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = faces[f][k], b = faces[f][(k + 1) % 3];
      sides.push_back({std::min(a, b) << 32 | std::max(a, b), 6 * f + 2 * k + (a > b ? 1 : 0)});
    }
  std::sort(sides.begin(), sides.end());
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].ends == sides[begin].ends) ++end;
    const std::uint64_t face = sides[begin].side / 6;
    const std::string edge = "the edge from vertex " + std::to_string(sides[begin].ends >> 32) + " to " +
                             std::to_string(sides[begin].ends & 0xffffffffu) + ", of " + face_name(face) +
                             ", has ";
    if (end - begin > 2) throw InputError(edge + std::to_string(end - begin) + " faces, at most 2 allowed");
    if (end - begin == 2 && (sides[begin].side + sides[begin + 1].side) % 2 == 0)
      throw InputError(edge + "two faces that run along it in the same direction");
    if (end - begin == 1)
      flags[face] = static_cast<std::uint8_t>(flags[face] | 1u << sides[begin].side % 6 / 2);
  }
}

}  // namespace

MeshBlock make_block(std::span<const Double3> vertices, std::span<const std::array<std::uint32_t, 3>> faces) {
  if (vertices.size() > std::numeric_limits<std::uint32_t>::max())
    throw InputError("a block holds fewer than 2^32 vertices, and there are " +
                     std::to_string(vertices.size()));
  for (std::size_t v = 0; v < vertices.size(); ++v)
    for (const double x : vertices[v])
      if (!std::isfinite(x)) throw InputError("vertex " + std::to_string(v) + " is not finite");
  for (std::size_t f = 0; f < faces.size(); ++f) check_face(faces[f], f, vertices.size());
  MeshBlock block;
  block.key.resize(vertices.size());
  std::iota(block.key.begin(), block.key.end(), std::uint64_t{0});
  block.position.assign(vertices.begin(), vertices.end());
  block.vertex_class.assign(vertices.size(), VertexClass::kSmooth);
  block.faces.assign(faces.begin(), faces.end());
  block.face_flags.assign(faces.size(), 0);
  mark_borders(faces, block.face_flags);
  canonicalise(block);
  return block;
}

}  // namespace tessera
