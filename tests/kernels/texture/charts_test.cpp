#include "kernels/texture/charts.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/helpers/block_meshes.h"

namespace charts_test {

using namespace tessera;

namespace {

TriangleSpan charted(const MeshBlock& block) {
  return {block.position, block.faces};
}

struct ChartSums {
  ChartStretch stretch;
  std::size_t charts = 0, flipped = 0, overlapping = 0, faces = 0;
};

ChartSums sums_of(const MeshBlock& block, const ChartOptions& options) {
  ChartSums sums;
  std::vector<int> seen(block.faces.size(), 0);
  for (const MeshChart& chart : make_charts(charted(block), options)) {
    sums.stretch.merge(measure_stretch(charted(block), chart));
    sums.flipped += count_flipped(chart);
    sums.overlapping += count_overlapping(chart);
    sums.faces += chart.faces.size();
    ++sums.charts;
    for (const std::uint32_t f : chart.faces) ++seen[f];
    for (const Double2& p : chart.uv)
      CHECK((p[0] >= 0.0 && p[1] >= 0.0 && p[0] <= chart.extent[0] && p[1] <= chart.extent[1]));
    if (options.max_extent > 0.0 && chart.faces.size() > 1)
      CHECK(std::max(chart.extent[0], chart.extent[1]) <= 1.5 * options.max_extent);
  }
  for (const int s : seen) CHECK(s == 1);
  return sums;
}

/// A ramp that winds around the z axis: a projection along it lies over itself.
MeshBlock ramp(int turns) {
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  const int steps = 24 * turns;
  for (int i = 0; i <= steps; ++i) {
    const double at = 2.0 * 3.14159265358979 * i / 24.0;
    for (const double r : {1.0, 2.0}) position.push_back({r * std::cos(at), r * std::sin(at), 0.1 * i});
  }
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(steps); ++i) {
    faces.push_back({2 * i, 2 * i + 1, 2 * i + 3});
    faces.push_back({2 * i, 2 * i + 3, 2 * i + 2});
  }
  return test::make_block(position, faces);
}

}  // namespace

TEST_CASE("charts: a plane is one chart, true to scale", "[unit]") {
  const MeshBlock plane = test::grid_block(20, 10, [](double, double) { return 0.0; });
  const ChartSums sums = sums_of(plane, {});
  CHECK(sums.charts == 1);
  CHECK(sums.stretch.l2() == Approx(1.0));
  CHECK(sums.stretch.plane == Approx(200.0));
}

TEST_CASE("charts: a sphere is cut into few charts without flips, overlaps or much stretch", "[unit]") {
  const MeshBlock sphere = test::sphere_block(5);
  for (const double unfold : {0.0, 80.0}) {
    ChartOptions options;
    options.unfold_cone_deg = unfold;
    const ChartSums sums = sums_of(sphere, options);
    CHECK(sums.flipped == 0);
    CHECK(sums.overlapping == 0);
    CHECK(sums.charts <= 40);
    CHECK(sums.stretch.l2() < 1.15);
  }
}

TEST_CASE("charts: a ramp that lies over itself is parted", "[unit]") {
  const MeshBlock block = ramp(3);
  ChartOptions options;
  options.unfold_cone_deg = 0.0;
  const ChartSums sums = sums_of(block, options);
  CHECK(sums.charts >= 3);
  CHECK(sums.overlapping == 0);
}

TEST_CASE("charts: none is larger than allowed", "[unit]") {
  const MeshBlock hills =
      test::grid_block(60, 60, [](double x, double y) { return std::sin(0.3 * x) * std::cos(0.2 * y); });
  ChartOptions options;
  options.max_extent = 20.0;
  CHECK(sums_of(hills, options).charts >= 9);
}

}  // namespace charts_test
