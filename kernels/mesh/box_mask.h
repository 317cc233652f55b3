/// \file box_mask.h
/// A grid of cells over a box, to pick what comes near something: boxes are marked, then boxes are asked.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// Per point the sides of a box that it lies beyond: bit k below along axis k, bit 3 + k above. The box of some points lies in
/// it where none has a bit, and apart from it where all share one.
[[nodiscard]] std::vector<std::uint8_t> beyond_sides(std::span<const Double3> points, const Double3& low,
                                                     const Double3& high);

class BoxMask {
 public:
  /// \param cells  along each axis, 1 to 64. What lies outside counts with the nearest cell.
  BoxMask(const Double3& low, const Double3& high, std::size_t cells)
      : low_(low), cells_(cells), rows_(cells * cells) {
    for (std::size_t k = 0; k < 3; ++k)
      per_cell_[k] = high[k] > low[k] ? static_cast<double>(cells) / (high[k] - low[k]) : 0.0;
  }
  void mark(const Double3& low, const Double3& high) {
    const Range r = range(low, high);
    for (std::size_t z = r.from[2]; z <= r.to[2]; ++z)
      for (std::size_t y = r.from[1]; y <= r.to[1]; ++y) rows_[z * cells_ + y] |= r.along_x;
  }
  /// Whether a cell of the box is marked: true wherever the box meets a marked one.
  [[nodiscard]] bool meets(const Double3& low, const Double3& high) const { return meets(range(low, high)); }
  /// Whether all cells of the box are marked: then every box in it meets one.
  [[nodiscard]] bool covers(const Double3& low, const Double3& high) const {
    const Range r = range(low, high);
    for (std::size_t z = r.from[2]; z <= r.to[2]; ++z)
      for (std::size_t y = r.from[1]; y <= r.to[1]; ++y)
        if ((rows_[z * cells_ + y] & r.along_x) != r.along_x) return false;
    return true;
  }
  /// Numbers of the faces whose box meets a marked cell, ascending: asked for all at once a point is placed only once.
  [[nodiscard]] std::vector<std::uint32_t> faces_that_meet(
      std::span<const Double3> points, std::span<const std::array<std::uint32_t, 3>> faces) const;

 private:
  struct Range {
    std::array<std::size_t, 3> from, to;  ///< both inclusive
    std::uint64_t along_x;                ///< a bit for each cell
  };
  [[nodiscard]] bool meets(const Range& r) const {
    for (std::size_t z = r.from[2]; z <= r.to[2]; ++z)
      for (std::size_t y = r.from[1]; y <= r.to[1]; ++y)
        if (rows_[z * cells_ + y] & r.along_x) return true;
    return false;
  }
  Range range(const Double3& low, const Double3& high) const {
    Range r;
    const double last = static_cast<double>(cells_) - 0.5;
    for (std::size_t k = 0; k < 3; ++k) {
      r.from[k] = static_cast<std::size_t>(std::clamp((low[k] - low_[k]) * per_cell_[k], 0.0, last));
      r.to[k] = static_cast<std::size_t>(std::clamp((high[k] - low_[k]) * per_cell_[k], 0.0, last));
    }
    r.along_x = bits(r.from[0], r.to[0]);
    return r;
  }
  static std::uint64_t bits(std::size_t from, std::size_t to) {
    return ~std::uint64_t{0} >> (63 - to) & ~std::uint64_t{0} << from;
  }

  Double3 low_{}, per_cell_{};
  std::size_t cells_;
  std::vector<std::uint64_t> rows_;  ///< cells along x as bits
};

}  // namespace tessera
