#include "stream/points/brick_histogram.h"

#include <algorithm>
#include <limits>
#include <string>

#include "octree/error.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

constexpr PackedKind kCountKind = {"TSCOUNT1", "a file of brick counts"};
// Two bricks of the lattice stay empty around the data: the origin lies one below, halo bricks exist above.
constexpr std::int64_t kMaxBricksPerAxis = (std::int64_t{1} << (kMaxCellBits - kBrickBits)) - 2;

constexpr std::size_t kFirstSlots = 256;

std::uint64_t brick_hash(const BrickCoord& b) {
  std::uint64_t v = static_cast<std::uint64_t>(b[0]) * 0x9e3779b97f4a7c15ULL;
  v ^= static_cast<std::uint64_t>(b[1]) * 0xc2b2ae3d27d4eb4fULL;
  v ^= static_cast<std::uint64_t>(b[2]) * 0x165667b19e3779f9ULL;
  v ^= v >> 29;
  v *= 0xbf58476d1ce4e5b9ULL;
  return v ^ v >> 32;
}

void combine(std::vector<BrickCount>& counts) {
  std::sort(counts.begin(), counts.end(),
            [](const BrickCount& a, const BrickCount& b) { return a.brick < b.brick; });
  std::size_t out = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (out == 0 || counts[out - 1].brick != counts[i].brick) {
      counts[out++] = counts[i];
      continue;
    }
    counts[out - 1].points += counts[i].points;
    for (std::size_t w = 0; w < counts[i].blocks.size(); ++w)
      counts[out - 1].blocks[w] |= counts[i].blocks[w];
  }
  counts.resize(out);
}

}  // namespace

BrickCounter::BrickCounter(const std::filesystem::path& file, std::size_t capacity)
    : file_(file, kCountKind, std::size_t{256} << 10), capacity_(capacity) {
  slots_.resize(kFirstSlots);
  last_.fill(std::numeric_limits<std::int64_t>::min());
}

std::size_t BrickCounter::slot_of(const BrickCoord& brick) const {
  std::size_t at = brick_hash(brick) & (slots_.size() - 1);
  while (slots_[at].points != 0 && slots_[at].brick != brick) at = (at + 1) & (slots_.size() - 1);
  return at;
}

void BrickCounter::find(const BrickCoord& brick) {
  std::size_t at = slot_of(brick);
  if (slots_[at].points == 0) {
    if (used_ == capacity_) {
      spill();
      at = slot_of(brick);
    } else if (2 * used_ >= slots_.size()) {
      grow();
      at = slot_of(brick);
    }
    slots_[at] = {brick, 0, {}};
    ++used_;
  }
  last_ = brick;
  last_slot_ = at;
}

void BrickCounter::grow() {
  std::vector<BrickCount> before(2 * slots_.size());
  before.swap(slots_);
  for (const BrickCount& count : before)
    if (count.points != 0) slots_[slot_of(count.brick)] = count;
}

void BrickCounter::spill() {
  std::vector<BrickCount> run;
  run.reserve(used_);
  for (BrickCount& s : slots_) {
    if (s.points != 0) run.push_back(s);
    s.points = 0;
  }
  used_ = 0;
  last_.fill(std::numeric_limits<std::int64_t>::min());
  combine(run);
  runs_.push_back(file_.append(bytes_of(run)));
}

std::uint64_t BrickCounter::finish() {
  spill();
  return file_.finish(runs_);
}

std::vector<BrickCount> merge_brick_counts(const std::vector<std::filesystem::path>& files,
                                           std::size_t max_bricks) {
  constexpr std::size_t kPart = std::size_t{1} << 14;
  std::vector<BrickCount> all;
  std::size_t distinct = 0;
  for (const auto& path : files) {
    const PackedFile file(path, kCountKind, sizeof(Section));
    for (const Section& run : file.table<Section>()) {
      SectionReader reader(file, run);
      while (reader.left() > 0 && distinct <= max_bricks) {
        const std::size_t before = all.size();
        all.resize(before + std::min<std::uint64_t>(kPart, reader.left() / sizeof(BrickCount)));
        reader.next(all.data() + before, (all.size() - before) * sizeof(BrickCount));
        if (all.size() > 2 * distinct + 4 * kPart) {
          combine(all);
          distinct = all.size();
        }
      }
    }
  }
  combine(all);
  if (all.size() > max_bricks)
    throw ResourceError(
        "the scan occupies more than " + std::to_string(max_bricks) +
        " bricks of 64^3 cells, more than the memory cap can index; choose a coarser --resolution "
        "or a larger --memory");
  return all;
}

