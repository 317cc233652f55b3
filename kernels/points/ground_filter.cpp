#include "kernels/points/ground_filter.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tessera {
namespace {

constexpr int kMembraneSweeps = 24;  ///< a level: with the levels below, steps are gone long before

using Heights = std::vector<std::int32_t>;

/// Least (or greatest) value of each window of 2 radius + 1 along rows; windows end at the raster.
/// Source: van Herk, "A fast algorithm for local minimum and maximum filters", 1992.
template <class Better>
void window_rows(Heights& h, int width, int height, int radius, const Better& better) {
  const int span = 2 * radius + 1;
  const int padded = (width + 2 * radius + span - 1) / span * span;
  Heights line(static_cast<std::size_t>(padded)), forward(line.size()), backward(line.size());
  for (int v = 0; v < height; ++v) {
    std::int32_t* row = h.data() + static_cast<std::ptrdiff_t>(v) * width;
    for (int i = 0; i < padded; ++i)
      line[static_cast<std::size_t>(i)] = row[std::clamp(i - radius, 0, width - 1)];
    for (std::size_t i = 0; i < line.size(); ++i)
      forward[i] = i % static_cast<std::size_t>(span) == 0 ? line[i] : better(forward[i - 1], line[i]);
    for (std::size_t i = line.size(); i-- > 0;)
      backward[i] =
          (i + 1) % static_cast<std::size_t>(span) == 0 ? line[i] : better(backward[i + 1], line[i]);
    for (int u = 0; u < width; ++u)
      row[u] = better(backward[static_cast<std::size_t>(u)], forward[static_cast<std::size_t>(u + span - 1)]);
  }
}

Heights transposed(const Heights& h, int width, int height) {
  Heights out(h.size());
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      out[static_cast<std::size_t>(u) * static_cast<std::size_t>(height) + static_cast<std::size_t>(v)] =
          h[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u)];
  return out;
}

template <class Better>
void window_square(Heights& h, int width, int height, int radius, const Better& better) {
  window_rows(h, width, height, radius, better);
  h = transposed(h, width, height);
  window_rows(h, height, width, radius, better);
  h = transposed(h, height, width);
}

constexpr auto kLower = [](std::int32_t a, std::int32_t b) { return std::min(a, b); };
constexpr auto kUpper = [](std::int32_t a, std::int32_t b) { return std::max(a, b); };

Heights opened(Heights h, int width, int height, int radius) {
  erode_raster(h, width, height, radius);
  dilate_raster(h, width, height, radius);
  return h;
}
Heights closed(Heights h, int width, int height, int radius) {
  dilate_raster(h, width, height, radius);
  erode_raster(h, width, height, radius);
  return h;
}

std::int32_t mean_of(std::int64_t sum, std::int64_t count) {
  // Rounded down, below zero too.
  return static_cast<std::int32_t>(sum >= 0 ? sum / count : -((count - 1 - sum) / count));
}

}  // namespace

void fill_membrane(Heights& h, const std::vector<std::uint8_t>& known, int width, int height) {
  const auto at = [](int u, int v, int w) {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(w) + static_cast<std::size_t>(u);
  };
  if (std::find(known.begin(), known.end(), 0) == known.end()) return;
  if (width == 1 && height == 1) {
    h[0] = 0;
    return;
  }
  const int half_width = (width + 1) / 2, half_height = (height + 1) / 2;
  Heights coarse(at(0, half_height, half_width), 0);
  std::vector<std::uint8_t> coarse_known(coarse.size(), 0);
  for (int v = 0; v < half_height; ++v)
    for (int u = 0; u < half_width; ++u) {
      std::int64_t sum = 0, count = 0;
      for (int d = 0; d < 4; ++d) {
        const int x = 2 * u + d % 2, y = 2 * v + d / 2;
        if (x >= width || y >= height || known[at(x, y, width)] == 0) continue;
        sum += h[at(x, y, width)];
        ++count;
      }
      if (count == 0) continue;
      coarse[at(u, v, half_width)] = mean_of(sum, count);
      coarse_known[at(u, v, half_width)] = 1;
    }
  fill_membrane(coarse, coarse_known, half_width, half_height);
  std::vector<std::uint32_t> open;
  open.reserve(static_cast<std::size_t>(std::count(known.begin(), known.end(), 0)));
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      if (known[at(u, v, width)] != 0) continue;
      open.push_back(static_cast<std::uint32_t>(at(u, v, width)));
      h[at(u, v, width)] = coarse[at(u / 2, v / 2, half_width)];
    }
  Heights next(open.size());
  for (int sweep = 0; sweep < kMembraneSweeps; ++sweep) {
    for (std::size_t i = 0; i < open.size(); ++i) {
      const int u = static_cast<int>(open[i] % static_cast<std::uint32_t>(width));
      const int v = static_cast<int>(open[i] / static_cast<std::uint32_t>(width));
      std::int64_t sum = 0, count = 0;
      for (const auto& [x, y] : {std::pair{u - 1, v}, {u + 1, v}, {u, v - 1}, {u, v + 1}}) {
        if (x < 0 || y < 0 || x >= width || y >= height) continue;
        sum += h[at(x, y, width)];
        ++count;
      }
      next[i] = mean_of(sum, count);
    }
    for (std::size_t i = 0; i < open.size(); ++i) h[open[i]] = next[i];
  }
}

