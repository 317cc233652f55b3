#include "kernels/edit/upright_low_pass.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr double kMinArea = 0.25;  ///< of a face's, along its normal before
constexpr int kStepHalvings = 3, kFilterRounds = 12;

}  // namespace

std::size_t undo_flattening(std::span<const Double3> before,
                            std::span<const std::array<std::uint32_t, 3>> faces,
                            std::vector<Double3>& after) {
  const std::vector<Double3> smooth = after;
  std::vector<int> rounds(before.size(), 0);
  std::vector<std::uint8_t> flat(before.size(), 0), near;
  for (int round = 1; round <= kFilterRounds; ++round) {
    std::fill(flat.begin(), flat.end(), std::uint8_t{0});
    bool any = false;
    for (const auto& f : faces) {
      const Double3 was = triangle_normal(before[f[0]], before[f[1]], before[f[2]]),
                    is = triangle_normal(after[f[0]], after[f[1]], after[f[2]]);
      if (!(dot(is, was) < kMinArea * dot(was, was))) continue;
      if (rounds[f[0]] > kStepHalvings && rounds[f[1]] > kStepHalvings && rounds[f[2]] > kStepHalvings)
        continue;
      flat[f[0]] = flat[f[1]] = flat[f[2]] = 1;
      any = true;
    }
    if (!any) break;
    near = flat;
    for (const auto& f : faces)
      if ((flat[f[0]] | flat[f[1]] | flat[f[2]]) != 0) near[f[0]] = near[f[1]] = near[f[2]] = 1;
    for (std::size_t v = 0; v < near.size(); ++v) {
      if (!near[v] || rounds[v] > kStepHalvings) continue;
      ++rounds[v];
      double share = 1.0;  // of the low-pass that is left
      for (int r = 0; r < rounds[v]; ++r) share *= 0.5;
      after[v] = rounds[v] > kStepHalvings ? before[v] : before[v] + (smooth[v] - before[v]) * share;
    }
  }
  return static_cast<std::size_t>(std::count_if(rounds.begin(), rounds.end(), [](int r) { return r > 0; }));
}

}  // namespace tessera
