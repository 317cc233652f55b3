/// \file cell_loops.h
/// The closed loops in which a surface meets the faces of one cell, from the signs of its corners.
/// Sources: Lorensen, Cline, "Marching Cubes", 1987; Nielson, Hamann, "The Asymptotic Decider", 1991.
///
///   corner c = dx + 2 dy + 4 dz                       (bit of a sign pattern: 1 = inside)
///   edge   e = 4 a + du + 2 dv, u = a+1, v = a+2 mod 3 (along axis a, at offsets du, dv)
///   face   f = 2 a + side                             (normal to axis a, side 1 = max)
///
/// Every crossed edge lies on two faces of the cell: on one of them a segment ends in it, on the other one
/// starts. Segments keep the inside to their left when seen from outside the cell, so following them gives
/// closed loops, counter-clockwise from outside the solid, and the cell across a face sees the same segments
/// reversed: the union over all cells is a closed oriented surface for any field.
#pragma once
#include <array>
#include <cstdint>

namespace tessera {

inline constexpr int kCellEdges = 12;
inline constexpr int kMaxCellLoops = 4;

/// Loops of one cell, one after the other in `edge`; each starts at its lowest edge.
struct CellLoops {
  std::uint8_t count = 0;
  std::array<std::uint8_t, kMaxCellLoops> length{};
  std::array<std::uint8_t, kCellEdges> edge{};
};

/// Faces of the pattern with four crossings, as a mask of face bits.
[[nodiscard]] std::uint8_t ambiguous_faces(unsigned pattern);

/// Loops of a pattern without ambiguous faces, from a table.
[[nodiscard]] const CellLoops& unambiguous_loops(unsigned pattern);

/// Loops of any pattern.
/// \param joined  mask of the ambiguous faces on which the two inside corners are joined
[[nodiscard]] CellLoops trace_loops(unsigned pattern, unsigned joined);

/// Asymptotic decider: mask of those ambiguous faces whose inside corners are joined, from the corners'
/// values. The same decision from both cells of a face; ties separate the inside.
[[nodiscard]] std::uint8_t joined_faces(unsigned pattern, const std::array<float, 8>& value);

/// The face that holds both edges, 255 if none. Two different edges share at most one.
[[nodiscard]] std::uint8_t common_face(int edge_a, int edge_b);

/// The edge opposite to `edge` across the cell along `axis` (the same lattice edge seen from the next cell).
[[nodiscard]] constexpr int mirrored_edge(int edge, int axis) {
  const int along = edge >> 2;
  return edge ^ (axis == (along + 1) % 3 ? 1 : axis == (along + 2) % 3 ? 2 : 0);
}

/// Offset of the edge's node from the cell's, along `axis`.
[[nodiscard]] constexpr int edge_offset(int edge, int axis) {
  const int along = edge >> 2;
  return axis == (along + 1) % 3 ? edge & 1 : axis == (along + 2) % 3 ? edge >> 1 & 1 : 0;
}

}  // namespace tessera
