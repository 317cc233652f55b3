#include "stream/formats/points/projection.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "octree/error.h"
#include "stream/formats/proj_library.h"
#include "tests/helpers/skip.h"

namespace tessera::projection_test {
namespace {

bool has_proj() {
  if (proj().library != nullptr) return true;
  test::skip("there is no libproj.so.25");
  return false;
}

Crs code(int epsg) {
  Crs s;
  s.horizontal = epsg;
  s.name = "EPSG:" + std::to_string(epsg);
  return s;
}

const std::string kOgc =
    "PROJCS[\"WGS 84 / UTM zone 32N\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS "
    "84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],PROJECTION["
    "\"Transverse_Mercator\"],PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",9],"
    "PARAMETER["
    "\"scale_factor\",0.9996],PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",0],UNIT["
    "\"metre\",1]"
    "]";
const std::string kEsri =
    "PROJCS[\"WGS_1984_UTM_Zone_32N\",GEOGCS[\"GCS_WGS_1984\",DATUM[\"D_WGS_1984\",SPHEROID[\"WGS_1984\","
    "6378137.0,"
    "298.257223563]],PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"Transverse_"
    "Mercator\"],PARAMETER[\"False_Easting\",500000.0],PARAMETER[\"False_Northing\",0.0],PARAMETER[\"Central_"
    "Meridian\",9.0],PARAMETER[\"Scale_Factor\",0.9996],PARAMETER[\"Latitude_Of_Origin\",0.0],UNIT[\"Meter\","
    "1.0]]";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
  return text;
}

}  // namespace

TEST_CASE("projection: one system in several styles is one, other parameters are another", "[unit]") {
  if (!has_proj()) return;
  const Crs ogc = crs_of_wkt(kOgc), esri = crs_of_wkt(kEsri), utm32 = code(32632);
  const Crs compound =
      crs_of_wkt("COMPD_CS[\"both\"," + kOgc + ",VERT_CS[\"h\",VERT_DATUM[\"g\",2005],UNIT[\"metre\",1]]]");
  for (const auto* a : {&ogc, &esri, &compound, &utm32})
    for (const auto* b : {&ogc, &esri, &compound, &utm32}) {
      CAPTURE(a->name, b->name);
      CHECK(is_same_crs(*a, *b));
    }
  CHECK_FALSE(is_same_crs(esri, code(32633)));
  CHECK_FALSE(is_same_crs(esri, code(25832)));
  CHECK_FALSE(is_same_crs(code(25832), code(25833)));
  CHECK_FALSE(is_same_crs(ogc, crs_of_wkt(replaced(kEsri, "9.0]", "15.0]"))));
  CHECK_FALSE(
      is_same_crs(ogc, crs_of_wkt(replaced(kEsri, "\"Meter\",1.0", "\"Foot_US\",0.3048006096012192"))));
  CHECK_FALSE(is_same_crs(ogc, crs_of_wkt("PROJCS[\"nonsense\"]")));
  CHECK(is_same_crs(Crs{}, ogc));
}

TEST_CASE("projection: a user names systems by code or text, nothing else", "[unit]") {
  if (!has_proj()) return;
  const Crs utm = user_crs("EPSG:25832", "--crs");
  CHECK(utm.horizontal == 25832);
  CHECK(utm.wkt.rfind("PROJCS[", 0) == 0);
  CHECK(utm.wkt.find('\n') == std::string::npos);
  CHECK(user_crs("EPSG:4326", "--crs").geographic);
  CHECK(user_crs(kEsri, "--crs").name.find("32N") != std::string::npos);
  for (const char* odd : {"EPSG:1", "utm", "32632x", "EPSG:9122"}) {
    CAPTURE(odd);
    CHECK_THROWS_AS(user_crs(odd, "--crs"), UsageError);
  }
}

TEST_CASE("projection: the UTM zone of a place, on its datum", "[unit]") {
  if (!has_proj()) return;
  CHECK(utm_zone(code(4326), 9, 48).horizontal == 32632);
  CHECK(utm_zone(code(4326), 6, 48).horizontal == 32632);
  CHECK(utm_zone(code(4326), 5.999, -48).horizontal == 32731);
  CHECK(utm_zone(code(4326), 180, 1).horizontal == 32601);
  CHECK(utm_zone(code(4326), 359, 1).horizontal == 32630);
  CHECK(utm_zone(code(4258), 9, 48).horizontal == 25832);
  CHECK(utm_zone(code(4269), -100, 40).horizontal == 26914);
  CHECK(utm_zone(code(6318), -100, 40).horizontal == 6343);
  CHECK(utm_zone(code(7844), 151, -33).horizontal == 7856);
  CHECK_THROWS_AS(utm_zone(code(4326), 9, 85), InputError);
  CHECK_THROWS_AS(utm_zone(code(4326), 9000, 45), InputError);
}

TEST_CASE("projection: points go where the formulas of the projection have them", "[unit]") {
  if (!has_proj()) return;
  const Projection projection(code(4326), code(32632));
  // On the central meridian easting is 500 km, northing the meridian arc times 0.9996 (48 degrees: 5,318,354.8 m).
  std::vector<double> x = {9, 9, 10, 1e300}, y = {0, 48, 48, 48}, z = {1, 2, 3, 4};
  projection.apply(x, y, z);
  CHECK(x[0] == 500000);
  CHECK(y[0] == 0);
  CHECK(x[1] == 500000);
  const double arc = 6367449.145823 * 48 * M_PI / 180 - 16038.508742 * std::sin(2 * 48 * M_PI / 180) +
                     16.832613 * std::sin(4 * 48 * M_PI / 180) - 0.021984 * std::sin(6 * 48 * M_PI / 180);
  CHECK(std::abs(y[1] - 0.9996 * arc) < 1e-3);
  CHECK(std::abs(x[2] - 574600) < 100);
  CHECK(std::isnan(x[3]));
  CHECK(z == std::vector<double>{1, 2, 3, 4});
  for (const double v : {x[1], y[1], x[2], y[2]}) CHECK(v * 16384 == std::floor(v * 16384));
  // Heights take the unit of the result.
  Crs feet = code(4326);
  feet.height_unit = 0.3048;
  z = {10};
  x = {9}, y = {48};
  Projection(feet, code(32632)).apply(x, y, z);
  CHECK(std::abs(z[0] - 3.048) < 1e-12);
}

}  // namespace tessera::projection_test