void dilate_raster(std::vector<std::int32_t>& heights, int width, int height, int radius) {
  window_square(heights, width, height, radius, kUpper);
}
void erode_raster(std::vector<std::int32_t>& heights, int width, int height, int radius) {
  window_square(heights, width, height, radius, kLower);
}

GroundSurface find_ground(std::span<const std::int32_t> lowest, int width, int height,
                          const GroundRules& rules) {
  GroundSurface out;
  out.width = width, out.height = height;
  out.ground.assign(lowest.begin(), lowest.end());
  out.kind.assign(lowest.size(), kGroundMeasured);
  if (lowest.empty()) return out;
  std::vector<std::uint8_t> known(lowest.size(), 1);
  for (std::size_t i = 0; i < lowest.size(); ++i)
    if (lowest[i] == kNoGround) out.kind[i] = kGroundEmpty, known[i] = 0;
  fill_membrane(out.ground, known, width, height);
  const auto rise = [&](double slope, int cells) {
    return static_cast<std::int32_t>(std::floor(slope * cells * rules.cell + 0.5));
  };
  // Pits go first, or openings would carry them about.
  const Heights shut = closed(out.ground, width, height, 1);
  for (std::size_t i = 0; i < lowest.size(); ++i)
    if (out.kind[i] == kGroundMeasured && shut[i] - out.ground[i] > rise(rules.low_slope, 1))
      out.kind[i] = kGroundPit, known[i] = 0;
  fill_membrane(out.ground, known, width, height);
  Heights surface = out.ground;
  for (int radius = 1; radius <= rules.max_window; ++radius) {
    Heights open = opened(surface, width, height, radius);
    const std::int32_t most = rise(rules.slope, radius);
    for (std::size_t i = 0; i < open.size(); ++i)
      if (surface[i] - open[i] > most) {
        if (out.kind[i] == kGroundMeasured) out.kind[i] = kGroundObject;
        known[i] = 0;
      }
    surface = std::move(open);
  }
  fill_membrane(out.ground, known, width, height);
  return out;
}

GroundAt ground_at(const GroundSurface& surface, const GroundRules& rules, double u, double v) {
  const auto clamped = [](double x, int cells) {
    return std::clamp(x - 0.5, 0.0, std::max(0.0, cells - 1.0));
  };
  const double x = clamped(u, surface.width), y = clamped(v, surface.height);
  const int x0 = std::min(static_cast<int>(x), std::max(0, surface.width - 2));
  const int y0 = std::min(static_cast<int>(y), std::max(0, surface.height - 2));
  const int x1 = std::min(x0 + 1, surface.width - 1), y1 = std::min(y0 + 1, surface.height - 1);
  const auto at = [&](int i, int j) {
    return static_cast<double>(
        surface.ground[static_cast<std::size_t>(j) * static_cast<std::size_t>(surface.width) +
                       static_cast<std::size_t>(i)]);
  };
  const double s = x - x0, t = y - y0;
  const double low = at(x0, y0) * (1.0 - s) + at(x1, y0) * s, high = at(x0, y1) * (1.0 - s) + at(x1, y1) * s;
  const double du = (at(x1, y0) - at(x0, y0)) * (1.0 - t) + (at(x1, y1) - at(x0, y1)) * t, dv = high - low;
  const double slope = std::sqrt(du * du + dv * dv) / rules.cell;
  return {low * (1.0 - t) + high * t, rules.cell * (rules.tolerance + rules.slope_tolerance * slope)};
}

}  // namespace tessera
