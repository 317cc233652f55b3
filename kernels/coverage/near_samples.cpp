#include "kernels/coverage/near_samples.h"

#include <algorithm>
#include <cmath>

#include "kernels/mesh/triangle_foot.h"

namespace tessera {
namespace {

constexpr int kMaxSampleCells = 32;  ///< along an axis
constexpr double kCellDistances = 2.0;

}  // namespace

NearSamples::NearSamples(std::span<const Double3> samples, double distance)
    : samples_(samples), distance_(distance), near_(samples.size(), 0) {
  if (samples.empty()) return;
  Double3 high = low_ = samples[0];
  for (const Double3& p : samples)
    for (std::size_t a = 0; a < 3; ++a) low_[a] = std::min(low_[a], p[a]), high[a] = std::max(high[a], p[a]);
  double extent = 0.0;
  for (std::size_t a = 0; a < 3; ++a) extent = std::max(extent, high[a] - low_[a]);
  edge_ = std::max(kCellDistances * distance, extent / (kMaxSampleCells - 1));
  for (std::size_t a = 0; a < 3; ++a) cells_[a] = static_cast<int>((high[a] - low_[a]) / edge_) + 1;
  std::vector<std::uint32_t> cell_of(samples.size());
  start_.assign(static_cast<std::size_t>(cells_[0] * cells_[1] * cells_[2]) + 1, 0);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Double3& p = samples[i];
    cell_of[i] =
        static_cast<std::uint32_t>((cell(2, p[2]) * cells_[1] + cell(1, p[1])) * cells_[0] + cell(0, p[0]));
    ++start_[cell_of[i] + 1];
  }
  for (std::size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
  std::vector<std::uint32_t> next(start_.begin(), start_.end() - 1);
  sample_.resize(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i)
    sample_[next[cell_of[i]]++] = static_cast<std::uint32_t>(i);
}

int NearSamples::cell(std::size_t axis, double at) const {
  return static_cast<int>(
      std::clamp(std::floor((at - low_[axis]) / edge_), 0.0, static_cast<double>(cells_[axis] - 1)));
}

void NearSamples::add(const std::array<Double3, 3>& face) {
  if (samples_.empty()) return;
  Double3 low{}, high{};
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = std::min({face[0][a], face[1][a], face[2][a]}) - distance_;
    high[a] = std::max({face[0][a], face[1][a], face[2][a]}) + distance_;
    if (high[a] < low_[a] || low[a] > low_[a] + cells_[a] * edge_) return;
  }
  const int first = cell(0, low[0]), last = cell(0, high[0]);
  for (int k = cell(2, low[2]), k1 = cell(2, high[2]); k <= k1; ++k)
    for (int j = cell(1, low[1]), j1 = cell(1, high[1]); j <= j1; ++j) {
      const auto row = static_cast<std::size_t>((k * cells_[1] + j) * cells_[0]);
      for (std::uint32_t s = start_[row + static_cast<std::size_t>(first)];
           s < start_[row + static_cast<std::size_t>(last) + 1]; ++s) {
        const std::uint32_t i = sample_[s];
        if (near_[i] != 0) continue;
        const Double3& p = samples_[i];
        bool inside = true;
        for (std::size_t a = 0; a < 3; ++a) inside = inside && p[a] >= low[a] && p[a] <= high[a];
        if (!inside) continue;
        const TriangleFoot foot = foot_in_triangle(p, face[0], face[1], face[2]);
        near_[i] = squared_distance(p, foot.at) < distance_ * distance_ ? 1 : 0;
      }
    }
}

}  // namespace tessera
