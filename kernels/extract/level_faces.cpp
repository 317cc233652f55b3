#include "kernels/extract/level_faces.h"

#include <bit>

#include "kernels/extract/level_cells.h"

namespace tessera {
namespace {

/// A vertex that finer bricks own.
std::uint32_t finer_vertex(const BrickInput& brick, const LevelPoint& point, const Int3& cell,
                           PatchBuilder& patch) {
  const LevelCells::Name name = brick.levels->finer_name(point.node, point.axis, cell, brick.band);
  const EdgeRoot& root = brick.levels->finer_root(point.node, point.axis);
  const Int3 node = brick.levels->finer_node(point.node);
  Float3 p = in_owner(node);
  p[static_cast<std::size_t>(point.axis)] += root.t;
  return patch.add_finer({patch.finer_key(node, name.type), p + root.slide_offset(), root.rgba,
                          name.border ? VertexClass::kBorder : VertexClass::kSmooth, true});
}

/// A point of a finer edge, relative to the cell.
Float3 finer_point(const EdgeRoot& root, const LevelPoint& point, const Int3& cell) {
  Float3 at = root.slide_offset();
  at[static_cast<std::size_t>(point.axis)] += root.t;
  for (std::size_t a = 0; a < 3; ++a)
    at[a] = 0.5f * (at[a] + static_cast<float>(point.node[a] - 2 * cell[a]));
  return at;
}

void emit_level_loop(const BrickInput& brick, const LeafEdges& edges, const Int3& cell, int number,
                     const LevelLoop& loop, PatchBuilder& patch) {
  std::vector<std::uint32_t> vertex;
  ColourMean colour;
  std::vector<Float3> point;
  for (const LevelPoint& p : loop) {
    const EdgeRoot& root =
        p.finer ? brick.levels->finer_root(p.node, p.axis) : brick.field.roots[edges.root(cell, p.edge)];
    vertex.push_back(p.finer ? finer_vertex(brick, p, cell, patch) : edges.vertex(cell, p.edge));
    point.push_back(p.finer ? finer_point(root, p, cell) : point_in_cell(p.edge, root));
    colour.add(root.rgba);
  }
  const std::size_t size = loop.size();
  const auto triangles = triangulate_level_loop(loop, point);
  for (const auto& t : triangles) {
    unsigned border = 0;
    for (std::size_t e = 0; e < 3; ++e)
      if (t[(e + 1) % 3] == (t[e] + 1) % size && loop[t[e]].ends) border |= 1u << e;
    patch.add_face(vertex[t[0]], vertex[t[1]], vertex[t[2]], border);
  }
  if (!triangles.empty()) return;
  Float3 mean = {0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) {
    for (const Float3& p : point) mean[k] += p[k];
    mean[k] /= static_cast<float>(size);
  }
  // More loops than a key has types for: the cell has eight places on the finest lattice.
  const int octant = number >> 2;
  const VertexKey key =
      patch.key(cell, 6 + (number & 3)) + make_vertex_key(static_cast<std::uint32_t>(octant & 1),
                                                          static_cast<std::uint32_t>(octant >> 1 & 1),
                                                          static_cast<std::uint32_t>(octant >> 2), 0);
  const std::uint32_t centre = patch.add_own({key, in_owner(cell) + mean, colour.value()});
  for (std::size_t i = 0; i < size; ++i)
    patch.add_face(vertex[i], vertex[i + 1 == size ? 0 : i + 1], centre, loop[i].ends ? 1u : 0u);
}

}  // namespace

std::uint64_t emit_level_faces(const BrickInput& brick, const LeafMasks& leaf, const LeafEdges& edges,
                               PatchBuilder& patch) {
  std::uint64_t loops = 0;
  for (std::size_t z = 0; z < 8; ++z)
    for (std::uint64_t left = leaf.cells[z] & leaf.leaf->quiet[z]; left; left &= left - 1) {
      const int b = std::countr_zero(left);
      const Int3 cell = {leaf.at[0] * 8 + (b & 7), leaf.at[1] * 8 + (b >> 3),
                         leaf.at[2] * 8 + static_cast<int>(z)};
      int number = 0;
      const std::size_t faces_before = patch.faces();
      for (const LevelLoop& loop : brick.levels->trace(cell, brick.band)) {
        if (loop.size() >= 3) {
          ++loops;
          emit_level_loop(brick, edges, cell, number, loop, patch);
        }
        ++number;
      }
      if ((leaf.leaf->unseen[z] >> b & 1u) != 0) patch.mark_synthetic(faces_before);
    }
  return loops;
}

}  // namespace tessera
