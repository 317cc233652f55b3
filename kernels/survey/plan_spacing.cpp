#include "kernels/survey/plan_spacing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace tessera {
namespace {

constexpr std::uint64_t kMinPoints = 8;
constexpr int kMaxHalvings = 40;

using PlanCell = std::pair<std::int64_t, std::int64_t>;

/// Points of the middle one of the cells that have any.
std::uint64_t median_count(const std::vector<Double2>& sample, const Double2& low, double edge) {
  std::vector<PlanCell> cells;
  cells.reserve(sample.size());
  for (const Double2& p : sample)
    cells.emplace_back(static_cast<std::int64_t>((p[0] - low[0]) / edge),
                       static_cast<std::int64_t>((p[1] - low[1]) / edge));
  std::sort(cells.begin(), cells.end());
  std::vector<std::uint64_t> counts;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i == 0 || cells[i] != cells[i - 1]) counts.push_back(0);
    ++counts.back();
  }
  const auto middle = counts.begin() + static_cast<std::ptrdiff_t>(counts.size() / 2);
  std::nth_element(counts.begin(), middle, counts.end());
  return *middle;
}

}  // namespace

double plan_spacing(const std::vector<Double2>& sample, double share) {
  if (sample.size() < kMinPoints) return 0.0;
  Double2 low = sample.front(), high = low;
  for (const Double2& p : sample)
    for (std::size_t a = 0; a < 2; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
  double edge = std::max(high[0] - low[0], high[1] - low[1]);
  if (!(edge > 0.0)) return 0.0;
  std::uint64_t points = sample.size();
  for (int k = 0; k < kMaxHalvings; ++k) {
    const std::uint64_t half = median_count(sample, low, 0.5 * edge);
    if (half < kMinPoints) break;
    edge *= 0.5, points = half;
  }
  return edge * std::sqrt(share / static_cast<double>(points));
}

double round_up_1_2_5(double x) {
  // Powers from one on are exact up to 10^22, so quotients by them are the nearest doubles.
  double tens = 1.0;
  const bool below = x < 1.0;
  while (below ? 1.0 / tens > x : tens * 10.0 <= x) tens *= 10.0;
  const auto times = [&](double digit) { return below ? digit / tens : digit * tens; };
  for (const double digit : {1.0, 2.0, 5.0})
    if (times(digit) >= x) return times(digit);
  return times(10.0);
}

}  // namespace tessera
