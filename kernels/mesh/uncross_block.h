/// \file uncross_block.h
/// Takes back, in a block of an extracted surface, what made faces cross: vertices that were moved off their cells.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// Where a vertex of a block would lie within its cell.
struct SafePlace {
  std::uint64_t key = 0;
  Double3 at{};
};

struct Uncrossed {
  std::vector<SafePlace> returned;  ///< vertices that lie at their safe places now, keys ascending
  std::size_t pairs = 0;            ///< of faces that crossed or overlapped before
};

/// Moves the vertices of a block to these places, those of them that it has.
/// \param places  keys ascending
void take_back(MeshBlock& block, std::span<const SafePlace> places);

/// Moves the corners of faces that cross others to their safe places, in a few rounds.
/// \param block     canonical, its faces not risky (risky_crossings.h) but for those at moved vertices
/// \param safe      of the vertices that were moved, keys ascending; those that the block does not have count for nothing
/// \param complete  per vertex: others stay where they are, other blocks hold faces at them (complete_stars)
/// \param cell      edge of the cells, scan units
/// \post  nothing else of the block changes; a pure function of the block and what it may take back
/// \cost  O(n) time, and n log n in what is compared; at most 212 bytes a face and 3 MiB
Uncrossed uncross_block(MeshBlock& block, std::span<const SafePlace> safe,
                        std::span<const std::uint8_t> complete, double cell);

}  // namespace tessera
