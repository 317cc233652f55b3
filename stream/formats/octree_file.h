/// \file octree_file.h
/// A distance field as octrees (kernels/solid/distance_octree.h), the file of `field --tolerance`: a header, then for every
/// cube a record, a bit for every node (in words of 64) and eight floats for every cell. Little-endian, as in memory.
#pragma once
#include <array>
#include <cstdint>

#include "octree/lattice.h"

namespace tessera {

struct OctreeFileHeader {
  std::array<char, 8> magic = {'T', 'S', 'D', 'I', 'S', 'O', 'C', '1'};
  double h = 0.0;          ///< edge of a cell of the lattice
  Double3 origin{};        ///< of node (0, 0, 0)
  double tolerance = 0.0;  ///< units of the meshes, as h
};

struct OctreeRecord {
  Int3 corner{};          ///< of the cube, nodes
  std::int32_t edge = 0;  ///< cells
  std::uint64_t nodes = 0, cells = 0;
};
static_assert(sizeof(OctreeFileHeader) == 48 && sizeof(OctreeRecord) == 32);

}  // namespace tessera
