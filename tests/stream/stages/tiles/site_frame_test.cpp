// Where sites lie on Earth, against places known otherwise.
#include "stream/stages/tiles/site_frame.h"

#include <catch2/catch.hpp>

#include "octree/portable_math.h"

namespace site_frame_test {

using namespace tessera;

namespace {

/// WGS 84 in UTM, zone 32 north; the unit as given.
std::string utm_32(const std::string& unit, const std::string& metres) {
  return R"(PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],)"
         R"(PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],)"
         R"(PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],PARAMETER["scale_factor",0.9996],)"
         R"(PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT[")" +
         unit + "\"," + metres + "]]";
}

Double3 column(const SiteFrame& frame, std::size_t c) {
  return {frame.transform[4 * c], frame.transform[4 * c + 1], frame.transform[4 * c + 2]};
}

}  // namespace

TEST_CASE("site frame: without a system the world is that of the scan", "[unit]") {
  const SiteFrame frame = site_frame("", {10, 20, 30}, {1, 1, 1});
  CHECK_FALSE(frame.geocentric);
  CHECK_THAT(frame.warning, Catch::Contains("no coordinate system is known"));
  CHECK((frame.transform == std::array<double, 16>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 20, 30, 1}));
}

TEST_CASE("site frame: on the equator at nine degrees east, axes and heights are those of the globe",
          "[unit]") {
  const SiteFrame frame = site_frame(utm_32("metre", "1"), {500000, 0, 100}, {100, 100, 10});
  INFO(frame.warning);
  REQUIRE(frame.geocentric);
  CHECK(frame.crs == "WGS 84 / UTM zone 32N");
  const SinCos nine = sin_cos(9.0 * kPi / 180.0);
  CHECK(norm(column(frame, 3) - Double3{6378237.0 * nine.cos, 6378237.0 * nine.sin, 0.0}) < 1e-6);
  CHECK(norm(column(frame, 2) - Double3{nine.cos, nine.sin, 0.0}) < 1e-6);  // up
  CHECK(norm(column(frame, 0) - Double3{-nine.sin, nine.cos, 0.0}) <
        1e-3);                                                // east, with the scale of the map
  CHECK(norm(column(frame, 1) - Double3{0, 0, 1.0}) < 1e-3);  // north
  CHECK(frame.misfit_m > 0.0);
  CHECK(frame.misfit_m < 0.01);
  CHECK(frame.warning.empty());

  const SiteFrame wide = site_frame(utm_32("metre", "1"), {500000, 0, 100}, {20000, 20000, 10});
  CHECK(wide.misfit_m > 50.0);
  CHECK(wide.misfit_m < 80.0);  // (2 x 20 km squared) / (2 x the radius of the Earth) is 62.7
  CHECK(wide.warning.find("the Earth is not") != std::string::npos);
}

TEST_CASE("site frame: heights without a system are in the unit of the map", "[unit]") {
  const double foot = 0.3048;
  const SiteFrame frame = site_frame(utm_32("foot", "0.3048"), {500000, 0, 1000}, {100, 100, 10});
  INFO(frame.warning);
  REQUIRE(frame.geocentric);
  CHECK(norm(column(frame, 2)) == Approx(foot).epsilon(1e-6));
  CHECK(norm(column(frame, 0)) == Approx(foot).epsilon(1e-2));
  CHECK(norm(column(frame, 3)) == Approx(6378137.0 + 1000 * foot).margin(50.0));
}

TEST_CASE("site frame: what is no projected system is told, and the scan's coordinates stay", "[unit]") {
  const std::string text =
      GENERATE("no system at all",
               "GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],"
               "PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]]");
  const SiteFrame frame = site_frame(text, {10, 20, 30}, {1, 1, 1});
  CHECK_FALSE(frame.geocentric);
  CHECK(frame.warning.find("coordinates of the mesh") != std::string::npos);
  CHECK(frame.transform[12] == 10.0);
}

}  // namespace site_frame_test
