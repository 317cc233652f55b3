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

/// How far fairing goes.
struct BorderFairing {
  int steps = 12;          ///< half the way to the middle of the neighbours each
  double max_shift = 1.0;  ///< in all, cells
  /// Of the angle between a face and the normals at its corners, at least: two faces within 38 degrees of one normal do not
  /// meet in an edge that looks sharp.
  double min_cosine = 0.788;
  int small_hole = 8;  ///< edges of a hole that the steps would shrink to a seventh, which stays
};
/// Rims of shadows, behind what stood between a surface and the scanner, waver over several cells.
inline constexpr BorderFairing kShadowFairing = {
    .steps = 30, .max_shift = 1.5, .min_cosine = 0.6, .small_hole = 12};

/// How far around a vertex a strip has to reach, in cells. Edges along the border are shorter than a cell, and what moves them
/// spreads with the root of the steps: over 2.4 edges in 12 of them, 3.9 in 30. What lies beyond the reach hardly weighs.
inline constexpr int kBorderHalo = 20;

/// Moves the vertices of the border towards the middle of their two neighbours along it, as far as `by` says, and off the
/// surface no farther than `lift`. A step goes no farther than 0.3 of the height of the faces around, and where a face would
/// turn away from the normals at its corners its vertices stay.
/// Vertices without exactly two border edges stay as well, and small holes, which would shrink to nothing.
/// \param lift  in the unit of positions: what noise leaves unknown of where the surface is
void fair_border(BorderStrip& strip, double lift, const BorderFairing& by = {});

}  // namespace tessera
