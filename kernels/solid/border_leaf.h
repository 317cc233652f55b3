/// \file border_leaf.h
/// What a border makes of winding numbers (border_winding.h) at the nodes of one leaf.
///
/// Ribbons that pass farther than kSmooth cells from the leaf's middle make a harmonic function without poles near it:
/// it is summed at 4^3 Chebyshev points, edge by edge or by clusters, and interpolated (Fong, Darve, "The black-box fast
/// multipole method", 2009). The others are summed at the nodes, a row at a time.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/solid/border_winding.h"
#include "octree/lanes.h"

namespace tessera {

class BorderLeaf {
 public:
  /// \param border  must outlive this  \param corner  node of the leaf with the least coordinates
  BorderLeaf(const BorderWinding& border, const Int3& corner);
  /// Share of the winding number at node x + 8 y + 64 z; its row is summed up when first asked for.
  double at(std::size_t node);

 private:
  static constexpr std::size_t kPoints = 4;
  static constexpr std::array<std::int64_t, kPoints> kNodes = {1091, 8850, 19822,
                                                               27581};  ///< quanta from the corner
  /// Lagrange's polynomials of the points at the eight nodes.
  static const std::array<std::array<double, kPoints>, 8>& weights();

  static constexpr double node(std::size_t point) {
    return static_cast<double>(kNodes[point]) / static_cast<double>(kSolidQuanta);
  }
  double row_y(std::size_t row) const { return corner_[1] + node(row % kPoints); }
  double row_z(std::size_t row) const { return corner_[2] + node(row / kPoints); }
  /// x seen from the points of a row.
  Double4 points_from(double x) const;
  void add_cluster(const BorderWinding::Cluster& cluster);
  void add_edge(const Double3& middle, const Double3& edge, double count);
  void sum_row(std::size_t row);

  const BorderWinding& border_;
  Int3 corner_;
  std::vector<std::uint32_t> near_;                           ///< edges
  std::array<double, kPoints * kPoints * kPoints> smooth_{};  ///< solid angles
  std::array<double, 512> share_;
  std::uint64_t summed_ = 0;  ///< rows
};

}  // namespace tessera
