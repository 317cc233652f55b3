#include "kernels/coverage/near_samples.h"

#include <algorithm>

#include "kernels/mesh/triangle_foot.h"

namespace tessera {
namespace {

constexpr int kMaxSampleCells = 32;  ///< along an axis
constexpr double kCellDistances = 2.0;
constexpr double kSampleMargin = 1e-9;  ///< of the distance, for rounding

}  // namespace

NearSamples::NearSamples(std::span<const Double3> samples, double distance)
    : samples_(samples), distance_(distance), near_(samples.size(), 0) {
  if (samples.empty()) return;
  low_ = high_ = samples[0];
  const double reach = distance * (1.0 + kSampleMargin);
  for (const Double3& p : samples)
    for (std::size_t a = 0; a < 3; ++a)
      low_[a] = std::min(low_[a], p[a] - reach), high_[a] = std::max(high_[a], p[a] + reach);
  double extent = 0.0;
  for (std::size_t a = 0; a < 3; ++a) extent = std::max(extent, high_[a] - low_[a]);
  const double edge = std::max(kCellDistances * distance, extent / (kMaxSampleCells - 1));
  per_edge_ = 1.0 / edge;
  for (std::size_t a = 0; a < 3; ++a) cells_[a] = static_cast<int>((high_[a] - low_[a]) * per_edge_) + 1;
  start_.assign(static_cast<std::size_t>(cells_[0] * cells_[1] * cells_[2]) + 1, 0);
  const auto around = [&](const Double3& p) {
    const Double3 r = {reach, reach, reach};
    return cells(p - r, p + r);
  };
  for (const Double3& p : samples) for_cells(around(p), [&](std::size_t c) { ++start_[c + 1]; });
  for (std::size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
  end_.assign(start_.begin(), start_.end() - 1);
  sample_.resize(start_.back());
  for (std::uint32_t i = 0; i < samples.size(); ++i)
    for_cells(around(samples[i]), [&](std::size_t c) { sample_[end_[c]++] = i; });
}

std::array<Int3, 2> NearSamples::cells(const Double3& low, const Double3& high) const {
  std::array<Int3, 2> range{};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto cell = [&](double at) {
      return std::clamp(static_cast<int>((at - low_[a]) * per_edge_), 0, cells_[a] - 1);
    };
    range[0][a] = cell(low[a]), range[1][a] = cell(high[a]);
  }
  return range;
}

template <class Use>
void NearSamples::for_cells(const std::array<Int3, 2>& range, const Use& use) const {
  for (int k = range[0][2]; k <= range[1][2]; ++k)
    for (int j = range[0][1]; j <= range[1][1]; ++j)
      for (int i = range[0][0]; i <= range[1][0]; ++i)
        use(static_cast<std::size_t>((k * cells_[1] + j) * cells_[0] + i));
}

void NearSamples::add(const std::array<Double3, 3>& face) {
  if (samples_.empty()) return;
  Double3 low{}, high{};
  for (std::size_t a = 0; a < 3; ++a) {
    // Clamped, so that what lies far outside is a cell too.
    low[a] = std::max(std::min({face[0][a], face[1][a], face[2][a]}), low_[a]);
    high[a] = std::min(std::max({face[0][a], face[1][a], face[2][a]}), high_[a]);
    if (high[a] < low_[a] || low[a] > high_[a]) return;
  }
  for_cells(cells(low, high), [&](std::size_t c) { meet(c, face); });
}

void NearSamples::meet(std::size_t cell, const std::array<Double3, 3>& face) {
  for (std::uint32_t s = start_[cell]; s < end_[cell];) {
    const std::uint32_t i = sample_[s];
    if (near_[i] == 0) {
      const TriangleFoot foot = foot_in_triangle(samples_[i], face[0], face[1], face[2]);
      near_[i] = squared_distance(samples_[i], foot.at) < distance_ * distance_ ? 1 : 0;
    }
    if (near_[i] != 0)
      sample_[s] = sample_[--end_[cell]];
    else
      ++s;
  }
}

void NearSamples::add(std::span<const Double3> position,
                      std::span<const std::array<std::uint32_t, 3>> faces) {
  if (samples_.empty()) return;
  constexpr std::uint32_t kBeyond = ~std::uint32_t{0};
  static_assert(kMaxSampleCells * kMaxSampleCells * kMaxSampleCells < kBeyond);
  const auto cell_of = [&](const Double3& p) {
    for (std::size_t a = 0; a < 3; ++a)
      if (!(p[a] >= low_[a] && p[a] <= high_[a])) return kBeyond;
    std::uint32_t cell = 0;
    for (std::size_t a = 3; a-- > 0;) {
      const int at = std::min(static_cast<int>((p[a] - low_[a]) * per_edge_), cells_[a] - 1);
      cell = cell * static_cast<std::uint32_t>(cells_[a]) + static_cast<std::uint32_t>(at);
    }
    return cell;
  };
  std::vector<std::uint32_t> cell(position.size());
  for (std::size_t v = 0; v < position.size(); ++v) cell[v] = cell_of(position[v]);
  for (const auto& f : faces) {
    const std::uint32_t c = cell[f[0]];
    const auto face = [&] { return std::array<Double3, 3>{position[f[0]], position[f[1]], position[f[2]]}; };
    if (c != cell[f[1]] || c != cell[f[2]] || c == kBeyond)
      add(face());
    else if (start_[c] != end_[c])
      meet(c, face());
  }
}

}  // namespace tessera
