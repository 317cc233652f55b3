#include "kernels/texture/coloured_chart.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>

namespace coloured_chart_test {

using namespace tessera;

namespace {

/// A plate of two faces whose vertices are black.
MeshBlock plate() {
  MeshBlock block;
  block.key = {0, 1, 2, 3};
  block.position = {{0, 0, 0}, {32, 0, 0}, {32, 32, 0}, {0, 32, 0}};
  block.rgba.assign(4, 0xff000000u);
  block.faces = {{0, 1, 2}, {0, 2, 3}};
  return block;
}

/// A point a unit above and below the plate, red by x, green by y.
void add_points(std::vector<Float3>& position, std::vector<std::uint32_t>& rgba) {
  for (int j = 0; j <= 32; ++j)
    for (int i = 0; i <= 32; ++i) {
      position.push_back({static_cast<float>(i), static_cast<float>(j), 0.05f});
      rgba.push_back(static_cast<std::uint32_t>(7 * i) | static_cast<std::uint32_t>(7 * j) << 8);
    }
}

}  // namespace

TEST_CASE("coloured chart: texels show the points, and the comparison finds it", "[unit]") {
  const MeshBlock block = plate();
  std::vector<Float3> position;
  std::vector<std::uint32_t> rgba;
  add_points(position, rgba);
  const PointColours points(position, rgba, {}, {1.0, 4.0, 8});
  const AcrossEdges edges(block);
  CHECK(edges.third(0, 2) == Double3{0, 32, 0});
  CHECK_FALSE(edges.third(1, 0));
  const ColourSource from{block, edges, points, {}};
  TexelCounts counts;
  std::vector<ColouredChart> charts;
  for (MeshChart& chart : make_charts({block.position, block.faces}, {}))
    charts.push_back(colour_chart(from, std::move(chart), 0.5, 2, counts));
  REQUIRE(charts.size() == 1);
  CHECK(counts.inside >= 64u * 64u);
  CHECK(counts.bare == 0);
  std::array<int, 3> rgb{};
  REQUIRE(charts[0].sample({16, 16}, rgb));
  CHECK(std::abs(rgb[0] - 112) <= 4);
  CHECK_FALSE(charts[0].sample({-9, 16}, rgb));
  const std::vector<std::uint8_t> core(2, 1);
  const ColourErrors errors =
      compare_colours(from, block, core, charts, {position, rgba, 4.0, {-1, -1, -1}, 1.0});
  REQUIRE(errors.points > 60);
  CHECK(errors.points < 300);
  CHECK(colour_psnr_db(errors.texture, errors.points) > 36.0);
  CHECK(colour_psnr_db(errors.vertices, errors.points) < 12.0);
}

TEST_CASE("coloured chart: where no point is near, vertices give their colours", "[unit]") {
  MeshBlock block = plate();
  block.rgba.assign(4, 0xff332211u);
  const PointColours none({}, {}, {}, {1.0, 4.0, 8});
  const AcrossEdges edges(block);
  TexelCounts counts;
  auto charts = make_charts({block.position, block.faces}, {});
  const ColouredChart chart = colour_chart({block, edges, none, {}}, std::move(charts.at(0)), 1.0, 2, counts);
  CHECK(counts.bare == counts.inside);
  std::array<int, 3> rgb{};
  REQUIRE(chart.sample({16, 16}, rgb));
  CHECK(rgb == std::array<int, 3>{0x11, 0x22, 0x33});
}

TEST_CASE("coloured chart: PSNR of one level of difference is 48.13 dB", "[unit]") {
  CHECK(colour_psnr_db(3 * 100, 100) == Approx(48.1308).epsilon(1e-5));
}

}  // namespace coloured_chart_test
