#include "stream/formats/points/crs.h"

#include <catch2/catch.hpp>

#include "tests/helpers/point_reading.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::crs_test {
namespace {

using test::put;

const std::string kWkt =
    "COMPD_CS[\"Grid + heights\",PROJCS[\"A \"\"quoted\"\" "
    "[grid]\",GEOGCS[\"Base\",AUTHORITY[\"EPSG\",\"4326\"]],"
    "UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"32633\"]],VERT_CS[\"Heights\",AUTHORITY[\"EPSG\",\"5703\"]]]";

/// A variable length record.
std::string record(const std::string& user, std::uint16_t id, const std::string& bytes) {
  std::string r(2, '\0');
  r += user + std::string(16 - user.size(), '\0');
  put(r, id), put(r, static_cast<std::uint16_t>(bytes.size()));
  return r + std::string(32, '\0') + bytes;
}

std::string keys(const std::vector<std::uint16_t>& words) {
  std::string r;
  for (const std::uint16_t w :
       {std::uint16_t{1}, std::uint16_t{1}, std::uint16_t{0}, static_cast<std::uint16_t>(words.size() / 4)})
    put(r, w);
  for (const std::uint16_t w : words) put(r, w);
  return r;
}

/// A header of LAS 1.2 without points, with these records.
std::string header(const std::vector<std::string>& records, std::uint32_t claimed = 0) {
  std::string f(94, '\0');
  f.replace(0, 4, "LASF");
  f[24] = 1, f[25] = 2;
  put(f, std::uint16_t{227}), put(f, std::uint32_t{227});
  put(f, claimed > 0 ? claimed : static_cast<std::uint32_t>(records.size()));
  f.resize(227);
  for (const std::string& r : records) f += r;
  return f;
}

Crs read(const std::string& bytes, std::size_t expected_warnings = 0) {
  const test::TempFolder folder;
  std::vector<std::string> warnings;
  const Crs crs = las_crs(ReadFile(folder.write("a.las", bytes)), warnings);
  CHECK(warnings.size() == expected_warnings);
  return crs;
}

}  // namespace

TEST_CASE("coordinate system: WKT gives name and codes, those of the parts it is based on are not taken",
          "[unit]") {
  const Crs crs = read(header({record("LASF_Projection", 2112, kWkt + std::string(3, '\0'))}));
  CHECK(crs.name == "Grid + heights");
  CHECK(crs.wkt == kWkt);
  CHECK(crs.horizontal == 32633);
  CHECK(crs.vertical == 5703);
  CHECK(crs_of_wkt("PROJCS[\"X\",GEOGCS[\"Y\",AUTHORITY[\"EPSG\",\"4326\"]],UNIT[\"m\",1]]").horizontal == 0);
  CHECK(crs_of_wkt("PROJCRS[\"X\",BASEGEOGCRS[\"Y\",ID[\"EPSG\",4326]],ID[\"EPSG\",2154]]").horizontal ==
        2154);
  for (const char* odd :
       {"", "PROJCS", "PROJCS[", "PROJCS[\"", "]]]]", "\"\"", "PROJCS[\"a\",AUTHORITY[\"EPSG\",\"9"})
    CHECK(crs_of_wkt(odd).horizontal == 0);
}

TEST_CASE("coordinate system: GeoTIFF keys give codes, else what they cite", "[unit]") {
  const std::string projected = keys({1024, 0, 1, 1, 2048, 0, 1, 4269, 3072, 0, 1, 2229, 4096, 0, 1, 5703});
  CHECK(read(header({record("LASF_Projection", 34735, projected)})).name == "EPSG:2229 + EPSG:5703");
  const std::string geographic = keys({1024, 0, 1, 2, 2048, 0, 1, 4269});
  CHECK(read(header({record("LASF_Projection", 34735, geographic)})).horizontal == 4269);
  const std::string cited = keys({1024, 0, 1, 1, 1026, 34737, 8, 2, 3072, 0, 1, 32767});
  CHECK(
      read(header({record("LASF_Projection", 34737, "x|My grid|"), record("LASF_Projection", 34735, cited)}))
          .name == "My grid");
  // A citation out of its text, a directory that claims more keys than it has, records of others.
  const std::string beyond = keys({1026, 34737, 8, 200, 3072, 0, 1, 32767});
  CHECK_FALSE(read(header({record("LASF_Projection", 34735, beyond)})).known());
  CHECK_FALSE(read(header({record("LASF_Projection", 34735, projected.substr(0, 11))})).known());
  CHECK_FALSE(read(header({record("liblas", 2112, kWkt)})).known());
}

