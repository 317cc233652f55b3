// Virtual point clouds name their files; whatever else they say is passed over.
#include <catch2/catch.hpp>

#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/formats/points/point_source.h"
#include "stream/formats/points/virtual_cloud.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::virtual_cloud_test {
namespace {

std::string feature(const std::string& assets) {
  return R"({"type":"Feature","stac_version":"1.0.0","assets":{)" + assets + "}}";
}
std::string asset(const std::string& name, const std::string& href, const std::string& role) {
  return "\"" + name + R"(":{"href":")" + href + R"(","roles":[")" + role + "\"]}";
}
std::string cloud(const std::string& features) {
  return R"({"type":"FeatureCollection","features":[)" + features + "]}";
}

std::string error_of(const std::filesystem::path& path) {
  try {
    virtual_cloud_files(path);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST_CASE("virtual cloud: files lie where it says, overviews are left out", "[unit]") {
  const test::TempFolder folder;
  std::filesystem::create_directories(folder / "site/tiles");
  for (const char* f : {"site/a.laz", "site/tiles/b c.copc.laz", "other.las", "site/overview.copc.laz"})
    folder.write(f, "x");
  const std::string other = (folder / "other.las").string();
  const auto list =
      folder.write("site/all.vpc", cloud(feature(asset("data", "./a.laz", "data")) + "," +
                                         feature(asset("data", "tiles/b%20c.copc.laz", "data") + "," +
                                                 asset("overview", "./overview.copc.laz", "overview")) +
                                         "," + feature(asset("data", "file://" + other, "data"))));
  const std::vector<std::filesystem::path> want = {folder / "site/a.laz", folder / "site/tiles/b c.copc.laz",
                                                   folder / "other.las"};
  CHECK(virtual_cloud_files(list) == want);
  CHECK(is_virtual_cloud("A.VPC"));
  // As an input, alone, in a glob, and beside a file that it names: none counts twice.
  const InputList inputs = list_inputs({list.string(), want[0].string()});
  CHECK(inputs.files == want);
  REQUIRE(inputs.notes.size() == 1);
  CHECK(inputs.notes[0] == list.string() + ": 3 files of points (2 laz, 1 las)");
  CHECK(expand_inputs({(folder / "site/*.vpc").string()}) == want);
  // In a folder it is passed over: the files beside it are found themselves.
  CHECK(expand_inputs({(folder / "site").string()}).size() == 3);
}

TEST_CASE("virtual cloud: what cannot be read is refused by name", "[unit]") {
  const test::TempFolder folder;
  const auto refused = [&](const std::string& text) { return error_of(folder.write("a.vpc", text)); };
  CHECK_THAT(refused(cloud(feature(asset("data", "https://x.org/a.laz", "data")))),
             Catch::Contains("a.vpc: names https://x.org/a.laz, which lies on a network"));
  CHECK_THAT(refused(cloud(feature(asset("data", "/vsicurl/x", "data")))), Catch::Contains("on a network"));
  CHECK_THAT(refused(cloud(feature(asset("data", "./none.laz", "data")))),
             Catch::Contains("none.laz, and there is no such file"));
  CHECK_THAT(refused(cloud(feature(asset("overview", "./a.laz", "overview")))),
             Catch::Contains("feature 1 names no file"));
  CHECK_THAT(refused(cloud("")), Catch::Contains("names no file"));
  CHECK_THAT(refused("[]"), Catch::Contains("is no virtual point cloud"));
  CHECK_THAT(refused(R"({"features":[1,)"), Catch::Contains("is no virtual point cloud"));
}

}  // namespace
}  // namespace tessera::virtual_cloud_test
