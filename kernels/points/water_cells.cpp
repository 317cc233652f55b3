#include "kernels/points/water_cells.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <utility>

#include "kernels/points/ground_filter.h"

namespace tessera {
namespace {

constexpr int kOtherShare = 16, kShownShare = 20;  ///< one cell of so many
constexpr int kMinShown = 4;
constexpr std::size_t kLevelTenths = 9;
constexpr int kBankCells = 3;  ///< water ends within so many cells at land
constexpr int kMinBanks = 6;
constexpr std::array<std::pair<int, int>, 8> kWays = {
    {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}}};

class WaterSearch {
 public:
  WaterSearch(std::span<const std::int32_t> lowest, std::span<const std::uint32_t> counts, int width,
              int height, const WaterRules& rules)
      : lowest_(lowest), counts_(counts), width_(width), height_(height), rules_(rules) {}

  std::vector<std::uint8_t> find() {
    std::vector<std::uint8_t> water(lowest_.size(), 0);
    if (rules_.width <= 0 || width_ < rules_.width || height_ < rules_.width) return water;
    mark_shown();
    other_ = sums([&](std::size_t i) { return !is_sparse(i); });
    shown_sums_ = sums([&](std::size_t i) { return shown_[i] != 0; });
    level_.assign(lowest_.size(), kNoGround);
    fullest_.assign(lowest_.size(), 0);
    for (int v = 0; v + rules_.width <= height_; ++v)
      for (int u = 0; u + rules_.width <= width_; ++u) mark_square(u, v);
    other_ = {}, shown_sums_ = {}, shown_ = {};
    for (int v = 0; v < height_; ++v)
      for (int u = 0; u < width_; ++u)
        if (level_[at(u, v)] != kNoGround && has_banks(u, v)) water[at(u, v)] = 1;
    return without_specks(water);
  }

 private:
  std::size_t at(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(u);
  }
  bool holds(int u, int v) const { return u >= 0 && v >= 0 && u < width_ && v < height_; }
  bool is_sparse(std::size_t i) const { return static_cast<double>(counts_[i]) <= rules_.max_count; }

  void mark_shown() {
    shown_.assign(lowest_.size(), 0);
    for (int v = 0; v < height_; ++v)
      for (int u = 0; u < width_; ++u) {
        if (lowest_[at(u, v)] == kNoGround || !is_sparse(at(u, v))) continue;
        const bool alone = std::all_of(kWays.begin(), kWays.end(), [&](const auto& way) {
          const int x = u + way.first, y = v + way.second;
          return !holds(x, y) || is_sparse(at(x, y));
        });
        shown_[at(u, v)] = alone ? 1 : 0;
      }
  }

  /// Of all cells left of and above a corner.
  template <class Counts>
  std::vector<std::uint32_t> sums(const Counts& counts) const {
    const auto wide = static_cast<std::size_t>(width_) + 1;
    std::vector<std::uint32_t> sum(wide * (static_cast<std::size_t>(height_) + 1), 0);
    for (int v = 0; v < height_; ++v) {
      std::uint32_t row = 0;
      for (int u = 0; u < width_; ++u) {
        row += counts(at(u, v)) ? 1 : 0;
        const std::size_t i = static_cast<std::size_t>(v + 1) * wide + static_cast<std::size_t>(u) + 1;
        sum[i] = sum[i - wide] + row;
      }
    }
    return sum;
  }
  int in_square(const std::vector<std::uint32_t>& sum, int u, int v) const {
    const auto wide = static_cast<std::size_t>(width_) + 1, side = static_cast<std::size_t>(rules_.width);
    const std::size_t low = static_cast<std::size_t>(v) * wide + static_cast<std::size_t>(u),
                      high = low + side * wide;
    return static_cast<int>(sum[high + side] - sum[high] - sum[low + side] + sum[low]);
  }