TEST_CASE("coordinate system: the WKT counts where the header says so, else GeoTIFF keys that differ",
          "[unit]") {
  const std::string utm33 = "PROJCS[\"UTM 33\",GEOGCS[\"WGS 84\"],AUTHORITY[\"EPSG\",\"32633\"]]";
  const std::string keys32 = record("LASF_Projection", 34735, keys({1024, 0, 1, 1, 3072, 0, 1, 32632}));
  std::string file = header({keys32, record("LASF_Projection", 2112, utm33)});
  CHECK(read(file, 1).horizontal == 32632);
  file[6] = 16;  // bit 4 of the global encoding
  CHECK(read(file).horizontal == 32633);
  file[6] = 0, file[104] = static_cast<char>(0x80 + 6);
  CHECK(read(file).horizontal == 32633);
  // A text without a code takes none of other keys.
  const std::string feet = "PROJCS[\"Feet\",GEOGCS[\"G\"],UNIT[\"Foot_US\",0.3048006096012192]]";
  file = header({keys32, record("LASF_Projection", 2112, feet)});
  file[6] = 16;
  const Crs crs = read(file);
  CHECK(crs.name == "Feet");
  CHECK(crs.horizontal == 0);
}

TEST_CASE("coordinate system: degrees and units of heights are told", "[unit]") {
  CHECK(read(header({record("LASF_Projection", 34735, keys({1024, 0, 1, 2, 2048, 0, 1, 4269}))})).geographic);
  CHECK(
      read(header({record("LASF_Projection", 34735, keys({1024, 0, 1, 2, 2048, 0, 1, 32767}))})).geographic);
  CHECK(read(header({record("LASF_Projection", 34735, keys({2048, 0, 1, 4326, 4099, 0, 1, 9003}))}))
            .height_unit == 1200.0 / 3937.0);
  CHECK_FALSE(read(header({record("LASF_Projection", 34735,
                                  keys({1024, 0, 1, 1, 2048, 0, 1, 4269, 3072, 0, 1, 2229}))}))
                  .geographic);
  const std::string degrees = "GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\"],UNIT[\"degree\",0.0174532925199433]]";
  CHECK(crs_of_wkt(degrees).geographic);
  CHECK(crs_of_wkt("GEOGCRS[\"WGS 84\",CS[ellipsoidal,2]]").geographic);
  CHECK_FALSE(crs_of_wkt("GEODCRS[\"WGS 84\",CS[Cartesian,3]]").geographic);
  CHECK_FALSE(crs_of_wkt(kWkt).geographic);
  const Crs both = crs_of_wkt("COMPD_CS[\"a\"," + degrees +
                              ",VERT_CS[\"h\",VERT_DATUM[\"d\",2005],UNIT[\"foot\",0.3048]]]");
  CHECK(both.geographic);
  CHECK(both.height_unit == 0.3048);
}

TEST_CASE("coordinate system: damaged records are told and survived", "[fault]") {
  const std::string good = record("LASF_Projection", 2112, kWkt);
  CHECK(read(header({good}, 4'000'000'000u), 1).known());
  CHECK(read(header({good, good.substr(0, 30)}), 1).known());
  std::string longer = good;
  longer[21] = '\x7f';
  CHECK_FALSE(read(header({longer}), 1).known());
}

TEST_CASE("coordinate system: systems differ where codes or, without codes, texts and names do", "[unit]") {
  const Crs none, a{"EPSG:1", "", 1, 0}, b{"EPSG:2", "", 2, 0}, high{"EPSG:1 + EPSG:9", "", 1, 9};
  const Crs other{"EPSG:1 + EPSG:8", "", 1, 8}, text{"N", "A[\"N\"]", 0, 0}, spaced{"N", "A[ \"N\" ]", 0, 0};
  CHECK(may_be_same(none, a));
  CHECK(may_be_same(a, a));
  CHECK_FALSE(may_be_same(a, b));
  CHECK(may_be_same(a, high));
  CHECK_FALSE(may_be_same(high, other));
  CHECK(may_be_same(text, spaced));
  CHECK_FALSE(may_be_same(text, {"M", "A[\"M\"]", 0, 0}));
}

TEST_CASE("coordinate system: as real files have it", "[unit][.shared]") {
  if (!test::has_shared_data()) return;
  std::vector<std::string> warnings;
  const auto of = [&](const char* name) {
    return las_crs(ReadFile(test::kSharedData / "lidar" / name), warnings);
  };
  CHECK(of("autzen-trim.las").name == "NAD_1983_HARN_Lambert_Conformal_Conic");
  CHECK(of("autzen-trim.las").wkt.substr(0, 8) == "PROJCS[\"");
  CHECK(of("certainty3d.las").horizontal == 2229);
  CHECK(of("ign-2023.laz").name == "RGF93 v1 / Lambert-93");
  CHECK(of("ign-2023.laz").horizontal == 2154);
  CHECK(warnings.empty());
}

}  // namespace tessera::crs_test