namespace {

struct AxisRange {
  std::int64_t low = 0, median = 0, high = 0;  ///< 1 %, 50 %, 99 %
};

AxisRange quantiles(const std::vector<BrickCount>& bricks, std::size_t axis, std::uint64_t points) {
  std::vector<std::pair<std::int64_t, std::uint64_t>> marginal;
  marginal.reserve(bricks.size());
  for (const BrickCount& b : bricks) marginal.emplace_back(b.brick[axis], b.points);
  std::sort(marginal.begin(), marginal.end());
  const auto at = [&](std::uint64_t rank) {
    std::uint64_t seen = 0;
    for (const auto& [coordinate, count] : marginal) {
      seen += count;
      if (seen > rank) return coordinate;
    }
    return marginal.back().first;
  };
  return {at(points / 100), at(points / 2), at(points - 1 - points / 100)};
}

void shrink(BrickWindow& window, const std::vector<BrickCount>& bricks) {
  BrickWindow tight;
  tight.min.fill(std::numeric_limits<std::int64_t>::max());
  tight.max.fill(std::numeric_limits<std::int64_t>::min());
  for (const BrickCount& b : bricks) {
    if (!window.holds(b.brick)) {
      tight.dropped_points += b.points;
      continue;
    }
    for (std::size_t a = 0; a < 3; ++a) {
      tight.min[a] = std::min(tight.min[a], b.brick[a]);
      tight.max[a] = std::max(tight.max[a], b.brick[a]);
    }
  }
  window = tight;
}

std::int64_t extent(const BrickWindow& w) {
  std::int64_t e = 0;
  for (std::size_t a = 0; a < 3; ++a) e = std::max(e, w.max[a] - w.min[a] + 1);
  return e;
}

}  // namespace

BrickWindow robust_window(const std::vector<BrickCount>& bricks, double h) {
  std::uint64_t points = 0;
  for (const BrickCount& b : bricks) points += b.points;
  std::array<AxisRange, 3> range;
  std::int64_t body = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    range[a] = quantiles(bricks, a, points);
    body = std::max(body, range[a].high - range[a].low + 1);
  }
  const auto around_median = [&](std::int64_t half_width) {
    BrickWindow w;
    for (std::size_t a = 0; a < 3; ++a) {
      w.min[a] = range[a].median - half_width;
      w.max[a] = range[a].median + half_width;
    }
    shrink(w, bricks);
    return w;
  };
  BrickWindow window = around_median(1000 * body);
  if (extent(window) <= kMaxBricksPerAxis) return window;
  const BrickWindow widest = around_median(kMaxBricksPerAxis / 2 - 1);
  if (widest.dropped_points - window.dropped_points < points / 1000 + 1) return widest;
  const double smallest = h * static_cast<double>(extent(window)) / static_cast<double>(kMaxBricksPerAxis);
  throw InputError("the scan spans " + std::to_string(extent(window) * kBrickCells) +
                   " cells of the resolution, the lattice holds " +
                   std::to_string(kMaxBricksPerAxis * kBrickCells) + "; choose --resolution " +
                   number_text(round_up_2_digits(smallest)) + " or more, or reconstruct in parts");
}

std::array<std::int64_t, 2> occupied_heights(const std::vector<BrickCount>& bricks,
                                             const BrickWindow& window) {
  std::array<std::int64_t, 2> range = {std::numeric_limits<std::int64_t>::max(),
                                       std::numeric_limits<std::int64_t>::min()};
  for (const BrickCount& c : bricks) {
    if (!window.holds(c.brick)) continue;
    for (std::size_t layer = 0; layer < c.blocks.size(); ++layer) {
      if (c.blocks[layer] == 0) continue;
      const std::int64_t at =
          c.brick[2] * static_cast<std::int64_t>(c.blocks.size()) + static_cast<std::int64_t>(layer);
      range = {std::min(range[0], at), std::max(range[1], at + 1)};
    }
  }
  return range;
}

}  // namespace tessera
