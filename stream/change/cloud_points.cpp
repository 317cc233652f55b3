#include "stream/change/cloud_points.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/points/spacing.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::size_t kChunkBytes = std::size_t{1} << 18;
constexpr std::size_t kSample = 16384;                     ///< points of the first guess
constexpr std::size_t kQueries = 512;                      ///< of them that are asked for their neighbours
constexpr std::size_t kNeighbour = 8;                      ///< the spacing is half the distance to this one
constexpr std::size_t kCellPoints = std::size_t{1} << 16;  ///< of the cells that are looked at
constexpr double kCellSpacings = 16.0;  ///< the eighth neighbour lies within an eighth of a cell

}  // namespace

CloudPoints::CloudPoints(SpillPool& pool) : points_(pool, 1, kChunkBytes), sampler_(kSample) {}

void CloudPoints::add(const Double3& p) {
  points_.add(0, p);
  if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) return;
  for (std::size_t a = 0; a < 3; ++a) {
    min_[a] = finite_ == 0 ? p[a] : std::min(min_[a], p[a]);
    max_[a] = finite_ == 0 ? p[a] : std::max(max_[a], p[a]);
  }
  ++finite_;
  sampler_.add(p);
}

void CloudPoints::for_each(const std::function<void(std::span<const Double3>)>& sink) const {
  points_.for_each(0, [&](std::span<const Double3> some) {
    throw_if_stopped();
    sink(some);
  });
}

/// Distances within a sample, scaled to the whole as on a surface.
double CloudPoints::guess_spacing(const std::vector<Double3>& sample) const {
  if (sample.size() <= kNeighbour) return 0.0;
  ScaleHistogram eighth;
  std::vector<double> squares(sample.size());
  for (std::size_t i = 0; i < std::min(kQueries, sample.size()); ++i) {
    for (std::size_t k = 0; k < sample.size(); ++k) squares[k] = squared_distance(sample[i], sample[k]);
    const auto at = squares.begin() + kNeighbour;
    std::nth_element(squares.begin(), at, squares.end());
    eighth.add(std::sqrt(*at));
  }
  const double scale = std::sqrt(static_cast<double>(sample.size()) / static_cast<double>(finite_));
  return 0.5 * eighth.quantile(0.5) * std::min(1.0, scale);
}

double CloudPoints::measure_spacing() {
  const double guess = guess_spacing(sampler_.take());
  if (!(guess > 0.0) || !std::isfinite(guess)) return 0.0;
  double size = 1.0;  // a power of two, so that it does not hang on the last digit of an estimate
  while (size > kCellSpacings * guess) size /= 2;
  while (size < kCellSpacings * guess) size *= 2;
  CellSampler cells(size, kCellPoints, max_sampled_share(kCellPoints, finite_));
  CellSampler::CellIndex last = {std::numeric_limits<std::int64_t>::min(), 0, 0};
  std::uint64_t hash = 0;
  for_each([&](std::span<const Double3> some) {
    for (const Double3& p : some) {
      if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) continue;
      const CellSampler::CellIndex cell = cell_of(p, 1.0 / size);
      if (cell != last) last = cell, hash = CellSampler::hash_of(cell);
      cells.add(p, hash);
    }
  });
  std::vector<SpacingProbe> probes;
  const double share = cells.share();
  for (const CellSampler::Cell& c : cells.take())
    tessera::measure_spacing({c.min, size, c.points}, share, 0.0, std::numeric_limits<double>::infinity(),
                             probes);
  const double measured = probes.empty() ? 0.0 : summarise_spacing(std::move(probes), {}).middle;
  return measured > 0.0 ? measured : guess;
}

}  // namespace tessera
