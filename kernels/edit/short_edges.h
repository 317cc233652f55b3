/// \file short_edges.h
/// Merges the ends of edges that are far too short: what remeshing could not collapse without leaving the manifold. For a base
/// surface, on which slivers turn over at the least bend, and which need be no manifold.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// In the order of their vertices, each vertex merges once: the higher number into the lower. Faces that lose their area go, and
/// so do pairs of faces back to back; vertices that no face uses any more go, too.
/// \param attached  more values of the vertices, which stay beside them
/// \return edges merged
std::size_t merge_short_edges(std::vector<Double3>& position,
                              std::vector<std::array<std::uint32_t, 3>>& faces, double shorter_than,
                              std::vector<Double3>& attached);

}  // namespace tessera
