/// \file chart_packing.h
/// Charts packed into pages whose sides are powers of two, by their shapes, not their boxes.
///
/// Shapes are masks of square cells. The first page in the order of sizes is filled with charts in the order given, as many
/// as it is likely to hold, large ones first, each at the lowest and then leftmost place where it fits ("bottom left", Baker,
/// Coffman, Rivest 1980, on bits; Levy et al. 2002 pack horizons), as it is or turned by right angles, so that its centre is
/// lowest. What does not fit comes first on the next page. A page that all that is left nearly fills is tried in several
/// orders. The last pages are as small as what is left, and up to eight times as high as wide.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "kernels/texture/chart_raster.h"

namespace tessera {

/// Cells that a chart with its margin takes.
struct ChartMask {
  std::uint32_t width = 0, height = 0;  ///< cells
  std::uint32_t cells = 0;              ///< taken
  std::vector<std::uint64_t> bits;      ///< rows of (width + 63) / 64 words
  [[nodiscard]] bool taken(std::uint32_t x, std::uint32_t y) const {
    return bits[std::size_t{y} * ((width + 63) / 64) + x / 64] >> (x % 64) & 1;
  }
};
/// \param cell  texels of a side of a cell, >= 1
[[nodiscard]] ChartMask chart_mask(const ChartRaster& raster, int cell);
/// Turned by a right angle counter-clockwise: cell (x, y) of n x m becomes (m - 1 - y, x).
[[nodiscard]] ChartMask turned(const ChartMask& mask);

struct ChartSpot {
  std::uint32_t page = 0;
  std::uint32_t x = 0, y = 0;  ///< cells, of the low corner of the mask
  std::uint32_t turns = 0;     ///< right angles, counter-clockwise
};
struct PageSize {
  std::uint32_t width = 0, height = 0;  ///< cells
};
struct ChartPacking {
  std::vector<ChartSpot> spots;  ///< per chart
  std::vector<PageSize> pages;
};

/// \param max_side  cells, a power of two; no mask is wider or higher
/// \param pause     called before every trial of a chart; may throw to end
/// \param packed    called after every page with the number of charts that lie on pages
/// \throws std::logic_error for a mask that fits no page
[[nodiscard]] ChartPacking pack_charts(std::span<const ChartMask> charts, std::uint32_t max_side,
                                       const std::function<void()>& pause = {},
                                       const std::function<void(std::size_t)>& packed = {});

/// All charts on one page of this size, by the first of several orders that holds them; nothing where none does.
std::optional<std::vector<ChartSpot>> pack_on_page(std::span<const ChartMask> charts, const PageSize& size,
                                                   const std::function<void()>& pause = {});

}  // namespace tessera
