/// \file blend_field.h
/// Directed distances of overlapping meshes (merge_sheet.h) in one block of the lattice: what the one extractor takes.
/// Source: thesis 2.2, 4.2.1.
#pragma once
#include <functional>
#include <span>

#include "kernels/field/sampled_field.h"
#include "kernels/merge/merge_sheet.h"

namespace tessera {

struct BlendBlock {
  Lattice lattice;
  Double3 origin{};  ///< world, subtracted from all positions, the same for every block
  Int3 corner{};     ///< global node coordinates of the min corner, multiples of 64
  Int3 cells{};      ///< multiples of 64

  /// A node, or a point of the edge behind it, relative to the origin.
  [[nodiscard]] Double3 at(const Int3& node, std::size_t axis = 0, double t = 0.0) const;
};

/// Nodes where no mesh has a share are not valid.
/// \param leaves  relative to the block, in leaves, each coordinate within [-1, cells / 8], in any order, no repeats
/// \post values, signs and roots are pure functions of the node, the same for every block
DirectedField build_blend_field(const BlendBlock& block, std::span<const Int3> leaves,
                                const MergeBlend& blend, const std::function<void()>& pause = {});

}  // namespace tessera
