// Cells of a raster against what is known of the faces below them.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/survey/plan_raster.h"
#include "tests/helpers/random.h"

namespace plan_raster_test {

using namespace tessera;

namespace {

using Corners = std::array<Double3, 3>;

bool equal(const RasterCell& a, const RasterCell& b) {
  return a.top == b.top && a.ground == b.ground && a.gradient_x == b.gradient_x &&
         a.gradient_y == b.gradient_y && a.rgba == b.rgba;
}

/// The unit square [0, n] x [-n, 0] in two faces, at heights of a plane.
template <class Height>
void add_square(PlanRaster& raster, double n, const Height& height) {
  const Double3 a = {0, -n, height(0.0, -n)}, b = {n, -n, height(n, -n)}, c = {n, 0, height(n, 0.0)},
                d = {0, 0, height(0.0, 0.0)};
  raster.add({a, b, c}, nullptr);
  raster.add({a, c, d}, nullptr);
}

}  // namespace

TEST_CASE("plan raster: a plane at the centres of cells, without a gap along the diagonal", "[unit]") {
  PlanRaster raster({0, 0, 8, 8}, 0.5);
  // The diagonal goes through centres of cells.
  add_square(raster, 4.0, [](double x, double y) { return 10.0 + 0.25 * x - 0.5 * y; });
  for (std::int64_t r = 0; r < 8; ++r)
    for (std::int64_t c = 0; c < 8; ++c) {
      const RasterCell& cell = raster.cells()[static_cast<std::size_t>(8 * r + c)];
      CHECK(cell.top ==
            10.0 + 0.125 * (static_cast<double>(c) + 0.5) + 0.25 * (static_cast<double>(r) + 0.5));
      CHECK(cell.ground == cell.top);
      CHECK(cell.gradient_x == 0.25F);
      CHECK(cell.gradient_y == -0.5F);
      CHECK(cell.rgba == 0);
    }
}

TEST_CASE("plan raster: the highest and the lowest of several, walls cover nothing", "[unit]") {
  PlanRaster raster({0, 0, 4, 4}, 1.0);
  add_square(raster, 4.0, [](double, double) { return 1.0; });
  add_square(raster, 2.0, [](double x, double) { return 5.0 + x; });
  raster.add({Double3{2, 0, -9}, {2, -4, -9}, {2, -4, 99}}, nullptr);               // upright
  raster.add({Double3{0.5, -0.5, 70}, {0.5, -0.5, 80}, {0.5, -0.5, 90}}, nullptr);  // a line
  const auto& cells = raster.cells();
  CHECK(cells[0].top == 5.5);
  CHECK(cells[0].ground == 1.0);
  CHECK(cells[0].gradient_x == 1.0F);
  CHECK(cells[3].top == 1.0);
  CHECK(cells[15].ground == 1.0);
  CHECK(std::count_if(cells.begin(), cells.end(), [](const RasterCell& c) { return c.top > 1.0; }) == 4);
}

TEST_CASE("plan raster: colours by barycentric weights, and corners without colour have no say", "[unit]") {
  PlanRaster raster({0, 0, 3, 3}, 1.0);
  const Corners corner = {Double3{0, 0, 0}, {3, 0, 0}, {0, -3, 0}};
  const std::array<std::uint32_t, 3> rgba = {0xff0000ffu, 0xff00ff00u, 0xffff0000u};
  raster.add(corner, &rgba);
  // At (0.5, -0.5): weights 2/3, 1/6, 1/6.
  CHECK(raster.cells()[0].rgba == (0xff000000u | 43u << 16 | 43u << 8 | 170u));
  PlanRaster partly({0, 0, 3, 3}, 1.0);
  const std::array<std::uint32_t, 3> one = {0, 0xff102030u, 0};
  partly.add(corner, &one);
  CHECK(partly.cells()[0].rgba == 0xff102030u);
  CHECK(partly.cells()[8].covered() == false);
}

TEST_CASE("plan raster: neither the order of faces and corners nor the window changes a bit", "[property]") {
  test::Random random(3);
  std::vector<Corners> faces;
  std::vector<std::array<std::uint32_t, 3>> colours;
  // Corners on centres of cells too, so that ties are many.
  const auto place = [&](double side) { return 0.25 * std::floor(random.in(0.0, 4.0 * side)); };
  for (int n = 0; n < 200; ++n) {
    Corners c;
    std::array<std::uint32_t, 3> rgba{};
    for (std::size_t k = 0; k < 3; ++k) {
      c[k] = {place(40.0), -place(30.0), 0.5 * std::floor(random.in(0.0, 4.0))};
      rgba[k] = static_cast<std::uint32_t>(random.in(0.0, 0xffffff)) | 0xff000000u;
    }
    faces.push_back(c);
    colours.push_back(rgba);
  }
  PlanRaster whole({0, 0, 40, 30}, 1.0);
  for (std::size_t f = 0; f < faces.size(); ++f) whole.add(faces[f], &colours[f]);
  for (const std::int64_t side : {1, 7, 64}) {
    for (std::int64_t r = 0; r < 30; r += side)
      for (std::int64_t c = 0; c < 40; c += side) {
        PlanRaster part({c, r, std::min<std::int64_t>(side, 40 - c), std::min<std::int64_t>(side, 30 - r)},
                        1.0);
        for (std::size_t f = faces.size(); f-- > 0;) {
          const std::array<std::uint32_t, 3> turned = {colours[f][1], colours[f][2], colours[f][0]};
          part.add({faces[f][1], faces[f][2], faces[f][0]}, &turned);
        }
        const RasterWindow& w = part.window();
        bool same = true;
        for (std::int64_t y = 0; y < w.rows; ++y)
          for (std::int64_t x = 0; x < w.columns; ++x)
            same = same && equal(part.cells()[static_cast<std::size_t>(y * w.columns + x)],
                                 whole.cells()[static_cast<std::size_t>((r + y) * 40 + c + x)]);
        CHECK(same);
      }
  }
  CHECK(std::count_if(whole.cells().begin(), whole.cells().end(),
                      [](const RasterCell& c) { return c.covered(); }) > 900);
}

}  // namespace plan_raster_test
