#include "kernels/texture/point_colours.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr double kFacing = 0.2;        ///< least cosine between normals of a point and the surface
constexpr double kOwnShare = 0.15;     ///< of the spacing: nearer than this a point is at the place itself
constexpr int kSpeckle = 24;           ///< least difference of a channel from the median that is speckle
constexpr int kSpeckleDeviations = 4;  ///< median deviations besides
constexpr int kCellRings = 4;          ///< around the cell of a place, up to max_distance
constexpr std::int32_t kCellBias = 1 << 20;

double sign_of(double v) {
  return v < 0.0 ? -1.0 : 1.0;
}

}  // namespace

std::uint32_t pack_normal(const Double3& n) {
  const double sum = std::fabs(n[0]) + std::fabs(n[1]) + std::fabs(n[2]);
  if (!(sum > 0.0)) return 0;
  double u = n[0] / sum, v = n[1] / sum;
  if (n[2] < 0.0) {
    const double x = u;
    u = (1.0 - std::fabs(v)) * sign_of(x);
    v = (1.0 - std::fabs(x)) * sign_of(v);
  }
  const auto bits = [](double x) {
    return static_cast<std::uint32_t>(std::clamp(std::floor(x * 32767.0 + 0.5) + 32768.0, 1.0, 65535.0));
  };
  return bits(u) | bits(v) << 16;
}

Double3 unpack_normal(std::uint32_t packed) {
  if (packed == 0) return {};
  const double u = (static_cast<double>(packed & 0xffffu) - 32768.0) / 32767.0,
               v = (static_cast<double>(packed >> 16) - 32768.0) / 32767.0;
  Double3 n = {u, v, 1.0 - std::fabs(u) - std::fabs(v)};
  if (n[2] < 0.0) n = {(1.0 - std::fabs(v)) * sign_of(u), (1.0 - std::fabs(u)) * sign_of(v), n[2]};
  return unit(n);
}

PointColours::PointColours(std::span<const Float3> position, std::span<const std::uint32_t> rgba,
                           std::span<const std::uint32_t> normal, const PointColourOptions& options)
    : position_(position), rgba_(rgba), normal_(normal), options_(options) {
  edge_ = std::max(1.2 * options.spacing, options.max_distance / kCellRings);
  if (position.empty()) return;
  low_ = wide(position[0]);
  for (const Float3& p : position)
    for (std::size_t a = 0; a < 3; ++a) low_[a] = std::min(low_[a], static_cast<double>(p[a]));
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed(position.size());
  for (std::uint32_t i = 0; i < position.size(); ++i) keyed[i] = {cell_key(cell_of(wide(position[i]))), i};
  std::sort(keyed.begin(), keyed.end());
  std::size_t cells = 0;
  order_.resize(keyed.size());
  for (std::size_t i = 0; i < keyed.size(); ++i) {
    order_[i] = keyed[i].second;
    cells += i == 0 || keyed[i].first != keyed[i - 1].first;
  }
  slots_.resize(std::bit_ceil(2 * cells));
  for (std::size_t i = 0; i < keyed.size();) {
    std::size_t end = i;
    while (end < keyed.size() && keyed[end].first == keyed[i].first) ++end;
    std::size_t s = mix(keyed[i].first) & (slots_.size() - 1);
    while (slots_[s].end != 0) s = (s + 1) & (slots_.size() - 1);
    slots_[s] = {keyed[i].first, static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(end)};
    i = end;
  }
}

std::uint64_t PointColours::cell_key(const Int3& cell) const {
  std::uint64_t key = 0;
  for (const std::int32_t c : cell) key = key << 21 | static_cast<std::uint64_t>(c + kCellBias);
  return key;
}

Int3 PointColours::cell_of(const Double3& p) const {
  Int3 cell{};
  for (std::size_t a = 0; a < 3; ++a)
    cell[a] = static_cast<std::int32_t>(
        std::clamp(std::floor((p[a] - low_[a]) / edge_), -kCellBias / 2.0, kCellBias - 1.0));
  return cell;
}

void PointColours::gather(const Double3& at, const Double3& normal, const Int3& cell, std::uint32_t without,
                          std::vector<Near>& out) const {
  const std::uint64_t key = cell_key(cell);
  for (std::size_t s = mix(key) & (slots_.size() - 1); slots_[s].end != 0;
       s = (s + 1) & (slots_.size() - 1)) {
    if (slots_[s].key != key) continue;
    const double limit = options_.max_distance * options_.max_distance;
    for (std::uint32_t o = slots_[s].first; o < slots_[s].end; ++o) {
      const std::uint32_t i = order_[o];
      if (i == without) continue;
      const double square = squared_distance(wide(position_[i]), at);
      if (square > limit) continue;
      if (!normal_.empty() && normal_[i] != 0 && dot(unpack_normal(normal_[i]), normal) < kFacing) continue;
      out.push_back({square, i});
    }
    return;
  }
}

