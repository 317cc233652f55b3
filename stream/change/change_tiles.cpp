#include "stream/change/change_tiles.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr int kKeyBits = 21;
constexpr std::size_t kMaxCells = 1u << 16;
constexpr std::uint64_t kMaxColumns = 1u << 22;  ///< of a tile, 16 MiB

std::uint64_t key_of(const Int3& cell) {
  std::uint64_t key = 0;
  for (std::size_t a = 3; a-- > 0;) key = key << kKeyBits | static_cast<std::uint64_t>(cell[a]);
  return key;
}

Int3 cell_of_key(std::uint64_t key) {
  Int3 cell{};
  for (std::size_t a = 0; a < 3; ++a, key >>= kKeyBits)
    cell[a] = static_cast<std::int32_t>(key & ((1u << kKeyBits) - 1));
  return cell;
}

Int3 coarse_cell(const Double3& p, double size) {
  Int3 cell{};
  for (std::size_t a = 0; a < 3; ++a)
    cell[a] = static_cast<std::int32_t>(
        std::clamp(std::floor(p[a] / size), 0.0, static_cast<double>((1 << kKeyBits) - 1)));
  return cell;
}

}  // namespace

void CloudCounts::add(std::size_t cloud, const Double3& p) {
  const std::uint64_t key = key_of(coarse_cell(p, size_));
  if (key != last_key_ || last_ == nullptr) {
    last_key_ = key, last_ = &counts_[key];
    if (counts_.size() > kMaxCells) {
      halve();
      return add(cloud, p);
    }
  }
  ++(*last_)[cloud];
}

void CloudCounts::halve() {
  std::unordered_map<std::uint64_t, std::array<std::uint64_t, 2>> coarser;
  for (const auto& [key, points] : counts_) {
    Int3 cell = cell_of_key(key);
    for (std::int32_t& c : cell) c >>= 1;
    std::array<std::uint64_t, 2>& sum = coarser[key_of(cell)];
    for (std::size_t k = 0; k < 2; ++k) sum[k] += points[k];
  }
  counts_ = std::move(coarser);
  size_ *= 2.0;
  last_ = nullptr;
}

std::vector<CloudCount> CloudCounts::cells() const {
  std::vector<CloudCount> cells;
  for (const auto& [key, points] : counts_)
    if (points[0] + points[1] > 0) cells.push_back({cell_of_key(key), points});
  std::sort(cells.begin(), cells.end(),
            [](const CloudCount& a, const CloudCount& b) { return a.cell < b.cell; });
  return cells;
}

ChangeTiles::ChangeTiles(const CloudCounts& counts, double halo, std::uint64_t target, double cell_size)
    : size_(counts.size()),
      halo_(halo),
      cell_size_(cell_size),
      target_(target),
      reach_(static_cast<std::int32_t>(std::min(std::ceil(halo / size_), 0x1p20))),
      cells_(counts.cells()) {
  std::vector<std::uint32_t> all(cells_.size());
  for (std::uint32_t k = 0; k < all.size(); ++k) all[k] = k;
  constexpr std::int32_t kEnd = 1 << kKeyBits;
  split({0, 0, 0}, {kEnd, kEnd, kEnd}, all);
}

bool ChangeTiles::near(const Int3& cell, const Int3& low, const Int3& high) const {
  for (std::size_t a = 0; a < 3; ++a)
    if (cell[a] < low[a] - reach_ || cell[a] >= high[a] + reach_) return false;
  return true;
}

std::uint64_t ChangeTiles::columns(const ChangeTile& tile) const {
  double product = 1.0;
  for (std::size_t a = 0; a < 2; ++a)
    product *=
        std::ceil((static_cast<double>(tile.high[a] - tile.low[a]) * size_ + 2.0 * halo_) / cell_size_) + 2.0;
  return static_cast<std::uint64_t>(std::min(product, 0x1p60));
}

/// \param around  cells that may be near to the box, ascending
void ChangeTiles::split(Int3 low, Int3 high, const std::vector<std::uint32_t>& around) {
  ChangeTile tile = {high, low, 0, {}};
  for (const std::uint32_t k : around) {
    const CloudCount& c = cells_[k];
    bool inside = c.points[0] > 0;
    for (std::size_t a = 0; a < 3; ++a) inside = inside && c.cell[a] >= low[a] && c.cell[a] < high[a];
    if (!inside) continue;
    for (std::size_t a = 0; a < 3; ++a) {
      tile.low[a] = std::min(tile.low[a], c.cell[a]);
      tile.high[a] = std::max(tile.high[a], c.cell[a] + 1);
    }
    tile.own += c.points[0];
  }
  if (tile.own == 0) return;
  std::vector<std::uint32_t> near_cells;
  for (const std::uint32_t k : around) {
    if (!near(cells_[k].cell, tile.low, tile.high)) continue;
    near_cells.push_back(k);
    for (std::size_t c = 0; c < 2; ++c) tile.loaded[c] += cells_[k].points[c];
  }
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (tile.high[a] - tile.low[a] > tile.high[axis] - tile.low[axis]) axis = a;
  const std::int32_t edge = tile.high[axis] - tile.low[axis];
  if (edge > 1 && (tile.loaded[0] + tile.loaded[1] > target_ || columns(tile) > kMaxColumns)) {
    Int3 middle_high = tile.high, middle_low = tile.low;
    middle_high[axis] = middle_low[axis] = tile.low[axis] + edge / 2;
    split(tile.low, middle_high, near_cells);
    split(middle_low, tile.high, near_cells);
    return;
  }
  for (const std::uint32_t k : near_cells)
    of_cell_[key_of(cells_[k].cell)].push_back(static_cast<std::uint32_t>(tiles_.size()));
  tiles_.push_back(tile);
}

Int3 ChangeTiles::cell_of(const Double3& p) const {
  return coarse_cell(p, size_);
}

bool ChangeTiles::owns(const ChangeTile& tile, const Double3& p) const {
  const Int3 cell = cell_of(p);
  for (std::size_t a = 0; a < 3; ++a)
    if (cell[a] < tile.low[a] || cell[a] >= tile.high[a]) return false;
  return true;
}

bool ChangeTiles::loads(const ChangeTile& tile, const Double3& p) const {
  for (std::size_t a = 0; a < 3; ++a)
    if (p[a] < tile.low[a] * size_ - halo_ || p[a] > tile.high[a] * size_ + halo_) return false;
  return true;
}

void ChangeTiles::enter(const Int3& cell) {
  last_cell_ = cell;
  const auto at = of_cell_.find(key_of(cell));
  last_ =
      at == of_cell_.end() ? std::span<const std::uint32_t>() : std::span<const std::uint32_t>(at->second);
}

}  // namespace tessera
