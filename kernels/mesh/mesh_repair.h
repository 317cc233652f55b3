/// \file mesh_repair.h
/// Makes a manifold with border of any set of triangles, one tile of vertices at a time.
///
/// A tile owns a range of vertices and is given every face that has a corner in it, so it knows the whole
/// star of each of its vertices and every face of each edge that ends in one. Faces at an edge are paired,
/// opposite directions only, flattest first; what finds no partner is a border. A vertex whose faces form
/// several fans becomes one vertex per fan. Both are pure functions of one star, so tiles agree without
/// talking; what a tile decides about a face that another one keeps, it hands out as a fix.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// Corners by global number, counter-clockwise from outside.
using RepairFace = std::array<std::uint32_t, 3>;

struct RepairTile {
  std::vector<RepairFace> faces;  ///< every face with a corner in [own_begin, own_end); corners differ
  std::uint32_t own_begin = 0;
  std::uint32_t own_end = 0;
  std::span<const std::uint32_t> number;  ///< all vertices of the faces, ascending
  std::span<const Double3> position;      ///< of each
  bool orient = false;  ///< turn faces so that neighbours agree, by the majority of each part; only where the
                        ///< tile holds the whole mesh
};

/// For a face that another tile keeps: the face by its corners in ascending order, and what is true of it.
struct RepairFix {
  RepairFace face = {0, 0, 0};
  std::uint16_t slot = 0;  ///< 0..2: that corner is copy `copy` of its vertex; 3..5: the edge from corner
                           ///< slot - 3 to the next is a border
  std::uint16_t copy = 0;
  auto operator<=>(const RepairFix&) const = default;
};

struct RepairReport {
  std::uint64_t duplicate_faces = 0;     ///< dropped: the same three vertices as another
  std::uint64_t nonmanifold_edges = 0;   ///< more than two faces
  std::uint64_t inconsistent_edges = 0;  ///< two faces of the same direction, after turning
  std::uint64_t reversed_faces = 0;
  std::uint64_t split_vertices = 0;  ///< copies added
  std::uint64_t border_edges = 0;    ///< of faces kept here, as far as they are known here
};

struct RepairResult {
  std::vector<RepairFace> faces;  ///< kept here (smallest corner owned), ascending by sorted corners
  std::vector<RepairFace> local;  ///< the same corners as indices of RepairTile::number
  std::vector<std::array<std::uint16_t, 3>> copy;  ///< per corner; 0 = the vertex itself
  std::vector<std::uint8_t> border;                ///< per face, bits as MeshFaceFlag
  std::vector<RepairFix> fixes;                    ///< for other tiles, ascending
  RepairReport report;
};

/// Consumes the faces of the tile. \throws InputError when a vertex falls into more than 65536 fans
[[nodiscard]] RepairResult repair_tile(RepairTile&& tile);

/// Upper bound of what repair_tile allocates above its input.
[[nodiscard]] constexpr std::uint64_t repair_bytes(std::uint64_t faces) {
  return faces * 130;
}

}  // namespace tessera
