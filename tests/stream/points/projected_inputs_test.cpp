#include "stream/points/projected_inputs.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "octree/error.h"
#include "stream/formats/proj_library.h"
#include "tests/helpers/random.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::projected_inputs_test {
namespace {

bool has_proj() {
  if (proj().library != nullptr) return true;
  test::skip("there is no libproj.so.25");
  return false;
}

std::string line(double x, double y, double z) {
  char text[128];
  std::snprintf(text, sizeof text, "%.10f %.10f %.4f\n", x, y, z);
  return text;
}

/// A hill of `size` metres with a house, as longitude, latitude, metres; or in metres from a corner.
std::string terrain(double size, bool degrees, int steps = 60) {
  std::string text;
  for (int i = 0; i < steps; ++i)
    for (int j = 0; j < steps; ++j) {
      const double x = size * i / steps, y = size * j / steps;
      const double z = 300 + size / 30 * std::sin(6 * x / size) * std::cos(5 * y / size) +
                       (std::abs(i - 30) < 6 && std::abs(j - 30) < 6 ? 5 : 0);
      text +=
          degrees ? line(9 + x / (111320 * std::cos(48 * M_PI / 180)), 48 + y / 111320, z) : line(x, y, z);
    }
  return text;
}

/// A pole: 30 m high, 0.3 m wide, far narrower than high.
std::string pole() {
  std::string text;
  for (int k = 0; k < 300; ++k)
    for (int i = 0; i < 24; ++i)
      text += line(12.3 + 0.15 * std::cos(i * M_PI / 12), 45.6 + 0.15 * std::sin(i * M_PI / 12), 0.1 * k);
  return text;
}

struct Result {
  std::vector<std::unique_ptr<PointFile>> files;
  std::vector<std::string> notes;
};

Result opened(const std::vector<std::filesystem::path>& paths, const CrsOptions& options,
              const ReadOptions& read = {}) {
  Result r;
  for (const auto& path : paths) r.files.push_back(open_point_file(path, read));
  r.files = in_one_plane(std::move(r.files), options, true, r.notes);
  return r;
}

std::string refusal(const std::vector<std::filesystem::path>& paths, const CrsOptions& options = {}) {
  try {
    opened(paths, options);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

}  // namespace

TEST_CASE("projected inputs: degrees are refused with the way out, named or by their look", "[unit]") {
  const test::TempFolder folder;
  for (const double size : {60.0, 2000.0, 20000.0}) {
    CAPTURE(size);
    const auto path = folder.write("d.xyz", terrain(size, true));
    CHECK_THAT(refusal({path}), Catch::Contains("look like degrees") && Catch::Contains("--project auto") &&
                                    Catch::Contains("EPSG:n") && Catch::Contains("d.xyz"));
    CHECK(refusal({path}, {.project = "off"}).empty());
    CHECK(refusal({folder.write("m.xyz", terrain(size, false))}).empty());
  }
  CHECK_THAT(refusal({folder.write("n.csv", "lon,lat,z\n9,48,300\n9.001,48,300\n9,48.001,300\n")}),
             Catch::Contains("are degrees"));
  // Higher than wide, but no ground.
  CHECK(refusal({folder.write("pole.xyz", pole())}).empty());
  CHECK(refusal({folder.write("few.xyz", "9 48 300\n9.00001 48.00001 400\n9.00002 48 500\n")}).empty());
}

TEST_CASE("projected inputs: auto takes the UTM zone of the middle of all files", "[unit]") {
  if (!has_proj()) return;
  const test::TempFolder folder;
  const auto path = folder.write("d.xyz", terrain(60, true));
  Result r = opened({path}, {.project = "auto"});
  REQUIRE(r.files.size() == 1);
  CHECK(r.files[0]->info().crs.horizontal == 32632);
  CHECK(r.files[0]->info().crs.wkt.rfind("PROJCS[", 0) == 0);
  REQUIRE(r.notes.size() == 1);
  CHECK_THAT(r.notes[0], Catch::Contains("EPSG:32632"));
  PointChunk all;
  const auto take = [&](const PointChunk& c) {
    for (std::size_t i = 0; i < c.size(); ++i) all.append(c, i);
  };
  for (const InputSlice& s : r.files[0]->slices(0, 5000)) r.files[0]->read(s, take);
  REQUIRE(all.size() == 3600);
  // Neighbours are a metre apart, as they were made; the scale of UTM is 0.9996 there.
  CHECK(std::abs(all.x[60] - all.x[0] - 0.9996) < 3e-3);
  CHECK(std::abs(all.y[1] - all.y[0] - 0.9996) < 4e-3);
  CHECK(all.z[0] == 300);
  CHECK(refusal({path}, {.project = "EPSG:25833"}).empty());
  CHECK_THROWS_AS(opened({path}, {.project = "EPSG:4258"}), UsageError);
  CHECK_THROWS_AS(opened({path}, {.project = "nonsense"}), UsageError);
  // In metres there is nothing to do, and nothing to know where from.
  const auto metres = folder.write("m.xyz", terrain(600, false));
  CHECK_THAT(refusal({metres}, {.project = "auto"}), Catch::Contains("--crs"));
  r = opened({metres}, {.crs = "EPSG:25832", .project = "auto"});
  CHECK(r.files[0]->info().crs.horizontal == 25832);
  // Both beside each other; the order does not matter.
  r = opened({folder.write("u.xyz", "500000 5300000 1\n500001 5300000 1\n")},
             {.crs = "EPSG:25832", .project = "EPSG:4839"});
  CHECK(r.files[0]->info().crs.horizontal == 4839);
  CHECK_THAT(refusal({folder.write("w.csv", "lon,lat,z\n-100,48,300\n100,48,300\n")}, {.project = "auto"}),
             Catch::Contains("too wide"));
}

TEST_CASE("projected inputs: what a user names overrules the files, and is told", "[unit]") {
  if (!has_proj()) return;
  const test::TempFolder folder;
  const auto path =
      folder.write("d.csv", "lon,lat,z\n500000,5300000,3\n500001,5300000,3\n500000,5300001,3\n");
  const Result r = opened({path}, {.crs = "EPSG:25832"});
  CHECK(r.files[0]->info().crs.horizontal == 25832);
  REQUIRE(r.notes.size() == 1);
  CHECK_THAT(r.notes[0], Catch::Contains("overrules"));
  CHECK_THROWS_AS(opened({path}, {.crs = "nonsense"}), UsageError);
}

}  // namespace tessera::projected_inputs_test
