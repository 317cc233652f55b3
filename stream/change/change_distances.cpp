#include "stream/change/change_distances.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/change/core_points.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

/// Points to load with a tile: more would leave threads without work, fewer would be mostly halo.
constexpr std::uint64_t kMaxTarget = std::uint64_t{1} << 20, kMinTarget = std::uint64_t{1} << 14;
constexpr std::uint64_t kTilesPerThread = 4;
constexpr double kMaxLattice = 0x1p20;  ///< of the coarse lattice along an axis
constexpr std::size_t kSliceGroups = 128;

std::size_t bucket_bytes(std::uint64_t memory_bytes, std::size_t buckets) {
  return static_cast<std::size_t>(
      std::clamp<std::uint64_t>(memory_bytes / std::max<std::size_t>(1, buckets), 4096, 262144));
}

bool finite_point(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// Core points that lie close together and are looked up together.
struct CoreGroups {
  std::vector<std::uint32_t> point;  ///< in the cells
  std::vector<std::uint32_t> begin;  ///< of groups among them, and the end
};

CoreGroups group_cores(const PointCells& cells, const std::vector<char>& core) {
  CoreGroups out;
  for (const PointCell& cell : cells.cells()) {
    const std::size_t first = out.point.size();
    for (std::uint32_t i = cell.begin; i < cell.end; ++i)
      if (core[cells.source(i)] != 0) out.point.push_back(i);
    if (out.point.size() > first) out.begin.push_back(static_cast<std::uint32_t>(first));
  }
  out.begin.push_back(static_cast<std::uint32_t>(out.point.size()));
  return out;
}

}  // namespace

ChangeDistances::ChangeDistances(const ChangeSettings& settings, const std::filesystem::path& temp,
                                 std::uint64_t memory_bytes)
    : settings_(settings),
      cell_size_(change_cell_size(settings.rule)),
      halo_(std::max(change_reach(settings.rule), settings.core_spacing)),
      memory_bytes_(memory_bytes),
      point_pool_(temp, memory_bytes / 2),
      result_pool_(temp, memory_bytes / 4) {
  std::optional<Double3>& viewpoint = settings_.rule.normals.viewpoint;
  if (viewpoint) viewpoint = framed(*viewpoint);
}

std::uint64_t ChangeDistances::tile_bytes(const ChangeTile& tile) const {
  const std::uint64_t columns = tiles_->columns(tile);
  return PointCells::bytes(tile.loaded[0], columns, true) +
         PointCells::bytes(tile.loaded[1], columns, false) +
         tile.loaded[0] * (sizeof(Double3) + sizeof(std::uint64_t) + 1) + tile.loaded[1] * sizeof(Double3) +
         // The core points with what is found, and where cells are chosen from.
         tile.own * (sizeof(Measured) + sizeof(PlacedChange) + 2 * sizeof(std::uint32_t)) +
         (settings_.core_spacing > 0.0 ? tile.loaded[0] * 64 : 0) + (std::uint64_t{1} << 20);
}

void ChangeDistances::deal(CloudPoints& before, CloudPoints& after, int threads, const MemoryBudget& budget) {
  CloudCounts counts(std::max({0.5 * halo_, cell_size_, settings_.extent / kMaxLattice}));
  std::uint64_t all = 0, points = 0;
  before.for_each([&](std::span<const Double3> some) {
    all += some.size();
    for (const Double3& p : some)
      if (finite_point(p)) counts.add(0, framed(p)), ++points;
  });
  after.for_each([&](std::span<const Double3> some) {
    for (const Double3& p : some)
      if (finite_point(p)) counts.add(1, framed(p)), ++points;
  });
  const std::uint64_t each = PointCells::bytes(1, 0, true) + sizeof(Measured) + sizeof(PlacedChange) + 40;
  const auto workers = static_cast<std::uint64_t>(threads);
  const std::uint64_t target =
      std::clamp(std::min(budget.capacity() / workers / each, points / (workers * kTilesPerThread)),
                 kMinTarget, kMaxTarget);
  tiles_.emplace(counts, halo_, target, cell_size_);
  std::uint64_t largest = 0;
  for (const ChangeTile& t : tiles_->tiles()) largest = std::max(largest, tile_bytes(t));
  budget.require(largest, "change");
  const std::size_t buckets = tiles_->tiles().size(), buffer = bucket_bytes(memory_bytes_ / 16, buckets);
  before_.emplace(point_pool_, buckets, buffer);
  after_.emplace(point_pool_, buckets, buffer);
  std::uint64_t index = 0;
  before.for_each([&](std::span<const Double3> some) {
    for (const Double3& p : some) {
      if (finite_point(p)) {
        const OldPoint old = {framed(p), index};
        tiles_->for_tiles(old.p, [&](std::uint32_t k) { before_->add(k, old); });
      }
      ++index;
    }
  });
  before.release();
  after.for_each([&](std::span<const Double3> some) {
    for (const Double3& p : some)
      if (finite_point(p)) {
        const Double3 q = framed(p);
        tiles_->for_tiles(q, [&](std::uint32_t k) { after_->add(k, q); });
      }
  });
  after.release();
  found_.emplace(result_pool_, all, memory_bytes_ / 16);
  if (settings_.details) details_.emplace(result_pool_, all, memory_bytes_ / 16);
}

