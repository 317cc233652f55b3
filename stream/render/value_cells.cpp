#include "stream/render/value_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace tessera {
namespace {

constexpr unsigned kStepBits = 26;  ///< of the longest side: 2^38 points can be summed
constexpr unsigned kCellBits = 10;  ///< at first: no picture shows more cells in a row
constexpr unsigned kIndexBits = 21;
constexpr std::uint64_t kIndexMask = (std::uint64_t{1} << kIndexBits) - 1;
constexpr std::size_t kSlots = 2 * ValueCells::kMaxCells;
constexpr double kApart = 0.05;  ///< of the longest side, between worst places

std::uint64_t parent_key(std::uint64_t key) {
  std::uint64_t parent = 0;
  for (unsigned a = 0; a < 3; ++a)
    parent |= ((key >> (a * kIndexBits) & kIndexMask) >> 1) << (a * kIndexBits);
  return parent;
}

}  // namespace

ValueCells::ValueCells(const Double3& low, const Double3& high, double max_value, std::size_t max_cells)
    : low_(low), high_(high), max_cells_(max_cells) {
  double longest = 0.0;
  for (std::size_t a = 0; a < 3; ++a) longest = std::max(longest, high[a] - low[a]);
  if (longest > 0.0) step_ = std::ldexp(longest, -static_cast<int>(kStepBits));
  value_step_ = std::ldexp(max_value, -24);
  shift_ = kStepBits - kCellBits;
  cells_.reserve(max_cells_);
  slots_.resize(kSlots);
}

std::uint64_t ValueCells::bytes() {
  return kMaxCells * (sizeof(Cell) + sizeof(ValueCell)) + kSlots * sizeof(std::uint32_t);
}

bool ValueCells::is_worse(const WorstPlace& a, const WorstPlace& b) {
  const double x = std::abs(a.value), y = std::abs(b.value);
  if (x != y) return x > y;
  if (a.value != b.value) return a.value > b.value;
  return a.at < b.at;
}

void ValueCells::merge(Cell& into, const Cell& cell) {
  if (cell.valued > 0 && (into.valued == 0 || is_worse(cell.worst, into.worst))) into.worst = cell.worst;
  into.points += cell.points, into.valued += cell.valued, into.value += cell.value;
  for (std::size_t a = 0; a < 3; ++a) into.sum[a] += cell.sum[a];
}

std::uint32_t& ValueCells::slot_of(std::uint64_t key) {
  std::size_t slot = static_cast<std::size_t>((key * 0x9e3779b97f4a7c15u) >> 40) % kSlots;
  while (slots_[slot] != 0 && cells_[slots_[slot] - 1].key != key) slot = (slot + 1) % kSlots;
  return slots_[slot];
}

void ValueCells::add(const Double3& p, double value) {
  Cell cell;
  for (std::size_t a = 0; a < 3; ++a) {
    if (p[a] < low_[a] || p[a] > high_[a]) return;
    cell.sum[a] = static_cast<std::uint64_t>((p[a] - low_[a]) / step_);
    cell.key |= (cell.sum[a] >> shift_) << (a * kIndexBits);
  }
  cell.points = 1;
  if (!std::isnan(value)) {
    cell.valued = 1;
    cell.value = std::llround(value / value_step_);
    cell.worst = {p, value};
  }
  std::uint32_t* slot = &slot_of(cell.key);
  if (*slot == 0 && cells_.size() == max_cells_) {
    while (cells_.size() == max_cells_) coarsen(), cell.key = parent_key(cell.key);
    slot = &slot_of(cell.key);
  }
  if (*slot != 0) return merge(cells_[*slot - 1], cell);
  cells_.push_back(cell);
  *slot = static_cast<std::uint32_t>(cells_.size());
}

/// Cells of twice the edge, in the place of those there were.
void ValueCells::coarsen() {
  ++shift_;
  std::fill(slots_.begin(), slots_.end(), 0u);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    Cell cell = cells_[i];
    cell.key = parent_key(cell.key);
    std::uint32_t& slot = slot_of(cell.key);
    if (slot != 0) {
      merge(cells_[slot - 1], cell);
    } else {
      cells_[kept++] = cell;
      slot = static_cast<std::uint32_t>(kept);
    }
  }
  cells_.resize(kept);
}

std::vector<WorstPlace> ValueCells::worst_places() {
  std::sort(cells_.begin(), cells_.end(), [](const Cell& a, const Cell& b) {
    if ((a.valued > 0) != (b.valued > 0)) return a.valued > 0;
    return a.valued > 0 ? is_worse(a.worst, b.worst) : a.key < b.key;
  });
  const double apart = kApart * std::ldexp(step_, kStepBits);
  std::vector<WorstPlace> worst;
  for (const Cell& cell : cells_) {
    if (worst.size() == kWorstPlaces || cell.valued == 0 || cell.worst.value == 0.0) break;
    const bool clear = std::all_of(worst.begin(), worst.end(), [&](const WorstPlace& w) {
      return squared_distance(w.at, cell.worst.at) >= apart * apart;
    });
    if (clear) worst.push_back(cell.worst);
  }
  return worst;
}

ValueMap ValueCells::finish() {
  ValueMap map;
  map.cell = std::ldexp(step_, static_cast<int>(shift_));
  map.worst = worst_places();
  std::sort(cells_.begin(), cells_.end(), [](const Cell& a, const Cell& b) { return a.key < b.key; });
  map.cells.reserve(cells_.size());
  for (const Cell& cell : cells_) {
    ValueCell out;
    for (std::size_t a = 0; a < 3; ++a)
      out.centre[a] =
          low_[a] + step_ * (static_cast<double>(cell.sum[a]) / static_cast<double>(cell.points) + 0.5);
    out.mean = cell.valued > 0
                   ? value_step_ * static_cast<double>(cell.value) / static_cast<double>(cell.valued)
                   : std::numeric_limits<double>::quiet_NaN();
    map.cells.push_back(out);
  }
  cells_ = {}, slots_ = {};
  return map;
}

}  // namespace tessera
