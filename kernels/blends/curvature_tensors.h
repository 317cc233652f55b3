/// \file curvature_tensors.h
/// Curvature tensors at the vertices of a mesh, averaged over balls of one radius: the search for blends begins here.
/// Source: Cohen-Steiner, Morvan, "Restricted Delaunay Triangulations and Normal Cycle", 2003. Every edge turns by its
/// dihedral angle about itself; the sum over a ball, by its area, is the curvature tensor with its directions swapped.
/// Sharp creases count as well as fillets, and noise, which turns edges to and fro, sums up to little.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

struct CurvatureTensor {
  Double3 normal = {0, 0, 0};  ///< unit, of the faces at the vertex by area; zero where they have none
  Double3 along = {0, 0,
                   0};   ///< unit, in which the surface bends least: along a blend; its sign says nothing
  double across = 0.0;   ///< curvature across `along`, the larger one: above 0 convex, 1 / scan units
  double minimum = 0.0;  ///< curvature in the direction of `along`
};

/// \param block   canonical; complete within `radius` of the vertices that are asked for
/// \param wanted  per vertex, 0: its bend stays zero
/// \param radius  > 0, scan units; faces are reached from the vertex within the ball, so other sheets have no say
/// \post  a function of the faces within the ball alone, whatever else is in the block
/// \cost  about 3 us a vertex at four edges
[[nodiscard]] std::vector<CurvatureTensor> curvature_tensors(const MeshBlock& block,
                                                             const std::vector<std::uint8_t>& wanted,
                                                             double radius);

/// Upper bound of what it allocates.
[[nodiscard]] constexpr std::uint64_t curvature_tensors_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return vertices * (sizeof(CurvatureTensor) + 12 + 24) + faces * (24 + 8 + 24 + 4 + 84 + 12 + 12 + 48);
}

}  // namespace tessera
