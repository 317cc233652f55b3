/// \file sample_list.h
/// Oriented points around one leaf, structure of arrays, in canonical order.
///
/// Positions are relative to the leaf's min corner. Leaves are aligned to the lattice and positions are
/// multiples of 1/1024 cell, so they are exact and the same for every block that holds the leaf.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernels/field/point_leaves.h"
#include "octree/lanes.h"

namespace tessera {

struct SampleList {
  std::vector<float> x, y, z, nx, ny, nz;
  std::vector<std::uint32_t> point;  ///< index into the block, for attributes
  std::size_t size = 0;              ///< the arrays are longer: room for a whole register after the end

  /// Makes room for `n` samples and one register more; keeps nothing.
  void reserve(std::size_t n);
};

/// Axis-aligned box, cells, relative to the leaf.
struct SampleBox {
  float low[3];
  float high[3];
};

/// Gathers the points with normal that lie strictly inside `box`, from the 27 leaves around leaf (i, j, k):
/// neighbours x fastest, canonical order in each.
/// \pre the box reaches less than one leaf beyond the leaf
void gather_samples(const PointBlock& points, const PointLeaves& leaves, int i, int j, int k,
                    const SampleBox& box, SampleList& out);
/// The same of all points, whether they have a normal or not.
void gather_all(const PointBlock& points, const PointLeaves& leaves, int i, int j, int k,
                const SampleBox& box, SampleList& out);

}  // namespace tessera
