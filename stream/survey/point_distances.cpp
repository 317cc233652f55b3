#include "stream/survey/point_distances.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/mesh/signed_distance.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::size_t kSlicePoints =
    1024;  ///< points that one thread measures at a time, a hint between them
constexpr std::size_t kFarPoints = 1u << 16;
/// Of a cell at work, beside its faces: a batch of points and what is found for them.
constexpr std::uint64_t kBatchBytes = std::uint64_t{1} << 20;
/// Of points that wait for a wider search, with what is found for them.
template <class Record>
constexpr std::uint64_t kWideBytes = kFarPoints*(48 + sizeof(Record));
/// Widens boxes so that rounding of a foot, at most 2^-50 of the coordinates, drops no face around it.
constexpr double kFootMargin = 0x1p-40;

/// Where buffers of so many buckets take about a share of the memory.
std::size_t chunk_bytes(std::uint64_t memory_bytes, std::size_t buckets) {
  return static_cast<std::size_t>(
      std::clamp<std::uint64_t>(memory_bytes / std::max<std::size_t>(1, buckets), 4096, 262144));
}

/// Calls use(begin, end) for slices of [0, count) on the threads of the pool.
template <class Use>
void for_slices(std::size_t count, const Use& use) {
  parallel_for((count + kSlicePoints - 1) / kSlicePoints, [&](std::size_t slice) {
    use(slice * kSlicePoints, std::min(count, (slice + 1) * kSlicePoints));
  });
}

double square_to_box(const Double3& p, const MeshBox& box) {
  double sum = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const double d = std::max({box.low[a] - p[a], 0.0, p[a] - box.high[a]});
    sum += d * d;
  }
  return sum;
}

double square_between(const MeshBox& a, const MeshBox& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double d = std::max({a.low[k] - b.high[k], 0.0, b.low[k] - a.high[k]});
    sum += d * d;
  }
  return sum;
}

bool holds_point(const MeshBox& box, const Double3& p) {
  for (std::size_t a = 0; a < 3; ++a)
    if (!(p[a] >= box.low[a] && p[a] <= box.high[a])) return false;
  return true;
}

/// By how much a foot may be displaced in this box.
double foot_margin(const MeshBox& box, double reach) {
  double largest = reach;
  for (std::size_t a = 0; a < 3; ++a)
    largest = std::max({largest, std::abs(box.low[a]), std::abs(box.high[a])});
  return kFootMargin * largest;
}

template <class Placed>
MeshBox box_around(std::span<const Placed> points) {
  MeshBox box = {points.front().position, points.front().position};
  for (const Placed& p : points)
    for (std::size_t a = 0; a < 3; ++a) {
      box.low[a] = std::min(box.low[a], p.position[a]);
      box.high[a] = std::max(box.high[a], p.position[a]);
    }
  return box;
}

}  // namespace

DistanceRecord DistanceRecord::of(const Double3& p, const SignedDistance::Foot& foot, const Double3&) {
  // No negative zero.
  return {SignedDistance::signed_distance(p, foot) + 0.0, 0, foot.border ? 1u : 0u};
}

FootRecord FootRecord::of(const Double3& p, const SignedDistance::Foot& foot, const Double3& origin) {
  return {DistanceRecord::of(p, foot, origin), foot.at + origin, unit_or_zero(foot.side)};
}

template <class Record>
PointSearch<Record>::PointSearch(const MeshStore& mesh, double max_distance,
                                 const std::filesystem::path& temp, std::uint64_t memory_bytes)
    : mesh_(mesh),
      max_distance_(max_distance),
      memory_bytes_(memory_bytes),
      cells_(mesh, max_distance),
      point_pool_(temp, memory_bytes / 4),
      result_pool_(temp, memory_bytes / 4) {
  const std::size_t cells = cells_.cells().size();
  points_.emplace(point_pool_, cells, chunk_bytes(memory_bytes / 4, cells));
}

template <class Record>
std::uint64_t PointSearch<Record>::fullest_bytes() const {
  std::uint64_t most = 0;
  for (const DistanceCell& c : cells_.cells())
    most = std::max({most, c.bytes + kBatchBytes, c.wide_bytes + kWideBytes<Record>});
  return most;
}

