/// \file crease_patch.h
/// The surface within one cell as several smooth regions: the loop of the cell is cut along the creases that pass it, and every
/// region is triangulated alone.
/// Source: Barequet, Sharir, "Filling gaps in the boundary of a polyhedron", 1995 (a region is the triangulation of least area);
/// regions of the drawing of a graph by the turn of edges around its nodes: Edmonds, 1960.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// A corner of the loop: a root, or a kink where a crease passes a face of the cell.
struct OutlineCorner {
  Float3 at = {0, 0, 0};    ///< cells, relative to the cell
  std::uint8_t vertex = 0;  ///< its number; successive corners may be one vertex
  std::uint8_t faces = 0;   ///< of the cell that hold it, a bit each
};

/// A stretch of crease between nodes: corners of the outline, then inner points.
struct CreaseLink {
  std::array<std::uint16_t, 2> end{};
  std::array<std::uint8_t, 2> rank{};  ///< around an end that is an inner point (CreasePiece::rank)
};

/// What to triangulate: counter-clockwise from outside.
struct PatchOutline {
  std::vector<OutlineCorner> corners;
  std::vector<Float3> inner;      ///< where sharp edges meet in the cell
  std::vector<CreaseLink> links;  ///< joined to the outline, each of them
  bool clockwise = false;         ///< ranks run the other way
};

/// Its triangles: vertices of the outline, then those of `inner`.
struct CreasePatch {
  std::vector<Float3> inner;  ///< of the crease, without those where it is straight
  std::vector<std::uint8_t> is_corner;
  std::vector<std::array<std::uint8_t, 3>> triangles;
};

/// Cuts and triangulates.
/// \param vertices  of the outline
/// \returns false where the links do not cut the loop into regions, or their triangles cross, have no area or would need a
///          chord in a face of the cell, which its neighbour might use too
[[nodiscard]] bool triangulate_patch(const PatchOutline& outline, std::size_t vertices, CreasePatch& patch);

}  // namespace tessera