void PointColours::find_near(const Double3& at, const Double3& normal, std::uint32_t without,
                             std::vector<Near>& near) const {
  near.clear();
  if (position_.empty()) return;
  const auto less = [](const Near& a, const Near& b) {
    return a.square != b.square ? a.square < b.square : a.point < b.point;
  };
  const Int3 middle = cell_of(at);
  const int rings = static_cast<int>(std::ceil(options_.max_distance / edge_));
  for (int ring = 0; ring <= rings; ++ring) {
    for (int k = -ring; k <= ring; ++k)
      for (int j = -ring; j <= ring; ++j) {
        const bool side = std::abs(k) == ring || std::abs(j) == ring;
        for (int i = -ring; i <= ring; i += side || ring == 0 ? 1 : 2 * ring)
          gather(at, normal, {middle[0] + i, middle[1] + j, middle[2] + k}, without, near);
      }
    if (ring == 0 || near.size() < options_.neighbours) continue;
    std::nth_element(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(options_.neighbours - 1),
                     near.end(), less);
    const double seen = ring * edge_ * (1.0 - 1e-6);
    if (near[options_.neighbours - 1].square <= seen * seen) break;
  }
  const std::size_t count = std::min(near.size(), options_.neighbours);
  std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count), near.end(), less);
  near.resize(count);
}

double PointColours::weight_of(const Near& point, const Double3& at, const Double3& normal) const {
  const double own = kOwnShare * options_.spacing;
  const double height = dot(wide(position_[point.point]) - at, normal);
  const double aside = std::max(0.0, point.square - height * height) + own * own;
  return 1.0 / (aside * aside);
}

bool PointColours::find_normal(const Double3& at, const Double3& normal, Double3& found,
                               std::vector<Near>& near) const {
  if (normal_.empty()) return false;
  find_near(at, normal, kAllPoints, near);
  Double3 sum{};
  for (const Near& point : near)
    if (normal_[point.point] != 0)
      sum = sum + unpack_normal(normal_[point.point]) * weight_of(point, at, normal);
  found = unit_or_zero(sum);
  return found != Double3{};
}

bool PointColours::find(const Double3& at, const Double3& normal, std::uint32_t& rgba,
                        std::vector<Near>& near, std::uint32_t without) const {
  find_near(at, normal, without, near);
  if (near.empty()) return false;
  const std::size_t count = near.size();
  // Speckle: far from the median in any channel, with the median deviation as a measure.
  std::array<int, 3> median{}, limit{};
  std::array<int, 64> values{};
  const std::size_t looked = std::min<std::size_t>(count, values.size());
  const auto channel = [&](std::size_t i, std::size_t c) {
    return static_cast<int>(rgba_[near[i].point] >> (8 * c) & 255u);
  };
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < looked; ++i) values[i] = channel(i, c);
    const auto middle_at = values.begin() + static_cast<std::ptrdiff_t>(looked / 2),
               end = values.begin() + static_cast<std::ptrdiff_t>(looked);
    std::nth_element(values.begin(), middle_at, end);
    median[c] = *middle_at;
    for (std::size_t i = 0; i < looked; ++i) values[i] = std::abs(channel(i, c) - median[c]);
    std::nth_element(values.begin(), middle_at, end);
    limit[c] = kSpeckle + kSpeckleDeviations * *middle_at;
  }
  double weights = 0.0;
  Double3 sum{};
  for (std::size_t i = 0; i < count; ++i) {
    bool speckle = false;
    for (std::size_t c = 0; c < 3; ++c) speckle = speckle || std::abs(channel(i, c) - median[c]) > limit[c];
    if (speckle && count > 2) continue;
    const double weight = weight_of(near[i], at, normal);
    weights += weight;
    for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * channel(i, c);
  }
  if (!(weights > 0.0)) {  // channels with different outliers: the nearest stands
    rgba = rgba_[near[0].point] | 0xff000000u;
    return true;
  }
  rgba = 0xff000000u;
  for (std::size_t c = 0; c < 3; ++c)
    rgba |= static_cast<std::uint32_t>(std::clamp(std::floor(sum[c] / weights + 0.5), 0.0, 255.0)) << (8 * c);
  return true;
}

}  // namespace tessera
