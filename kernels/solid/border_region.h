/// \file border_region.h
/// What a border makes of winding numbers in a cube of 8^3 leaves, summed once for all of them: only what is near is left to
/// each leaf.
#pragma once
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "kernels/solid/border_points.h"

namespace tessera {

class BorderRegion {
 public:
  static constexpr int kLeaves = 8;  ///< along an edge
  /// \param corner  node of the region with the least coordinates
  BorderRegion(const BorderWinding& border, const Int3& corner);

  /// Solid angles of all clusters but these.
  [[nodiscard]] const BorderPoints& far() const { return far_; }
  /// Clusters that are not in far(), as numbers of BorderWinding::clusters().
  [[nodiscard]] std::span<const std::uint32_t> near() const { return near_; }
  /// BorderWinding::change() of the whole region.
  [[nodiscard]] double change() const { return change_; }

 private:
  BorderPoints far_;
  std::vector<std::uint32_t> near_;
  double change_;
};

/// The regions of one border around a block, kept from leaf to leaf. They lie on the lattice, not on the block.
class BorderRegions {
 public:
  /// \param leaf  global, in leaves  \returns a reference that holds until the next is asked for
  const BorderRegion& of(const BorderWinding& border, const Int3& leaf);

  /// About what they hold at most.
  static constexpr std::uint64_t kBytes = std::uint64_t{128} << 10;

 private:
  static constexpr std::size_t kMax = 32;  ///< a brick and those around it
  std::map<Int3, BorderRegion> regions_;   ///< by their corners, in regions
};

}  // namespace tessera
