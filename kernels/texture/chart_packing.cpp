#include "kernels/texture/chart_packing.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <stdexcept>

namespace tessera {
namespace {

constexpr std::uint32_t kMinPageSide = 16;  ///< cells
constexpr std::uint32_t kMaxRatio = 8;      ///< of the sides of a page
constexpr double kGoodShare = 0.72;         ///< a page that holds all that is left, so full, is the last one
constexpr double kFullShare = 0.7;          ///< a page so full is taken, whatever is left for the next
constexpr double kOfferedShare = 1.5;  ///< of a page's area is offered to it; what does not fit comes next
constexpr double kTightest = 0.97;     ///< no page gets fuller
constexpr std::uint64_t kManyPages = 4;
constexpr std::uint64_t kNoRows = ~std::uint64_t{0};

using Words = std::vector<std::uint64_t>;

/// To out: bit x where bit x + by of the row is set. Both end in a word that is zero; they may be the same.
void add_shifted(const Words& row, std::uint32_t by, Words& out) {
  const std::size_t skip = by / 64, shift = by % 64;
  const std::uint64_t* from = row.data() + skip;
  for (std::size_t w = 0; w + 1 + skip < row.size(); ++w)  // upwards: what is read is not yet changed
    out[w] |= from[w] >> shift | from[w + 1] << 1 << (63 - shift);
}

struct MaskRun {
  std::uint32_t row = 0, first = 0, length = 0;
};

std::vector<MaskRun> runs_of(const ChartMask& mask) {
  std::vector<MaskRun> runs;
  for (std::uint32_t y = 0; y < mask.height; ++y)
    for (std::uint32_t x = 0; x < mask.width;) {
      if (!mask.taken(x, y)) {
        ++x;
        continue;
      }
      const std::uint32_t first = x;
      while (x < mask.width && mask.taken(x, y)) ++x;
      runs.push_back({y, first, x - first});
    }
  // Long ones rule out most.
  std::stable_sort(runs.begin(), runs.end(),
                   [](const MaskRun& a, const MaskRun& b) { return a.length > b.length; });
  return runs;
}

class Page {
 public:
  Page(std::uint32_t width, std::uint32_t height)
      : width_(width),
        height_(height),
        words_((width + 63) / 64),
        bits_(words_ * height, 0),
        free_(height, width) {}

  /// The lowest, then leftmost place. \returns false where there is none
  bool find(const ChartMask& mask, const std::vector<MaskRun>& runs, std::uint32_t& at_x, std::uint32_t& at_y,
            std::uint32_t below) {
    if (mask.width > width_ || mask.height > height_) return false;
    Words blocked(words_ + 1), dilated(words_ + 1);
    const std::uint32_t last = width_ - mask.width;
    for (std::uint32_t y = full_rows_; y + mask.height <= height_ && y < below; ++y) {
      // Most rows of a page that is nearly full have no gap as long as they would have to.
      if (std::any_of(runs.begin(), runs.end(),
                      [&](const MaskRun& run) { return free_[y + run.row] < run.length; }))
        continue;
      std::fill(blocked.begin(), blocked.end(), 0);
      bool open = true;
      for (const MaskRun& run : runs) {
        dilate(&bits_[std::size_t{y + run.row} * words_], run.length, dilated);
        add_shifted(dilated, run.first, blocked);
        if (!(open = has_zero(blocked, last))) break;
      }
      if (!open) continue;
      at_x = first_zero(blocked), at_y = y;
      return true;
    }
    return false;
  }

  void put(const std::vector<MaskRun>& runs, std::uint32_t x, std::uint32_t y) {
    for (const MaskRun& run : runs)
      for (std::uint32_t i = 0; i < run.length; ++i) {
        const std::uint32_t at = x + run.first + i;
        bits_[std::size_t{y + run.row} * words_ + at / 64] |= std::uint64_t{1} << (at % 64);
      }
    for (const MaskRun& run : runs) free_[y + run.row] = longest_gap(y + run.row);
    while (full_rows_ < height_ && free_[full_rows_] == 0) ++full_rows_;
  }

