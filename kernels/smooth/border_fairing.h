/// \file border_fairing.h
/// The border of a scanned surface as a smooth line. Where samples end, noise decides from cell to cell where the surface
/// does, and the border wavers with it.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// The faces around a stretch of border.
struct BorderStrip {
  std::vector<Double3> position;  ///< cells; any unit where `cell` is given
  /// Every face of a vertex at the border, in an order that does not depend on where the strip was cut out.
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint8_t> at_border;  ///< per vertex: an edge of one face between two such is the border
  /// Per vertex, edge of the smallest cell that it is of, in the unit of `position`; empty: 1 everywhere.
  std::vector<double> cell = {};
};

/// How far around a vertex a strip has to reach, in cells. Twelve steps see 24 edges along the border, which are shorter
/// than a cell; what lies beyond the reach hardly weighs.
inline constexpr int kBorderHalo = 20;

/// Moves the vertices of the border towards the middle of their two neighbours along it, twelve times half the way, by a
/// cell at most in all, and off the surface no farther than `lift`. A step goes no farther than 0.3 of the height of
/// the faces around, and where a face would turn away from the normals at its corners its vertices stay.
/// Vertices without exactly two border edges stay as well, and holes of at most eight edges, which would shrink to nothing.
/// \param lift  in the unit of positions: what noise leaves unknown of where the surface is
void fair_border(BorderStrip& strip, double lift);

}  // namespace tessera