ChangeDistances::Measured ChangeDistances::measured_of(std::uint64_t index, const CoreChange& change) {
  Measured m;
  m.index = index;
  m.found.distance = change.distance, m.found.uncertainty = change.uncertainty;
  m.found.core = 1, m.found.significant = change.significant ? 1 : 0;
  for (std::size_t k = 0; k < 2; ++k) {
    m.details.count[k] = static_cast<std::uint32_t>(change.clouds[k].count);
    if (change.clouds[k].count > 0) m.details.spread[k] = change.clouds[k].spread;
  }
  if (change.normal != Double3{}) m.details.normal = change.normal;
  return m;
}

void ChangeDistances::measure_tile(std::size_t k, ChangeCells& cells) {
  const ChangeTile& tile = tiles_->tiles()[k];
  std::vector<Double3> points;
  std::vector<std::uint64_t> index;
  points.reserve(before_->count(k)), index.reserve(before_->count(k));
  before_->for_each(k, [&](std::span<const OldPoint> some) {
    for (const OldPoint& p : some) points.push_back(p.p), index.push_back(p.index);
  });
  std::vector<char> core(points.size(), 0);
  if (settings_.core_spacing > 0.0) {
    std::vector<Double3> placed = points;  // cells of core points lie where the scans have them
    for (Double3& p : placed) p = p + settings_.origin;
    for (const std::size_t i : tessera::core_points(placed, settings_.core_spacing))
      core[i] = tiles_->owns(tile, points[i]) ? 1 : 0;
  } else {
    for (std::size_t i = 0; i < points.size(); ++i) core[i] = tiles_->owns(tile, points[i]) ? 1 : 0;
  }
  const PointCells before(points, cell_size_, true);
  std::vector<Double3>().swap(points);
  after_->for_each(
      k, [&](std::span<const Double3> some) { points.insert(points.end(), some.begin(), some.end()); });
  const PointCells after(points, cell_size_, false);
  std::vector<Double3>().swap(points);
  const CoreGroups groups = group_cores(before, core);
  const std::vector<std::uint32_t>& at = groups.point;
  std::vector<Measured> measured(at.size());
  const std::size_t count = groups.begin.size() - 1;
  parallel_for((count + kSliceGroups - 1) / kSliceGroups, [&](std::size_t slice) {
    throw_if_stopped();
    ChangeWork work;
    std::vector<Double3> places;
    std::vector<CoreChange> changes;
    for (std::size_t g = slice * kSliceGroups; g < std::min(count, (slice + 1) * kSliceGroups); ++g) {
      const std::uint32_t begin = groups.begin[g], end = groups.begin[g + 1];
      places.clear();
      for (std::uint32_t c = begin; c < end; ++c) places.push_back(before.position(at[c]));
      changes.resize(places.size());
      changes_at(before, after, places, settings_.rule, work, changes);
      for (std::uint32_t c = begin; c < end; ++c)
        measured[c] = measured_of(index[before.source(at[c])], changes[c - begin]);
    }
  });
  std::vector<PlacedChange> placed;
  for (std::size_t c = 0; c < at.size(); ++c)
    if (!std::isnan(measured[c].found.distance))
      placed.push_back({before.position(at[c]) + settings_.origin, measured[c].found.distance,
                        measured[c].found.significant != 0});
  keep(measured, placed, cells);
}

void ChangeDistances::keep(const std::vector<Measured>& measured, std::span<const PlacedChange> placed,
                           ChangeCells& cells) {
  const std::lock_guard lock(mutex_);
  for (const Measured& m : measured) {
    ++core_points_;
    with_distance_ += std::isnan(m.found.distance) ? 0 : 1;
    with_noise_ += std::isnan(m.found.uncertainty) ? 0 : 1;
    significant_ += m.found.significant;
    without_normal_ += std::isnan(m.details.normal[0]) ? 1 : 0;
    found_->add(m.index, m.found);
    if (details_) details_->add(m.index, m.details);
  }
  cells.add(placed);
}

void ChangeDistances::measure(WorkerPool& pool, MemoryBudget& budget, ChangeCells& cells,
                              const std::function<void(std::uint64_t)>& advance) {
  const std::span<const ChangeTile> tiles = tiles_->tiles();
  pool.run_tasks(
      tiles.size(), [&](std::size_t k) { return tile_bytes(tiles[k]); }, budget,
      [&](std::size_t k) {
        measure_tile(k, cells);
        advance(tiles[k].own);
      });
  before_.reset(), after_.reset();
}

}  // namespace tessera