 private:
  /// Bit x is set where any of the bits x .. x + length - 1 is.
  void dilate(const std::uint64_t* row, std::uint32_t length, Words& out) const {
    std::copy(row, row + words_, out.begin());
    for (std::uint32_t done = 1; done < length;) {
      const std::uint32_t step = std::min(done, length - done);
      add_shifted(out, step, out);
      done += step;
    }
  }
  static bool has_zero(const Words& bits, std::uint32_t last) {
    const std::size_t whole = (last + 1) / 64;
    for (std::size_t w = 0; w < whole; ++w)
      if (bits[w] != ~std::uint64_t{0}) return true;
    const std::uint32_t rest = (last + 1) % 64;
    return rest > 0 && (~bits[whole] & ((std::uint64_t{1} << rest) - 1)) != 0;
  }
  static std::uint32_t first_zero(const Words& bits) {
    std::size_t w = 0;
    while (bits[w] == ~std::uint64_t{0}) ++w;
    return static_cast<std::uint32_t>(64 * w) + static_cast<std::uint32_t>(std::countr_one(bits[w]));
  }
  /// Cells that are free side by side in a row.
  std::uint32_t longest_gap(std::uint32_t y) const {
    const std::uint64_t* row = &bits_[std::size_t{y} * words_];
    std::uint32_t gap = 0, longest = 0;
    for (std::uint32_t x = 0; x < width_; x += 64) {
      std::uint64_t bits = row[x / 64];
      for (auto left = static_cast<int>(std::min<std::uint32_t>(64, width_ - x)); left > 0;) {
        const int zeros = std::min(std::countr_zero(bits), left);
        gap += static_cast<std::uint32_t>(zeros);
        longest = std::max(longest, gap);
        left -= zeros;
        if (left == 0) break;
        bits >>= zeros;
        const int ones = std::countr_one(bits);
        gap = 0;
        left -= ones;
        if (left > 0) bits >>= ones;
      }
    }
    return longest;
  }

  std::uint32_t width_, height_;
  std::size_t words_;
  Words bits_;
  std::vector<std::uint32_t> free_;  ///< per row: longest_gap()
  std::uint32_t full_rows_ = 0;
};

/// A page with charts on it, and those that did not fit, in the order of their numbers.
struct FilledPage {
  PageSize size;
  std::vector<std::pair<std::uint32_t, ChartSpot>> placed;
  std::vector<std::uint32_t> left;
  std::uint64_t cells = 0;  ///< taken

  double share() const {
    return static_cast<double>(cells) / (static_cast<double>(size.width) * size.height);
  }
};

/// Rows of all cells, summed, of a mask at row y: how high its centre lies.
std::uint64_t sum_of_rows(const std::vector<MaskRun>& runs, std::uint32_t y) {
  std::uint64_t sum = 0;
  for (const MaskRun& run : runs) sum += std::uint64_t{run.length} * (y + run.row);
  return sum;
}

/// The first row at which a mask would lie no lower than that.
std::uint32_t highest_of(const std::vector<MaskRun>& runs, std::uint64_t sum) {
  constexpr std::uint32_t kAny = 0xffffffffu;
  if (sum == kNoRows) return kAny;
  std::uint64_t cells = 0;
  for (const MaskRun& run : runs) cells += run.length;
  const std::uint64_t own = sum_of_rows(runs, 0);
  return own >= sum ? 0 : static_cast<std::uint32_t>((sum - own + cells - 1) / cells);
}

/// In which order charts are put on a page: the largest first, by what they take, by their boxes, by the shorter or the
/// longer sides of those.
enum class ChartOrder : std::uint8_t { kCells, kBox, kShort, kLong };

std::uint64_t order_key(const ChartMask& chart, ChartOrder by) {
  const std::uint64_t low = std::min(chart.width, chart.height), high = std::max(chart.width, chart.height);
  switch (by) {
    case ChartOrder::kBox:
      return low * high;
    case ChartOrder::kShort:
      return low << 32 | chart.cells;
    case ChartOrder::kLong:
      return high << 32 | chart.cells;
    default:
      return chart.cells;
  }
}

FilledPage fill_with_charts(std::span<const ChartMask> charts, std::span<const std::uint32_t> offered,
                            const PageSize& size, const std::function<void()>& pause,
                            ChartOrder by = ChartOrder::kCells) {
  std::vector<std::uint32_t> order(offered.begin(), offered.end());
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return order_key(charts[a], by) > order_key(charts[b], by);
  });
  FilledPage out;
  out.size = size;
  Page page(size.width, size.height);
  for (const std::uint32_t c : order) {
    if (pause) pause();
    ChartSpot spot;
    std::vector<MaskRun> best;
    std::uint64_t lowest = kNoRows;
    ChartMask mask = charts[c];
    for (std::uint32_t turns = 0; turns < 4; ++turns) {
      if (turns > 0) mask = turned(mask);
      std::vector<MaskRun> runs = runs_of(mask);
      std::uint32_t x = 0, y = 0;
      if (!page.find(mask, runs, x, y, highest_of(runs, lowest))) continue;
      const std::uint64_t rows = sum_of_rows(runs, y);
      if (rows >= lowest) continue;
      lowest = rows;
      spot.x = x, spot.y = y, spot.turns = turns;
      best = std::move(runs);
    }
    if (best.empty()) {
      out.left.push_back(c);
      continue;
    }
    page.put(best, spot.x, spot.y);
    out.placed.emplace_back(c, spot);
    out.cells += charts[c].cells;
  }
  std::sort(out.left.begin(), out.left.end());
  return out;
}

