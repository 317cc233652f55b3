/// \file orient_needs.h
/// Memory and disk of orientation, told before there are patches.
#pragma once
#include <cstdint>

namespace tessera {

struct OrientNeeds {
  std::uint64_t links_task = 0, links_finish = 0, links_disk = 0;
  std::uint64_t task = 0, finish = 0;
};

/// \param bricks, blocks  occupied ones of the scan, blocks of 8^3 cells \param max_blocks  of the fullest brick
/// \param noise_cells  of the points off their planes \param in_blocks  patches know their sides
OrientNeeds orient_needs(std::uint64_t bricks, std::uint64_t blocks, std::uint64_t max_blocks,
                         double noise_cells, bool in_blocks);

}  // namespace tessera