template <class Record>
void PointSearch<Record>::add(const Double3& p) {
  const std::size_t cell = cells_.find(p);
  if (cell != DistanceCells::kNone) points_->add(cell, {p, count_});
  ++count_;
}

template <class Record>
void PointSearch<Record>::keep(std::span<const Placed> points, std::span<const Record> found) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!found[i].known()) continue;
    ++measured_;
    results_->add(points[i].index, found[i]);
  }
}

/// Of points that have a face within the reach. \pre all such faces are in the surface
template <class Record>
void PointSearch<Record>::measure_by(const SignedDistance& surface, double reach,
                                     std::span<const Placed> points, std::vector<Record>& found) const {
  if (surface.empty()) return;
  for_slices(points.size(), [&](std::size_t begin, std::size_t end) {
    std::uint32_t hint = SignedDistance::kNone;
    for (std::size_t i = begin; i < end; ++i) {
      const Double3 p = points[i].position - surface.origin();
      const SignedDistance::Foot foot = surface.closest(p, reach * reach, hint);
      if (foot.face == SignedDistance::kNone) continue;
      hint = foot.slot;
      found[i] = Record::of(p, foot, surface.origin());
    }
  });
}

template <class Record>
std::vector<Record> PointSearch<Record>::measure_within(const MeshBox& box, double reach,
                                                        std::span<const Placed> points) const {
  std::vector<Record> distances(points.size());
  // Within the reach of the box a foot has all faces around it loaded, as their boxes hold it.
  const SignedDistance surface(mesh_.load_box(grown(box, reach + foot_margin(box, reach))), box.low);
  measure_by(surface, reach, points, distances);
  return distances;
}

template <class Record>
void PointSearch<Record>::measure_cell(std::size_t cell) {
  throw_if_stopped();
  const DistanceCell& c = cells_.cells()[cell];
  const SignedDistance surface(mesh_.load_box(grown(c.box, c.reach + foot_margin(c.box, c.reach))),
                               c.box.low);
  std::vector<Record> distances;
  points_->for_each(cell, [&](std::span<const Placed> batch) {
    throw_if_stopped();
    distances.assign(batch.size(), Record{});
    measure_by(surface, c.reach, batch, distances);
    const std::lock_guard lock(mutex_);
    keep(batch, distances);
    if (c.reach >= max_distance_) return;
    for (std::size_t i = 0; i < batch.size(); ++i)
      if (!distances[i].known()) unsettled_->add(cell, batch[i]);
  });
}

/// Points without a face within the reach of their cell, in circles twice as wide each time: few points lie far off, and
/// those that do lie together.
template <class Record>
void PointSearch<Record>::measure_wide(std::size_t cell, std::vector<Placed>& points) {
  const DistanceCell& c = cells_.cells()[cell];
  for (double reach = c.reach; reach < c.wide_reach && !points.empty();) {
    throw_if_stopped();
    reach = std::min(c.wide_reach, 2.0 * reach);
    const std::vector<Record> distances =
        measure_within(box_around(std::span<const Placed>(points)), reach, points);
    std::size_t left = 0;
    const std::lock_guard lock(mutex_);
    keep(points, distances);
    for (std::size_t i = 0; i < points.size(); ++i)
      if (!distances[i].known()) points[left++] = points[i];
    points.resize(left);
  }
  if (c.wide_reach >= max_distance_) return;
  const std::lock_guard lock(mutex_);
  for (const Placed& p : points) far_->add(cell, p);
}

template <class Record>
void PointSearch<Record>::measure_wide(std::size_t cell) {
  std::vector<Placed> points;
  points.reserve(std::min<std::uint64_t>(kFarPoints, unsettled_->count(cell)));
  unsettled_->for_each(cell, [&](std::span<const Placed> some) {
    for (const Placed& p : some) {
      points.push_back(p);
      if (points.size() == kFarPoints) measure_wide(cell, points), points.clear();
    }
  });
  if (!points.empty()) measure_wide(cell, points);
}