/// The order that leaves the fewest cells, as soon as one leaves none.
FilledPage fill_with_all(std::span<const ChartMask> charts, std::span<const std::uint32_t> offered,
                         const PageSize& size, const std::function<void()>& pause) {
  FilledPage best;
  for (const ChartOrder by : {ChartOrder::kCells, ChartOrder::kBox, ChartOrder::kShort, ChartOrder::kLong}) {
    FilledPage filled = fill_with_charts(charts, offered, size, pause, by);
    if (best.placed.empty() || filled.cells > best.cells) best = std::move(filled);
    if (best.left.empty()) break;
  }
  return best;
}

std::uint64_t area_of(const PageSize& size) {
  return std::uint64_t{size.width} * size.height;
}

/// Squares and rectangles up to a square, by area, squares first.
std::vector<PageSize> page_sizes(std::uint32_t max_side) {
  std::vector<PageSize> sizes;
  for (std::uint32_t side = std::min(kMinPageSide, max_side); side <= max_side; side *= 2)
    for (std::uint32_t high = side; high <= max_side && high <= kMaxRatio * side; high *= 2)
      sizes.push_back({side, high});
  std::stable_sort(sizes.begin(), sizes.end(), [](const PageSize& a, const PageSize& b) {
    return area_of(a) != area_of(b) ? area_of(a) < area_of(b) : a.height < b.height;
  });
  return sizes;
}

}  // namespace

ChartMask chart_mask(const ChartRaster& raster, int cell) {
  ChartMask mask;
  mask.width = static_cast<std::uint32_t>((raster.width + cell - 1) / cell);
  mask.height = static_cast<std::uint32_t>((raster.height + cell - 1) / cell);
  const std::size_t words = (mask.width + 63) / 64;
  mask.bits.assign(words * mask.height, 0);
  for (int y = 0; y < raster.height; ++y)
    for (int x = 0; x < raster.width; ++x)
      if (raster.at(x, y) != ChartRaster::kEmpty) {
        const auto cx = static_cast<std::uint32_t>(x / cell), cy = static_cast<std::uint32_t>(y / cell);
        mask.bits[cy * words + cx / 64] |= std::uint64_t{1} << (cx % 64);
      }
  for (const std::uint64_t w : mask.bits) mask.cells += static_cast<std::uint32_t>(std::popcount(w));
  return mask;
}

