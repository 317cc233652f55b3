/// \file point_cells.h
/// The points of a block in the cells of a lattice through zero, so that those near a place are found column by column.
/// Within a cell they stand by position, so sums over cells hang on the points alone, not on the block or on the order in
/// which they came.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Sums over the points of a cell, relative to its centre.
struct CellMoments {
  double count = 0.0;
  Double3 sum{};
  double xx = 0.0, xy = 0.0, xz = 0.0, yy = 0.0, yz = 0.0, zz = 0.0;
};

/// A cell that holds points [begin, end).
struct PointCell {
  std::int32_t z = 0;  ///< in its column
  std::uint32_t begin = 0, end = 0;
  double radius = 0.0;  ///< of a ball that holds its points, around `middle`
  Double3 middle{};
  Double3 centre{};  ///< of the cell
};

class PointCells {
 public:
  /// \param points  fewer than 2^32, finite  \param size  of a cell, > 0; coordinates are below 2^30 of them
  /// \param moments  whether cells get them
  PointCells(std::span<const Double3> points, double size, bool moments);

  double size() const { return size_; }
  [[nodiscard]] std::size_t count() const { return x_.size(); }
  [[nodiscard]] bool empty() const { return x_.empty(); }
  [[nodiscard]] std::span<const double> x() const { return x_; }
  [[nodiscard]] std::span<const double> y() const { return y_; }
  [[nodiscard]] std::span<const double> z() const { return z_; }
  [[nodiscard]] Double3 position(std::size_t i) const { return {x_[i], y_[i], z_[i]}; }
  /// Of a point in cells, its index among those that came.
  [[nodiscard]] std::size_t source(std::size_t i) const { return source_[i]; }
  [[nodiscard]] std::span<const PointCell> cells() const { return cells_; }
  [[nodiscard]] const CellMoments& moments(std::size_t cell) const { return moments_[cell]; }

  /// The cell along an axis that holds a coordinate.
  [[nodiscard]] std::int32_t cell_of(double coordinate) const;
  /// What of a range of cells along x (0) or y (1) has columns; empty where the first is above the last.
  [[nodiscard]] std::array<std::int32_t, 2> columns_within(std::size_t axis,
                                                           const std::array<std::int32_t, 2>& range) const {
    return {std::max(range[0], first_[axis]), std::min(range[1], first_[axis] + columns_[axis] - 1)};
  }
  [[nodiscard]] bool is_empty(std::int32_t x, std::int32_t y) const {
    const std::size_t column = column_of(x, y);
    return column_begin_[column] == column_begin_[column + 1];
  }
  /// Calls use(k) for the cells k of a column whose z lies in [z_low, z_high], ascending. \pre there is such a column
  template <class Use>
  void for_column_cells(std::int32_t x, std::int32_t y, std::int32_t z_low, std::int32_t z_high,
                        const Use& use) const {
    const std::size_t column = column_of(x, y);
    const std::uint32_t end = column_begin_[column + 1];
    for (std::uint32_t k = first_cell(column, z_low); k < end && cells_[k].z <= z_high; ++k) use(k);
  }

  /// Memory of one with so many points and columns, while it is made.
  [[nodiscard]] static std::uint64_t bytes(std::uint64_t points, std::uint64_t columns, bool moments);

 private:
  std::size_t column_of(std::int32_t x, std::int32_t y) const {
    return static_cast<std::size_t>(x - first_[0]) * static_cast<std::size_t>(columns_[1]) +
           static_cast<std::size_t>(y - first_[1]);
  }
  /// Of a column, the first cell at z or above, or its end.
  std::uint32_t first_cell(std::size_t column, std::int32_t z) const {
    constexpr std::uint32_t kFew = 8;
    std::uint32_t begin = column_begin_[column], end = column_begin_[column + 1];
    while (end - begin > kFew) {
      const std::uint32_t middle = begin + (end - begin) / 2;
      if (cells_[middle].z < z) {
        begin = middle + 1;
      } else {
        end = middle;
      }
    }
    while (begin < end && cells_[begin].z < z) ++begin;
    return begin;
  }
  void sort_points(std::span<const Double3> points);
  void make_cells();
  void add_moments();

  double size_, per_unit_;
  std::array<std::int32_t, 2> first_{}, columns_{};
  std::vector<double> x_, y_, z_;
  std::vector<std::uint32_t> source_;
  std::vector<PointCell> cells_;
  std::vector<CellMoments> moments_;
  std::vector<std::uint32_t> column_begin_;  ///< of points while they are sorted, then of cells
};

}  // namespace tessera
