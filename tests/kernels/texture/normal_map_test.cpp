#include "kernels/texture/normal_map.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/portable_math.h"

namespace normal_map_test {

using namespace tessera;

namespace {

/// A plate in a plane of its own, two faces.
MeshBlock tilted_plate(const Double3& e1, const Double3& e2) {
  MeshBlock block;
  block.key = {0, 1, 2, 3};
  block.position = {{0, 0, 0}, e1 * 32.0, e1 * 32.0 + e2 * 32.0, e2 * 32.0};
  block.faces = {{0, 1, 2}, {0, 2, 3}};
  return block;
}

/// Normals of a bump in the frame of the plate.
Double3 bump(double x, double y) {
  return unit_or_zero(Double3{0.4 * sin_cos(0.4 * x).cos, 0.3 * sin_cos(0.3 * y).sin, 1.0});
}

}  // namespace

TEST_CASE("normal map: a known bump comes back from its page, however the chart is turned", "[unit]") {
  const Double3 e1 = unit_or_zero(Double3{1.0, 0.2, -0.3}),
                e2 = unit_or_zero(cross(Double3{0.1, -0.4, 1.0}, e1)), up = cross(e1, e2);
  const MeshBlock block = tilted_plate(e1, e2);
  std::vector<Float3> position;
  std::vector<std::uint32_t> rgba, normal;
  for (int j = 0; j <= 128; ++j)
    for (int i = 0; i <= 128; ++i) {
      const Double3 n = bump(0.25 * i, 0.25 * j);
      position.push_back(narrow(e1 * (0.25 * i) + e2 * (0.25 * j)));
      rgba.push_back(0);
      normal.push_back(pack_normal(e1 * n[0] + e2 * n[1] + up * n[2]));
    }
  const PointColours points(position, rgba, normal, {0.25, 2.0, 8});
  const AcrossEdges edges(block);
  const ColourSource from{block, edges, points, {}};
  const std::vector<Double3> flat = star_normals(block, block);
  for (const Double3& n : flat) CHECK(dot(n, up) > 1.0 - 1e-12);
  const TriangleSpan mesh{block.position, block.faces};
  TexelCounts counts;
  auto charts = make_charts(mesh, {});
  REQUIRE(charts.size() == 1);
  const ColouredChart chart = colour_chart(from, std::move(charts[0]), 0.25, 2, counts);
  for (std::uint32_t turns = 0; turns < 4; ++turns) {
    const std::vector<std::uint32_t> pixels = normal_pixels(from, chart, flat, turns);
    const std::vector<Double3> tangent = chart_tangents(mesh, chart.chart, flat, turns);
    const ChartRaster raster = raster_chart(chart.chart, 0.25, 2);
    double worst = 1.0;
    std::size_t seen = 0;
    for (int y = 0; y < raster.height; ++y)
      for (int x = 0; x < raster.width; ++x) {
        if (!raster.is_inside(x, y)) continue;
        const TexelPlace place = texel_place(mesh, chart.chart, raster, x, y, from.across());
        const std::uint32_t c = pixels[static_cast<std::size_t>(y * raster.width + x)];
        Double3 n{};
        for (std::size_t k = 0; k < 3; ++k) n[k] = (c >> (8 * k) & 255u) / 127.5 - 1.0;
        const Double3& right = tangent[0];
        const Double3 decoded = unit_or_zero(right * n[0] + cross(up, right) * n[1] + up * n[2]);
        const Double3 want = bump(dot(place.position, e1), dot(place.position, e2));
        worst = std::min(worst, dot(decoded, e1 * want[0] + e2 * want[1] + up * want[2]));
        ++seen;
      }
    CHECK(seen > 16000);
    CHECK(worst > cosine_of_degrees(1.5));
    // Along +u of the page: as the chart is turned.
    const Double2 a = chart.chart.uv[0], b = chart.chart.uv[1];
    const Double3 edge = block.position[chart.chart.vertices[1]] - block.position[chart.chart.vertices[0]];
    const std::array<double, 4> along = {b[0] - a[0], a[1] - b[1], a[0] - b[0], b[1] - a[1]};
    CHECK(dot(edge, tangent[0]) == Approx(along[turns]).margin(1e-9));
  }
}

TEST_CASE("normal map: without points it is the surface itself", "[unit]") {
  const MeshBlock block = tilted_plate({1, 0, 0}, {0, 1, 0});
  const PointColours none({}, {}, {}, {1.0, 4.0, 8});
  const AcrossEdges edges(block);
  const ColourSource from{block, edges, none, {}};
  TexelCounts counts;
  auto charts = make_charts({block.position, block.faces}, {});
  const ColouredChart chart = colour_chart(from, std::move(charts.at(0)), 1.0, 2, counts);
  for (const std::uint32_t c : normal_pixels(from, chart, star_normals(block, block), 0))
    CHECK((c == 0 || c == 0xffff8080u));
}

}  // namespace normal_map_test
