/// \file contour_chains.h
/// Where the faces of a block are crossed by levels, as chains of edges crossed one after the other. A vertex at a level counts
/// as above it (symbolic perturbation: Edelsbrunner, Muecke, "Simulation of Simplicity", 1990), so in every face a level enters by one
/// edge and leaves by another one, and a chain ends only where the faces do. Points depend on the edge alone, so chains of
/// blocks that share it meet in the very same point.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "kernels/mesh/prism_volume.h"

namespace tessera {

/// Heights base + k * interval.
struct ContourLevels {
  double base = 0.0;
  double interval = 1.0;  ///< > 0
  double height(std::int64_t k) const { return base + static_cast<double>(k) * interval; }
  /// Index of the first level above a height.
  [[nodiscard]] std::int64_t above(double height) const;
};

/// An edge of the whole mesh: the keys of its vertices, the smaller one first.
using EdgeName = std::array<std::uint64_t, 2>;

/// Crossed edges in order, higher ground on the left of faces that show upwards.
struct ContourChain {
  std::int64_t level = 0;
  bool closed = false;            ///< then it begins at the smallest name and does not come back to it
  EdgeName begin{}, end{};        ///< of the first and the last edge
  EdgeName smallest{};            ///< of all its edges
  std::uint32_t smallest_at = 0;  ///< which one that is
  std::vector<Double2> points;    ///< one an edge
};

/// Chains of levels first to end (exclusive) in the order of their levels and beginnings. \pre the block is canonical; at
/// each of its edges there are two faces at most, oriented alike
[[nodiscard]] std::vector<ContourChain> contour_chains(const MeshBlock& block, const ContourLevels& levels,
                                                       std::int64_t first, std::int64_t end);

/// Takes out what goes nowhere: points that repeat the one before, and ways there and back again. A line of
/// nothing else becomes empty.
/// \param closed  the last point is joined to the first one, which is not repeated
void remove_spikes(std::vector<Double2>& points, bool closed);

}  // namespace tessera
