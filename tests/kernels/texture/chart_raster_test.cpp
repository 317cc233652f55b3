#include "kernels/texture/chart_raster.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "tests/helpers/block_meshes.h"

namespace chart_raster_test {

using namespace tessera;

namespace {

FaceAcross across_in(const MeshBlock& block) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> third;
  for (const auto& f : block.faces)
    for (std::size_t k = 0; k < 3; ++k) third[{f[k], f[(k + 1) % 3]}] = f[(k + 2) % 3];
  return [&block, third](std::uint32_t face, std::uint32_t k) -> std::optional<Double3> {
    const auto& f = block.faces[face];
    const auto at = third.find({f[(k + 1) % 3], f[k]});
    if (at == third.end()) return std::nullopt;
    return block.position[at->second];
  };
}

/// A texture of one chart: `colour` at the places of its texels, in whole numbers.
struct Painted {
  MeshChart chart;
  ChartRaster raster;
  std::vector<int> value;

  double bilinear(const Double2& uv) const {
    const double x = uv[0] / raster.texel + raster.margin - 0.5,
                 y = uv[1] / raster.texel + raster.margin - 0.5;
    const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
    const double s = x - i, t = y - j;
    const auto at = [&](int a, int b) {
      REQUIRE(raster.at(a, b) != ChartRaster::kEmpty);
      return static_cast<double>(value[static_cast<std::size_t>(b * raster.width + a)]);
    };
    return (1 - t) * ((1 - s) * at(i, j) + s * at(i + 1, j)) +
           t * ((1 - s) * at(i, j + 1) + s * at(i + 1, j + 1));
  }
};

template <class Colour>
std::vector<Painted> paint(const MeshBlock& block, double texel, const Colour& colour) {
  const TriangleSpan span{block.position, block.faces};
  const FaceAcross across = across_in(block);
  std::vector<Painted> out;
  for (MeshChart& chart : make_charts(span, {})) {
    Painted p{std::move(chart), {}, {}};
    p.raster = raster_chart(p.chart, texel, 2);
    p.value.assign(p.raster.what.size(), 0);
    for (int y = 0; y < p.raster.height; ++y)
      for (int x = 0; x < p.raster.width; ++x)
        if (p.raster.at(x, y) != ChartRaster::kEmpty)
          p.value[static_cast<std::size_t>(y * p.raster.width + x)] = static_cast<int>(
              std::floor(colour(texel_place(span, p.chart, p.raster, x, y, across).position) + 0.5));
    out.push_back(std::move(p));
  }
  return out;
}

}  // namespace

TEST_CASE("chart raster: texels of a square lie where they should, margins go on", "[unit]") {
  const MeshBlock plane = test::grid_block(4, 4, [](double, double) { return 0.0; });
  const TriangleSpan span{plane.position, plane.faces};
  const std::vector<MeshChart> charts = make_charts(span, {});
  REQUIRE(charts.size() == 1);
  const ChartRaster raster = raster_chart(charts[0], 0.5, 2);
  CHECK(raster.width == 12);
  CHECK(raster.height == 12);
  CHECK(raster.inside == 64);
  CHECK(raster.is_inside(2, 2));
  CHECK_FALSE(raster.is_inside(1, 5));
  CHECK(raster.at(1, 5) != ChartRaster::kEmpty);
  CHECK(raster.at(0, 0) == ChartRaster::kEmpty);  // farther off than two texels
  // Where the surface ends texels of the margin lie on its border.
  const auto none = [](std::uint32_t, std::uint32_t) { return std::optional<Double3>(); };
  const Double3 p = texel_place(span, charts[0], raster, 1, 5, none).position;
  CHECK(std::min({p[0], p[1], 4 - p[0], 4 - p[1]}) == Approx(0.0).margin(1e-12));
}

TEST_CASE("chart raster: no seam of a painted gradient shows under bilinear filtering", "[unit]") {
  const MeshBlock sphere = test::sphere_block(4);  // of radius 1
  for (const double texel : {0.01, 0.02, 0.04}) {
    // One channel from 0 to 255 across: at most 127.5 texel of change from texel to texel.
    const std::vector<Painted> charts =
        paint(sphere, texel, [](const Double3& p) { return 127.5 + 73.0 * (p[0] + p[1] + p[2]); });
    REQUIRE(charts.size() > 3);
    const double gradient = 73.0 * std::sqrt(3.0) * texel;
    // The same place of an edge seen from both of its faces.
    std::map<std::pair<std::uint32_t, std::uint32_t>,
             std::vector<std::pair<const Painted*, std::array<Double2, 2>>>>
        edges;
    for (const Painted& c : charts)
      for (std::size_t i = 0; i < c.chart.faces.size(); ++i)
        for (std::size_t k = 0; k < 3; ++k) {
          const auto& f = sphere.faces[c.chart.faces[i]];
          std::uint32_t a = f[k], b = f[(k + 1) % 3];
          std::array<Double2, 2> uv = {c.chart.uv[c.chart.corners[i][k]],
                                       c.chart.uv[c.chart.corners[i][(k + 1) % 3]]};
          if (a > b) std::swap(a, b), std::swap(uv[0], uv[1]);
          edges[{a, b}].push_back({&c, uv});
        }
    std::size_t seams = 0;
    double largest = 0.0;
    for (const auto& [edge, sides] : edges) {
      REQUIRE(sides.size() == 2);
      if (sides[0].first == sides[1].first) continue;
      ++seams;
      for (int i = 0; i <= 16; ++i) {
        std::array<double, 2> seen{};
        for (std::size_t s = 0; s < 2; ++s) {
          const auto& uv = sides[s].second;
          const double t = i / 16.0;
          seen[s] = sides[s].first->bilinear(
              {uv[0][0] + t * (uv[1][0] - uv[0][0]), uv[0][1] + t * (uv[1][1] - uv[0][1])});
        }
        largest = std::max(largest, std::fabs(seen[0] - seen[1]));
      }
    }
    CAPTURE(texel, seams, gradient);
    CHECK(seams > 20);
    CHECK(largest <= 1.0 + gradient);
  }
}

}  // namespace chart_raster_test