/// Points of one cell that have no face within its wide reach: one patch after the other, the nearest first, while it may hold a
/// face that is nearer than what was found. A foot counts where it lies in the box of the patch at hand: all faces around
/// it are loaded there, and every other foot is that of another patch.
template <class Record>
void PointSearch<Record>::measure_far(std::span<const Placed> points, MemoryBudget& budget) {
  const MeshBox around = box_around(points);
  const Double3 origin = around.low;
  struct Candidate {
    double square = 0.0;
    std::size_t patch = 0;
  };
  std::vector<Candidate> candidates;
  for (const std::size_t p : mesh_.select(grown(around, max_distance_)))
    candidates.push_back({square_between(around, mesh_.patches()[p].box), p});
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& l, const Candidate& r) {
    return l.square != r.square ? l.square < r.square : l.patch < r.patch;
  });
  std::vector<Record> distances(points.size());
  std::vector<double> best(points.size(), max_distance_ * max_distance_);
  std::vector<std::uint32_t> active;
  for (const Candidate& c : candidates) {
    throw_if_stopped();
    if (c.square > *std::max_element(best.begin(), best.end())) break;
    const MeshBox& box = mesh_.patches()[c.patch].box;
    active.clear();
    for (std::size_t i = 0; i < points.size(); ++i)
      if (square_to_box(points[i].position, box) < best[i]) active.push_back(static_cast<std::uint32_t>(i));
    if (active.empty()) continue;
    const double margin = foot_margin(box, max_distance_);
    const MeshBox accepted = grown(box, margin), loaded = grown(box, 2.0 * margin);
    budget.require(DistanceCells::load_bytes(mesh_, mesh_.select(loaded)), "deviate");
    const SignedDistance surface(mesh_.load_box(loaded), origin);
    for_slices(active.size(), [&](std::size_t begin, std::size_t end) {
      std::uint32_t hint = SignedDistance::kNone;
      for (std::size_t k = begin; k < end; ++k) {
        const std::uint32_t i = active[k];
        const Double3 p = points[i].position - origin;
        const SignedDistance::Foot foot = surface.closest(p, best[i], hint);
        if (foot.face == SignedDistance::kNone) continue;
        hint = foot.slot;
        if (!holds_point(accepted, foot.at + origin)) continue;
        best[i] = foot.square;
        distances[i] = Record::of(p, foot, origin);
      }
    });
  }
  keep(points, distances);
}

template <class Record>
void PointSearch<Record>::measure(WorkerPool& pool, MemoryBudget& budget) {
  results_.emplace(result_pool_, count_, memory_bytes_ / 4);
  const std::size_t cells = cells_.cells().size();
  const std::size_t buffer = chunk_bytes(memory_bytes_ / 4, cells);
  unsettled_.emplace(point_pool_, cells, buffer);
  const auto with_points = [&](const SpillBuckets<Placed>& buckets) {
    std::vector<std::size_t> some;
    for (std::size_t k = 0; k < cells; ++k)
      if (buckets.count(k) > 0) some.push_back(k);
    return some;
  };
  const std::vector<std::size_t> full = with_points(*points_);
  pool.run_tasks(
      full.size(), [&](std::size_t k) { return cells_.cells()[full[k]].bytes + kBatchBytes; }, budget,
      [&](std::size_t k) { measure_cell(full[k]); });
  points_.reset();
  far_.emplace(point_pool_, cells, buffer);
  const std::vector<std::size_t> wide = with_points(*unsettled_);
  pool.run_tasks(
      wide.size(), [&](std::size_t k) { return cells_.cells()[wide[k]].wide_bytes + kWideBytes<Record>; },
      budget, [&](std::size_t k) { measure_wide(wide[k]); });
  unsettled_.reset();
  pool.run_here([&] {
    std::vector<Placed> batch;
    for (const std::size_t k : with_points(*far_)) {
      searched_ += far_->count(k);
      far_->for_each(k, [&](std::span<const Placed> some) {
        for (const Placed& p : some) {
          batch.push_back(p);
          if (batch.size() == kFarPoints) measure_far(batch, budget), batch.clear();
        }
      });
      if (!batch.empty()) measure_far(batch, budget), batch.clear();
    }
  });
  far_.reset();
}

template class PointSearch<DistanceRecord>;
template class PointSearch<FootRecord>;

}  // namespace tessera
