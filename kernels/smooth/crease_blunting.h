/// \file crease_blunting.h
/// Sharp edges at the border of a scanned surface, and where what was seen meets what nobody saw: samples do not vouch for
/// them, so they are rounded off.
/// Source: umbrella operator, Kobbelt, Campagna, Vorsatz, Seidel, "Interactive multi-resolution modeling on arbitrary meshes",
/// 1998, at the ends of sharp edges alone.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// A piece of a mesh.
struct CreaseMesh {
  std::vector<Double3> position;  ///< cells
  /// In an order that does not depend on where the piece was cut out.
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint8_t> unseen;     ///< per face: nobody saw what it shows
  std::vector<std::uint8_t> at_border;  ///< per vertex
};

/// So many rings of faces around take part.
inline constexpr int kBluntRings = 2;
/// How far a piece goes around the vertices that are wanted, in cells: rounds and rings, and what is cut off there.
inline constexpr int kBluntHalo = 20;

/// Vertices at edges of more than 60 degrees, near a border or faces that nobody saw, move half the way to the mean of their
/// neighbours, in at most six rounds, by a cell at most in all. Vertices at a border, or of which the piece lacks faces, stay.
/// \returns how many moved
/// \cost  O(faces) a round
std::size_t blunt_creases(CreaseMesh& mesh);

}  // namespace tessera
