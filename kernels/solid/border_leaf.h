/// \file border_leaf.h
/// What a border makes of winding numbers (border_winding.h) at the nodes of one leaf: edges near it are summed at the nodes, a
/// row at a time, all others by way of border_points.h. Of edges behind it whose ribbons pass near these are ribbons to the
/// other side, and endless strips make up for it.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/solid/border_region.h"

namespace tessera {

class BorderLeaf {
 public:
  /// \param border  must outlive this  \param region  of the border, that holds the leaf
  /// \param corner  node of the leaf with the least coordinates
  BorderLeaf(const BorderWinding& border, const BorderRegion& region, const Int3& corner);
  /// Share of the winding number at node x + 8 y + 64 z; its row is summed up when first asked for.
  double at(std::size_t node);

 private:
  static constexpr std::size_t kPoints = BorderPoints::kPoints;
  /// Of the eight nodes along an edge.
  static const std::array<BorderPoints::Weights, 8>& weights();
  void sum_row(std::size_t row);
  void sum_strips(std::size_t z);

  const BorderWinding& border_;
  Int3 corner_;
  std::vector<std::uint32_t> near_;    ///< edges
  std::vector<std::uint32_t> behind_;  ///< edges that endless strips belong to
  std::array<double, 64> strips_{};    ///< half of their solid angles by row
  std::uint32_t strips_summed_ = 0;    ///< planes of rows
  BorderPoints smooth_;                ///< solid angles
  std::array<double, 512> share_;
  std::uint64_t summed_ = 0;  ///< rows
};

}  // namespace tessera
