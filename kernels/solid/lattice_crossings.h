/// \file lattice_crossings.h
/// Where triangles cross the lines of the lattice, exactly: corners are integers, and all decisions are integer signs.
///
/// Every node of the lattice is thought of as moved by the same (e1, e2, e3), e1 >> e2 >> e3 > 0 beyond any number
/// (Edelsbrunner, Mücke, "Simulation of Simplicity", 1990). Then no line meets an edge or a vertex and no triangle holds a
/// node: what a closed mesh turns along any closed path of lattice edges is exactly zero, whatever its triangles are.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

using Long3 = std::array<std::int64_t, 3>;

inline constexpr int kSolidQuantumBits = 12;
inline constexpr std::int64_t kSolidQuanta = std::int64_t{1} << kSolidQuantumBits;  ///< a cell has so many

/// A world position in quanta of h / 4096 from the lattice origin, nearest, ties up.
[[nodiscard]] Long3 quantise_solid(const Lattice& lattice, const Double3& world);

/// Nodes [low, high).
struct NodeBox {
  Int3 low = {0, 0, 0}, high = {0, 0, 0};
};

/// A triangle passes between `node` and the next node in +axis direction.
struct LatticeCrossing {
  Int3 node = {0, 0, 0};
  std::uint8_t axis = 0;
  std::int8_t winding =
      0;           ///< +1: who goes along +axis enters (the normal points against the axis); -1: leaves
  double t = 0.0;  ///< from the node, cells, within [0, 1]
};

using QuantisedTriangle = std::array<Long3, 3>;  ///< counter-clockwise from outside

/// Appends all crossings of one triangle on edges from nodes of the box, by axis, then row by row. A triangle whose
/// projection along an axis is a segment has none there.
/// \param axes  bit a: lines along axis a are asked for
/// \pre   coordinates and nodes (in quanta) within 2^33 of zero, whatever the box holds
/// \post  the number of crossings of a closed mesh with a line is even, their turns add up to zero
void find_crossings(const QuantisedTriangle& triangle, const NodeBox& box, unsigned axes,
                    std::vector<LatticeCrossing>& out);

}  // namespace tessera
