#include "kernels/points/roof_cells.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

namespace tessera {
namespace {

/// Of the 25 cells around a planar one, so many are planar too: roofs are wide, lone crowns are not.
constexpr int kMinPlanar = 10;

class RoofMask {
 public:
  RoofMask(int width, int height)
      : width_(width),
        height_(height),
        cells_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0) {}
  std::size_t at(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(u);
  }
  std::uint8_t& operator()(int u, int v) { return cells_[at(u, v)]; }
  /// Of the cells up to `radius` away.
  int count(int u, int v, int radius) const {
    int sum = 0;
    for (int y = std::max(0, v - radius); y <= std::min(height_ - 1, v + radius); ++y)
      for (int x = std::max(0, u - radius); x <= std::min(width_ - 1, u + radius); ++x)
        sum += cells_[at(x, y)];
    return sum;
  }
  std::vector<std::uint8_t> take() { return std::move(cells_); }

 private:
  int width_, height_;
  std::vector<std::uint8_t> cells_;
};

/// Mean square of the residuals of 3 x 3 heights to their plane, with six degrees of freedom.
double plane_residual(const double (&z)[9]) {
  double mean = 0.0, du = 0.0, dv = 0.0;
  const auto at = [](int k) { return std::array<int, 2>{k % 3 - 1, k / 3 - 1}; };
  for (int k = 0; k < 9; ++k) mean += z[k], du += at(k)[0] * z[k], dv += at(k)[1] * z[k];
  mean /= 9.0, du /= 6.0, dv /= 6.0;
  double sum = 0.0;
  for (int k = 0; k < 9; ++k) {
    const double r = z[k] - mean - du * at(k)[0] - dv * at(k)[1];
    sum += r * r;
  }
  return sum / 6.0;
}

/// Does what was measured in a cell stand high enough?
bool stands_high(std::span<const std::int32_t> lowest, const GroundSurface& surface, const RoofRules& rules,
                 std::size_t cell) {
  return surface.kind[cell] == kGroundObject &&
         static_cast<double>(lowest[cell]) - surface.ground[cell] >= rules.min_height;
}

/// Middles of 3 x 3 cells that stand and are planar.
RoofMask planar_middles(std::span<const std::int32_t> lowest, const GroundSurface& surface,
                        const RoofRules& rules) {
  RoofMask planar(surface.width, surface.height);
  for (int v = 1; v + 1 < surface.height; ++v)
    for (int u = 1; u + 1 < surface.width; ++u) {
      double z[9];
      int held = 0;
      for (; held < 9; ++held) {
        const std::size_t i = planar.at(u + held % 3 - 1, v + held / 3 - 1);
        if (!stands_high(lowest, surface, rules, i)) break;
        z[held] = static_cast<double>(lowest[i]) - lowest[planar.at(u, v)];
      }
      if (held == 9 && plane_residual(z) <= rules.max_residual * rules.max_residual) planar(u, v) = 1;
    }
  return planar;
}

}  // namespace

std::vector<std::uint8_t> find_roofs(std::span<const std::int32_t> lowest, const GroundSurface& surface,
                                     const RoofRules& rules) {
  const int width = surface.width, height = surface.height;
  RoofMask planar = planar_middles(lowest, surface, rules), roof(width, height), wide(width, height);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      if (planar(u, v) != 0 && planar.count(u, v, 2) >= kMinPlanar) roof(u, v) = 1;
  // Ridges and chimneys between planes, then eaves and walls.
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      if (stands_high(lowest, surface, rules, roof.at(u, v)) && roof.count(u, v, 1) > 0) wide(u, v) = 1;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) roof(u, v) = wide.count(u, v, 1) > 0 ? 1 : 0;
  return roof.take();
}

std::vector<std::uint8_t> find_planar_areas(std::span<const std::int32_t> lowest,
                                            const GroundSurface& surface, const RoofRules& rules) {
  const int width = surface.width, height = surface.height;
  const RoofMask middles = planar_middles(lowest, surface, rules);
  RoofMask planar(width, height), wide(width, height);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) planar(u, v) = middles.count(u, v, 1) > 0 ? 1 : 0;
  RoofMask open = planar;
  std::vector<std::array<int, 2>> area;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      if (open(u, v) == 0) continue;
      open(u, v) = 0;
      area.assign(1, {u, v});
      for (std::size_t k = 0; k < area.size(); ++k) {
        const auto [x, y] = area[k];
        const std::array<std::array<int, 2>, 4> beside = {{{x, y - 1}, {x - 1, y}, {x + 1, y}, {x, y + 1}}};
        for (const auto& [s, t] : beside) {
          if (s < 0 || t < 0 || s >= width || t >= height || open(s, t) == 0) continue;
          open(s, t) = 0;
          area.push_back({s, t});
        }
      }
      if (area.size() >= static_cast<std::size_t>(std::max(rules.min_cells, 0)))
        for (const auto& [x, y] : area) wide(x, y) = 1;
    }
  std::vector<std::uint8_t> out(lowest.size());
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) out[wide.at(u, v)] = wide.count(u, v, 2) > 0 ? 1 : 0;
  return out;
}

}  // namespace tessera