  /// Cells of a level square get its height and its points, of several squares the least and the most.
  void mark_square(int u, int v) {
    const int cells = rules_.width * rules_.width;
    if (in_square(other_, u, v) * kOtherShare > cells) return;
    if (in_square(shown_sums_, u, v) < std::max(kMinShown, cells / kShownShare)) return;
    heights_.clear();
    std::uint64_t points = 0;
    for (int y = v; y < v + rules_.width; ++y)
      for (int x = u; x < u + rules_.width; ++x) {
        points += counts_[at(x, y)];
        if (shown_[at(x, y)] != 0) heights_.push_back(lowest_[at(x, y)]);
      }
    const auto middle = heights_.begin() + static_cast<std::ptrdiff_t>(heights_.size() / 2);
    std::nth_element(heights_.begin(), middle, heights_.end());
    const std::int32_t median = *middle;
    const auto level =
        static_cast<std::size_t>(std::count_if(heights_.begin(), heights_.end(), [&](std::int32_t h) {
          return 2 * std::abs(h - median) <= rules_.relief;
        }));
    if (10 * level < kLevelTenths * heights_.size()) return;
    for (int y = v; y < v + rules_.width; ++y)
      for (int x = u; x < u + rules_.width; ++x) {
        const std::size_t i = at(x, y);
        if (!is_sparse(i)) continue;
        if (level_[i] == kNoGround || median < level_[i]) level_[i] = median;
        fullest_[i] = std::max(fullest_[i], points);
      }
  }

  /// Where walls and parked cars stand for land a few cells of a road may have banks, but not half of a square.
  std::vector<std::uint8_t> without_specks(const std::vector<std::uint8_t>& water) const {
    const std::vector<std::uint32_t> wet = sums([&](std::size_t i) { return water[i] != 0; });
    std::vector<std::uint8_t> kept(water.size(), 0);
    for (int v = 0; v + rules_.width <= height_; ++v)
      for (int u = 0; u + rules_.width <= width_; ++u) {
        if (2 * in_square(wet, u, v) < rules_.width * rules_.width) continue;
        for (int y = v; y < v + rules_.width; ++y)
          for (int x = u; x < u + rules_.width; ++x) kept[at(x, y)] = water[at(x, y)];
      }
    return kept;
  }

  bool has_banks(int u, int v) const {
    return std::count_if(kWays.begin(), kWays.end(), [&](const auto& way) {
             return leads_to_bank(u, v, way.first, way.second);
           }) >= kMinBanks;
  }
  bool leads_to_bank(int u, int v, int du, int dv) const {
    int k = 1;
    for (; k <= rules_.reach; ++k) {
      if (!holds(u + k * du, v + k * dv)) return false;
      if (!is_sparse(at(u + k * du, v + k * dv))) break;
    }
    if (k > rules_.reach) return level_[at(u + rules_.reach * du, v + rules_.reach * dv)] != kNoGround;
    const std::size_t from = at(u, v);
    const double cells = static_cast<double>(rules_.width) * rules_.width;
    const double land = static_cast<double>(fullest_[from]) / (cells * rules_.density);
    for (int end = k + kBankCells; k < end && holds(u + k * du, v + k * dv); ++k) {
      const std::size_t i = at(u + k * du, v + k * dv);
      if (static_cast<double>(counts_[i]) >= land) return lowest_[i] >= level_[from] - rules_.relief;
    }
    return false;
  }

  std::span<const std::int32_t> lowest_;
  std::span<const std::uint32_t> counts_;
  int width_, height_;
  WaterRules rules_;
  std::vector<std::uint8_t> shown_;
  std::vector<std::uint32_t> other_, shown_sums_;
  std::vector<std::int32_t> level_, heights_;
  std::vector<std::uint64_t> fullest_;  ///< points of a square
};

}  // namespace

std::vector<std::uint8_t> find_water(std::span<const std::int32_t> lowest,
                                     std::span<const std::uint32_t> counts, int width, int height,
                                     const WaterRules& rules) {
  return WaterSearch(lowest, counts, width, height, rules).find();
}

}  // namespace tessera
