#include "stream/stages/scan/point_colours.h"

#include <catch2/catch.hpp>

#include <set>

#include "octree/error.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"

namespace point_colours_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("intensities: the range leaves two in a hundred out at either end", "[unit]") {
  IntensityHistogram h;
  PointChunk c;
  c.intensity.assign(10, 0);
  h.add(c);
  c.intensity.assign(980, 900);
  h.add(c);
  c.intensity.assign(10, 65535);
  h.add(c);
  CHECK(h.range() == std::array<double, 2>{900.0, 961.0});
  IntensityHistogram other;
  other.merge({h.counts().begin(), h.counts().end()});
  CHECK(other.range() == h.range());
  CHECK(IntensityHistogram().range()[0] < IntensityHistogram().range()[1]);
}

TEST_CASE("colours: by intensity, class and height", "[unit]") {
  Plan plan;
  plan.colour_range = {100.0, 300.0};
  PointChunk c;
  c.x = c.y = c.z = {0, 0, 0};
  c.intensity = {50, 200, 400};
  c.echo = {{2, 1, 1}, {6, 1, 1}, {2, 1, 1}};
  c.rgba = {1, 2, 3};
  std::vector<std::uint32_t> rgba;
  colour_points(ColourBy::kIntensity, plan, c, c.z, rgba);
  CHECK(rgba == std::vector<std::uint32_t>{0xff000000u, 0xff7f7f7fu, 0xffffffffu});
  colour_points(ColourBy::kClass, plan, c, c.z, rgba);
  CHECK(rgba[0] == rgba[2]);
  CHECK(rgba[0] != rgba[1]);
  colour_points(ColourBy::kHeight, plan, c, {100.0, 200.0, 300.0}, rgba);
  CHECK(rgba == std::vector<std::uint32_t>{0xffff0000u, 0xff00ff00u, 0xff0000ffu});
  colour_points(ColourBy::kRgb, plan, c, c.z, rgba);
  CHECK(rgba == c.rgba);
  c.rgba.clear();
  colour_points(ColourBy::kRgb, plan, c, c.z, rgba);
  CHECK(rgba == std::vector<std::uint32_t>{0, 0, 0});
}

TEST_CASE("colours: height goes from blue below to red above, none has none", "[unit]") {
  const auto points = sphere_points(4000, 50.0, {0, 0, 1000});
  ChainSetup setup;
  setup.options.colour = "height";
  const ChainResult r = run_chain(points, setup);
  REQUIRE(r.plan.has_colour);
  int checked = 0;
  for (const PointRecord& p : r.points) {
    const double z = world_of(r.plan, p)[2];
    const std::uint32_t red = p.rgba & 255u;
    const std::uint32_t blue = p.rgba >> 16 & 255u;
    if (z < 965.0 && ++checked > 0) CHECK((red == 0 && blue > 0));
    if (z > 1035.0 && ++checked > 0) CHECK((red > 0 && blue == 0));
  }
  CHECK(checked > 100);
  setup.options.colour = "none";
  CHECK_FALSE(run_chain(points, setup).plan.has_colour);
  setup.options.colour = "class";
  CHECK_THROWS_AS(run_chain(points, setup), UsageError);
  setup.options.colour = "intensity";
  CHECK_THROWS_AS(run_chain(points, setup), UsageError);
}

}  // namespace point_colours_test
