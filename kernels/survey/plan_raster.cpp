#include "kernels/survey/plan_raster.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "kernels/mesh/orientation_sign.h"
#include "kernels/mesh/prism_volume.h"

namespace tessera {
namespace {

/// Of the colours at the corners, by the weights of a point; corners without colour have no say.
std::uint32_t blended_colour(const std::array<std::uint32_t, 3>& rgba, const std::array<double, 3>& weight) {
  double all = 0.0;
  for (std::size_t k = 0; k < 3; ++k)
    if (rgba[k] >> 24 != 0) all += weight[k];
  if (!(all > 0.0)) return 0;
  std::uint32_t out = 0xffu << 24;
  for (unsigned shift = 0; shift < 24; shift += 8) {
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k)
      if (rgba[k] >> 24 != 0) sum += weight[k] * static_cast<double>(rgba[k] >> shift & 0xff);
    out |= static_cast<std::uint32_t>(std::min(std::floor(sum / all + 0.5), 255.0)) << shift;
  }
  return out;
}

}  // namespace

/// Corners sorted by their coordinates, so that rounding does not hang on which one comes first.
struct PlanRaster::Face {
  PlanTriangle plane;
  std::array<Double2, 3> corner;  ///< as `rgba`
  std::array<std::uint32_t, 3> rgba{};
  float gradient_x, gradient_y;

  Face(const std::array<Double3, 3>& c, const std::array<std::size_t, 3>& order,
       const std::array<std::uint32_t, 3>* colours)
      : plane(c[order[0]], c[order[1]], c[order[2]]) {
    for (std::size_t k = 0; k < 3; ++k) {
      corner[k] = {c[order[k]][0], c[order[k]][1]};
      if (colours) rgba[k] = (*colours)[order[k]];
    }
    const auto limited = [](double slope) {
      return static_cast<float>(std::clamp(slope, -kMaxGradient, kMaxGradient));
    };
    gradient_x = limited(plane.gradient()[0]), gradient_y = limited(plane.gradient()[1]);
  }
  /// On its edges too.
  bool holds(const Double2& p) const {
    const auto& s = plane.shadow();
    return orient2d_sign(s[0], s[1], p) >= 0 && orient2d_sign(s[1], s[2], p) >= 0 &&
           orient2d_sign(s[2], s[0], p) >= 0;
  }
  std::uint32_t colour(const Double2& p) const {
    std::array<double, 3> weight{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Double2 &a = corner[(k + 1) % 3], &b = corner[(k + 2) % 3];
      weight[k] = std::abs((a[0] - p[0]) * (b[1] - p[1]) - (a[1] - p[1]) * (b[0] - p[0]));
    }
    return blended_colour(rgba, weight);
  }
};

PlanRaster::PlanRaster(const RasterWindow& window, double cell)
    : window_(window), cell_(cell), cells_(window.size()) {}

void PlanRaster::sample(const Face& face, double x, double y, RasterCell& cell) const {
  if (!face.holds({x, y})) return;
  const double height = face.plane.height({x, y});
  cell.ground = std::min(cell.ground, height);
  if (height < cell.top) return;
  const std::uint32_t rgba = face.colour({x, y});
  if (std::tie(height, face.gradient_x, face.gradient_y, rgba) >
      std::tie(cell.top, cell.gradient_x, cell.gradient_y, cell.rgba)) {
    cell.top = height, cell.gradient_x = face.gradient_x, cell.gradient_y = face.gradient_y;
    cell.rgba = rgba;
  }
}

void PlanRaster::add(const std::array<Double3, 3>& corner, const std::array<std::uint32_t, 3>* rgba) {
  const auto [low_x, high_x] = std::minmax({corner[0][0], corner[1][0], corner[2][0]});
  const auto [low_y, high_y] = std::minmax({corner[0][1], corner[1][1], corner[2][1]});
  // Cells of the window whose centres may lie in [low, high], a cell more on either side for rounding.
  const auto first = [&](double at, std::int64_t begin) {
    return std::max(begin, static_cast<std::int64_t>(std::floor(std::max(at / cell_ - 1.5, -1.0))));
  };
  const auto last = [&](double at, std::int64_t end) {
    return std::min(end, static_cast<std::int64_t>(std::floor(std::min(at / cell_ + 1.5, 1e18))));
  };
  const std::int64_t end_column = window_.column + window_.columns, end_row = window_.row + window_.rows;
  const std::int64_t c0 = first(low_x, window_.column), c1 = last(high_x, end_column);
  const std::int64_t r0 = first(-high_y, window_.row), r1 = last(-low_y, end_row);
  if (c0 >= c1 || r0 >= r1) return;
  std::array<std::size_t, 3> order = {0, 1, 2};
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return corner[a] < corner[b]; });
  const Face face(corner, order, rgba);
  if (face.plane.facing() == 0) return;
  for (std::int64_t row = r0; row < r1; ++row) {
    const double y = -(static_cast<double>(row) + 0.5) * cell_;
    if (y < low_y || y > high_y) continue;
    // Where the edges meet this row: a convex face holds no centre beyond.
    double from = high_x, to = low_x;
    for (std::size_t k = 0; k < 3; ++k) {
      const Double2 &a = face.corner[k], &b = face.corner[(k + 1) % 3];
      if (std::min(a[1], b[1]) > y || std::max(a[1], b[1]) < y) continue;
      const double t = a[1] == b[1] ? 0.0 : std::clamp((y - a[1]) / (b[1] - a[1]), 0.0, 1.0);
      const double x = a[0] + t * (b[0] - a[0]), end = a[1] == b[1] ? b[0] : x;
      from = std::min({from, x, end}), to = std::max({to, x, end});
    }
    const std::int64_t end = last(to, end_column);
    for (std::int64_t column = first(from, window_.column); column < end; ++column) {
      RasterCell& cell =
          cells_[static_cast<std::size_t>((row - window_.row) * window_.columns + column - window_.column)];
      sample(face, (static_cast<double>(column) + 0.5) * cell_, y, cell);
    }
  }
}

}  // namespace tessera