ChartMask turned(const ChartMask& mask) {
  ChartMask out;
  out.width = mask.height, out.height = mask.width, out.cells = mask.cells;
  const std::size_t words = (out.width + 63) / 64;
  out.bits.assign(words * out.height, 0);
  for (std::uint32_t y = 0; y < mask.height; ++y)
    for (std::uint32_t x = 0; x < mask.width; ++x)
      if (mask.taken(x, y)) {
        const std::uint32_t to = mask.height - 1 - y;
        out.bits[std::size_t{x} * words + to / 64] |= std::uint64_t{1} << (to % 64);
      }
  return out;
}

std::optional<std::vector<ChartSpot>> pack_on_page(std::span<const ChartMask> charts, const PageSize& size,
                                                   const std::function<void()>& pause) {
  std::uint64_t cells = 0;
  for (const ChartMask& c : charts) cells += c.cells;
  if (static_cast<double>(cells) > kTightest * static_cast<double>(area_of(size))) return std::nullopt;
  std::vector<std::uint32_t> all(charts.size());
  std::iota(all.begin(), all.end(), 0u);
  const FilledPage filled = fill_with_all(charts, all, size, pause);
  if (!filled.left.empty()) return std::nullopt;
  std::vector<ChartSpot> spots(charts.size());
  for (const auto& [c, spot] : filled.placed) spots[c] = spot;
  return spots;
}

ChartPacking pack_charts(std::span<const ChartMask> charts, std::uint32_t max_side,
                         const std::function<void()>& pause, const std::function<void(std::size_t)>& packed) {
  ChartPacking out;
  out.spots.resize(charts.size());
  std::vector<std::uint32_t> queue(charts.size());
  std::iota(queue.begin(), queue.end(), 0u);
  const std::vector<PageSize> sizes = page_sizes(max_side);
  std::uint64_t area = 0;
  for (const ChartMask& c : charts) {
    if (std::max(c.width, c.height) > max_side)
      throw std::logic_error("packing: a chart is larger than a page");
    area += c.cells;
  }
  while (!queue.empty()) {
    std::uint32_t longest = 0, widest = 0;
    for (const std::uint32_t c : queue) {
      longest = std::max(longest, std::max(charts[c].width, charts[c].height));
      widest = std::max(widest, std::min(charts[c].width, charts[c].height));
    }
    const auto holds = [&](const PageSize& s) { return s.height >= longest && s.width >= widest; };
    FilledPage best;
    // All of it on one page that it fills well?
    for (const PageSize& s : sizes) {
      const double share = static_cast<double>(area) / static_cast<double>(area_of(s));
      if (!holds(s) || share > kTightest) continue;
      if (share < kGoodShare && area_of(s) > area_of(sizes.front())) break;
      best = fill_with_all(charts, queue, s, pause);
      if (best.left.empty() || best.share() >= kFullShare) break;
      best = {};
    }
    if (best.placed.empty()) {
      // Else the largest page that what is left can fill, or the smallest that holds its largest chart.
      const PageSize* size = nullptr;
      for (const PageSize& s : sizes)
        if (holds(s) && (size == nullptr || (area_of(s) <= area && area_of(s) > area_of(*size)))) size = &s;
      // While many pages are to come it is full enough, and its charts lie together.
      std::size_t count = queue.size();
      if (area > kManyPages * area_of(*size)) {
        count = 0;
        for (std::uint64_t sum = 0; count < queue.size(); ++count) {
          sum += charts[queue[count]].cells;
          if (static_cast<double>(sum) > kOfferedShare * static_cast<double>(area_of(*size))) break;
        }
        count = std::max<std::size_t>(count, 1);
      }
      best = fill_with_charts(charts, std::span(queue).first(count), *size, pause);
      best.left.insert(best.left.end(), queue.begin() + static_cast<std::ptrdiff_t>(count), queue.end());
    }
    for (auto& [c, spot] : best.placed) {
      spot.page = static_cast<std::uint32_t>(out.pages.size());
      out.spots[c] = spot;
    }
    out.pages.push_back(best.size);
    queue = std::move(best.left);
    area -= best.cells;
    if (packed) packed(charts.size() - queue.size());
  }
  return out;
}

}  // namespace tessera
