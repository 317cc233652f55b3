/// \file patch.h
/// The mesh of one brick. Elements at seams are named by integers, so patches weld by key alone.
#pragma once
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// 20 bits per axis of the node or cell, then 4 bits of type.
/// Types: 0..2  point on the lattice edge from the node in +x, +y, +z
///        3..5  the same point as the cells on its + side of axis (type - 3 + 2) mod 3 name it where valid cells
///              meet only across the edge: two vertices then, which keeps them manifold
///        6..9  centre of loop 0..3 in the cell
///        10..15  two places each in the cell's faces towards -x, -y, -z where creases pass from brick to brick
using VertexKey = std::uint64_t;
inline constexpr int kFirstKinkType = 10;

[[nodiscard]] constexpr VertexKey make_vertex_key(std::uint32_t i, std::uint32_t j, std::uint32_t k,
                                                  std::uint32_t type) {
  return (static_cast<std::uint64_t>(k) << 44) | (static_cast<std::uint64_t>(j) << 24) |
         (static_cast<std::uint64_t>(i) << 4) | type;
}
struct VertexName {
  Int3 at;  ///< global node or cell coordinates
  int type;
};
[[nodiscard]] constexpr VertexName vertex_name(VertexKey key) {
  return {{static_cast<std::int32_t>(key >> 4 & 0xfffff), static_cast<std::int32_t>(key >> 24 & 0xfffff),
           static_cast<std::int32_t>(key >> 44 & 0xfffff)},
          static_cast<int>(key & 0xf)};
}
/// The brick that owns a vertex.
[[nodiscard]] constexpr Int3 vertex_brick(VertexKey key) {
  const VertexName n = vertex_name(key);
  return {n.at[0] >> kBrickBits, n.at[1] >> kBrickBits, n.at[2] >> kBrickBits};
}

enum class VertexClass : std::uint8_t { kSmooth = 0, kCrease = 1, kCorner = 2, kBorder = 3 };

/// Triangle: indices below position.size() are own vertices, others are foreign[index - position.size()].
using PatchFace = std::array<std::uint32_t, 3>;

/// Where a vertex that was moved may go back to.
struct SafeVertex {
  std::uint32_t vertex = 0;  ///< own vertex of the patch
  Float3 at{};               ///< cells, relative to the brick's min corner
};

struct Patch {
  Int3 brick = {0, 0, 0};
  std::vector<Float3> position;           ///< cells, relative to the brick's min corner
  std::vector<std::uint32_t> rgba;        ///< per own vertex; empty if none of them has a colour
  std::vector<VertexClass> vertex_class;  ///< per own vertex
  std::vector<PatchFace> faces;           ///< counter-clockwise from outside
  std::vector<std::uint8_t>
      synthetic;  ///< per face: 1 if it closes a hole, or nobody saw what it shows; empty if none does
  std::vector<VertexKey> foreign;  ///< ascending, no repeats: vertices of other bricks that faces name
  /// Own vertices that other bricks may name (edge points on the min faces, loop centres in the cells of the
  /// max faces): key and own index, ascending by key.
  std::vector<std::pair<VertexKey, std::uint32_t>> exported;

  /// Own vertices that may lie off their cells, and where they would lie within (risky_crossings.h), ascending.
  std::vector<SafeVertex> safe;

  // With ExtractOptions::names only, for who goes on with the mesh in memory (patch_mesh.h).
  std::vector<VertexKey> name;           ///< per own vertex
  std::vector<Float3> foreign_position;  ///< per foreign vertex: cells, relative to the brick that owns it
  std::vector<std::uint32_t> foreign_rgba;
  std::vector<VertexClass> foreign_class;
  std::vector<std::uint8_t> border;  ///< per face: bit i, the surface ends at its edge i; empty if nowhere

  // Of a brick of 64^3 cells of 2^level: `brick` and positions are those of its lattice, names of the finest one.
  int level = 0;
  /// Per foreign vertex: 1 if its position is relative to a brick of the next finer level; empty if none is.
  std::vector<std::uint8_t> foreign_finer;

  [[nodiscard]] bool empty() const { return faces.empty() && position.empty(); }
};

}  // namespace tessera
