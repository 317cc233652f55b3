/// \file column_filters.h
/// Filters over a square of columns of a scan seen from above: sums over boxes, dilation and erosion, medians. A column depends
/// on no more columns than the radius says. Sources: J. Serra, "Image Analysis and Mathematical Morphology", 1982; M. McGuire, "A
/// Fast, Small-Radius GPU Median Filter", 2008 (medians by forgetful selection, many columns side by side).
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernels/points/surface_model.h"

namespace tessera {

/// Columns of a square, u fastest.
struct ColumnSquare {
  int edge;
  [[nodiscard]] std::size_t at(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(edge) + static_cast<std::size_t>(u);
  }
};

/// Sums over squares of columns of this radius, cut off at the rim. \pre they fit in the type
[[nodiscard]] std::vector<std::int64_t> box_sums(ColumnSquare s, const std::vector<std::int64_t>& in,
                                                 int radius);
[[nodiscard]] std::vector<std::int32_t> box_sums(ColumnSquare s, const std::vector<std::int32_t>& in,
                                                 int radius);

/// Columns within `radius` of a set (chessboard); with `set` false of what is not in it, turned over: what is left of it.
[[nodiscard]] std::vector<std::uint8_t> dilate(ColumnSquare s, const std::vector<std::uint8_t>& mask,
                                               int radius, bool set = true);
[[nodiscard]] inline std::vector<std::uint8_t> erode(ColumnSquare s, const std::vector<std::uint8_t>& mask,
                                                     int radius) {
  return dilate(s, mask, radius, false);
}

/// As dilate(), within `radius` of an octagon, which is nearly a disk: a square of four tenths of it, and the rest by steps to the
/// four neighbours. What is closed by squares has the corners of the lattice.
[[nodiscard]] std::vector<std::uint8_t> dilate_round(ColumnSquare s, const std::vector<std::uint8_t>& mask,
                                                     int radius, bool set = true);

/// Lower median of the heights around every wanted column; the others keep theirs, and kNoHeight stays.
[[nodiscard]] std::vector<std::int32_t> median5(ColumnSquare s, const std::vector<std::int32_t>& height,
                                                const std::vector<std::uint8_t>& wanted);

/// The lowest or highest height within `radius` of the wanted columns; kNoHeight elsewhere, and where there is none.
[[nodiscard]] std::vector<std::int32_t> extreme_around(ColumnSquare s,
                                                       const std::vector<std::int32_t>& height,
                                                       const std::vector<std::uint8_t>& wanted, int radius,
                                                       bool highest);

}  // namespace tessera
