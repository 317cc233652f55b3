#include "stream/commands/convert_points.h"
#include "stream/files/json.h"

#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>

#include "stream/points/point_summary.h"
#include "tests/helpers/laz_file.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::convert_points_test {
namespace {

/// A coloured cloud with normals, as text with all digits; point 7 is not finite.
std::string cloud(int count) {
  std::ostringstream text;
  text.precision(17);
  text << "x y z nx ny nz r g b\n";
  for (int i = 0; i < count; ++i) {
    if (i == 7) {
      text << "nan 0 0 0 0 1 1 2 3\n";
      continue;
    }
    text << i * 0.1 << ' ' << i % 17 << ' ' << i * -0.25 << " 0 " << (i % 2 == 0 ? "0.6 0.8" : "0 0") << ' '
         << i % 256 << " 2 3\n";
  }
  return text.str();
}

TEST_CASE("convert: text to PLY, LAS and text again keeps positions, normals and colours", "[unit]") {
  const test::TempFolder folder;
  const auto in = folder.write("in.xyz", cloud(5000));
  const auto whole = test::read_points(in);
  for (const char* name : {"out.ply", "out.xyz", "out.las"}) {
    CAPTURE(name);
    const auto out = folder.path() / name;
    const ConvertReport report = convert_points({in}, out, {});
    CHECK(report.points == 4999);
    CHECK(report.not_finite == 1);
    CHECK(report.bytes == std::filesystem::file_size(out));
    const auto r = test::read_points(out);
    const bool las = std::string(name) == "out.las";
    CHECK(r.info.warnings.empty());
    CHECK(r.info.attributes.normals == !las);
    CHECK(report.notes.size() == (las ? 1 : 0));
    REQUIRE(r.points.size() == 4999);
    for (std::size_t i = 0, from = 0; i < r.points.size(); ++i, ++from) {
      if (from == 7) ++from;
      REQUIRE(std::abs(r.points.x[i] - whole.points.x[from]) <= (las ? 1e-6 : 0));
      REQUIRE(std::abs(r.points.z[i] - whole.points.z[from]) <= (las ? 1e-6 : 0));
      if (!las) REQUIRE(r.points.nz[i] == whole.points.nz[from]);
      REQUIRE(r.points.rgba[i] == whole.points.rgba[from]);
    }
  }
}

/// Of the notes those that are no warnings of an input.
std::vector<std::string> left_out(const ConvertReport& report) {
  std::vector<std::string> few;
  for (const std::string& note : report.notes)
    if (note.find("left out") != std::string::npos) few.push_back(note);
  return few;
}

TEST_CASE("convert: intensities, classes and returns stay in LAS, LAZ and PLY, text says what it lacks",
          "[unit]") {
  const test::TempFolder folder;
  for (const int format : {1, 3, 6, 7}) {
    const test::LazSample s{.minor = 4, .format = format, .points = 3000};
    const auto in = folder.write("in.las", test::las_twin(s, test::las_records(s)));
    const auto other = folder.write("other.xyz", "1 2 3\n4 5 6\n");
    ReadOptions all;
    all.intensities = true;
    const auto was = test::read_points(in, ~std::uint64_t{0}, all).points;
    CHECK(was.intensity.size() == was.size());
    for (const char* name : {"out.las", "out.laz"}) {
      CAPTURE(format, name);
      ConvertOptions options;
      options.las_scale = 0.01;
      CHECK(left_out(convert_points({in, other}, folder.path() / name, options)).empty());
      const auto now = test::read_points(folder.path() / name, ~std::uint64_t{0}, all).points;
      const std::size_t n = was.size();
      REQUIRE(now.size() == n + 2);
      CHECK(std::equal(was.echo.begin(), was.echo.end(), now.echo.begin()));
      CHECK(std::equal(was.intensity.begin(), was.intensity.end(), now.intensity.begin()));
      CHECK(now.echo[n] == Echo{1, 1, 1});
      CHECK(now.intensity[n + 1] == 0);
      // The header's numbers of points by return.
      const std::string bytes = test::file_bytes(folder.path() / name);
      for (std::size_t r = 1; r <= 15; ++r) {
        std::uint64_t declared = 0;
        std::memcpy(&declared, bytes.data() + 247 + 8 * r, 8);
        CHECK(declared ==
              static_cast<std::uint64_t>(std::count_if(now.echo.begin(), now.echo.end(),
                                                       [&](const Echo& e) { return e.number == r; })));
      }
    }
    CHECK(left_out(convert_points({in}, folder.path() / "out.ply", {})).empty());
    const std::string ply = test::file_bytes(folder.path() / "out.ply");
    CHECK(ply.find("property ushort intensity\nproperty uchar classification\n") != std::string::npos);
    Echo last;
    std::uint16_t intensity = 0;
    std::memcpy(&intensity, ply.data() + ply.size() - 5, 2);
    std::memcpy(&last, ply.data() + ply.size() - 3, 3);
    CHECK(intensity == was.intensity.back());
    CHECK(last == was.echo.back());
    CHECK(test::read_points(folder.path() / "out.ply").points.x == was.x);
    const auto notes = left_out(convert_points({in}, folder.path() / "out.xyz", {}));
    CHECK(notes == std::vector<std::string>{"intensity is left out", "classes and returns are left out"});
  }
}

TEST_CASE("convert: same bytes on any number of threads", "[property]") {
  const test::TempFolder folder;
  const auto in = folder.write("in.xyz", cloud(300000));  // several slices
  ConvertOptions options;
  options.threads = 1;
  convert_points({in, in}, folder.path() / "one.ply", options);
  options.threads = 5;
  convert_points({in, in}, folder.path() / "five.ply", options);
  const bool same =
      test::file_bytes(folder.path() / "one.ply") == test::file_bytes(folder.path() / "five.ply");
  CHECK(same);
}

TEST_CASE("convert: several files of different attributes become one", "[unit]") {
  const test::TempFolder folder;
  const auto a = folder.write("a.xyz", "x y z nx ny nz\n1 2 3 0 0 1\n");
  const auto b = folder.write("b.xyz", "x y z r g b\n4 5 6 1 2 3\n");
  const auto out = folder.path() / "c.ply";
  convert_points({a, b}, out, {});
  const auto r = test::read_points(out);
  CHECK(r.points.x == std::vector<double>{1, 4});
  CHECK(r.points.nz == std::vector<float>{1, 0});
  CHECK((r.points.rgba[1] & 0xffffffu) == 0x030201u);
  CHECK(r.info.format == "PLY binary little endian");
  CHECK(std::filesystem::file_size(out) < 400);
}

TEST_CASE("convert: what cannot be done is refused and leaves nothing behind", "[fault]") {
  const test::TempFolder folder;
  const auto in = folder.write("in.xyz", "1 2 3\n");
  const auto bad = folder.write("bad.xyz", "1 2 3\n4 x 6\n7 8 9\n");
  const auto nothing = folder.write("nan.xyz", "nan 2 3\n");
  const auto far = folder.write("far.xyz", "0 0 0\n1e12 0 0\n");
  CHECK_THROWS_AS(convert_points({in}, in, {}), UsageError);
  CHECK_THROWS_AS(convert_points({in}, folder.path() / "out.obj2", {}), UsageError);
  CHECK_THROWS_AS(convert_points({in}, folder.path() / "none/out.ply", {}), UsageError);
  CHECK_THROWS_AS(convert_points({bad}, folder.path() / "out.ply", {}), InputError);
  CHECK_THROWS_AS(convert_points({nothing}, folder.path() / "out.ply", {}), EmptyError);
  CHECK_THROWS_AS(convert_points({far}, folder.path() / "out.las", {}), UsageError);
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
    files += entry.is_regular_file() ? 1 : 0;
  CHECK(files == 4);
}

TEST_CASE("summary: fates, bounds, refuted claims and the spacing of a grid", "[unit]") {
  const test::TempFolder folder;
  std::string grid =
      "ply\nformat ascii 1.0\nelement vertex 10003\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n";
  for (int i = 0; i < 10000; ++i)
    grid += std::to_string(i % 100 * 0.5) + " " + std::to_string(i / 100 * 0.5) + " 1\n";
  const auto path = folder.write("grid.ply", grid + "0 0 1\ninf 0 0\n");
  const PointSummary s = summarize_points(path, {});
  CHECK(s.counts.points == 10002);
  CHECK(s.not_finite == 1);
  CHECK(s.missing == 1);
  CHECK(s.min == Double3{0, 0, 1});
  CHECK(s.max == Double3{49.5, 49.5, 1});
  CHECK(s.exact_in_float);
  CHECK(s.spacing == 0.5);
  REQUIRE(s.warnings.size() == 1);
  CHECK_THAT(s.warnings[0], Catch::Contains("10003") && Catch::Contains("10002"));
}

/// Exit code and output of a command line.
std::pair<int, std::string> run(const std::string& arguments, const test::TempFolder& folder) {
  const auto log = folder.path() / "log";
  const int status =
      std::system((std::string(TESSERA_BINARY) + " " + arguments + " > " + log.string() + " 2>&1").c_str());
  std::ifstream file(log);
  std::stringstream text;
  text << file.rdbuf();
  return {WEXITSTATUS(status), text.str()};
}

TEST_CASE("info and convert: as a user runs them", "[pipeline]") {
  const test::TempFolder folder;
  const std::string in = folder.write("in.csv", cloud(300)).string();
  const std::string out = (folder.path() / "out.las").string();
  auto [code, text] = run("convert " + in + " -o " + out, folder);
  CHECK(code == 0);
  CHECK_THAT(text, Catch::Contains("299 points") && Catch::Contains("1 not finite"));
  std::tie(code, text) = run("convert " + in + " -o " + out, folder);
  CHECK(code == 2);
  CHECK_THAT(text, Catch::Contains("--force"));
  std::tie(code, text) = run("convert --force " + in + " -o " + out, folder);
  CHECK(code == 0);
  std::tie(code, text) = run("info " + out, folder);
  CHECK(code == 0);
  CHECK_THAT(text, Catch::Contains("LAS 1.4 point format 7") && Catch::Contains("299 read"));
  std::tie(code, text) = run("info --json " + in + " " + out, folder);
  CHECK(code == 0);
  const auto json = tessera::parse_json(text);
  CHECK(json["files"].size() == 2);
  CHECK(json["files"][0]["points"]["not_finite"] == 1);
  CHECK(json["files"][1]["points"]["declared"] == 299);
  CHECK(run("info", folder).first == 2);
  CHECK(run("info " + in + "x", folder).first == 3);
  folder.write("bad.las", "LASF");
  std::tie(code, text) = run("info " + in + " " + (folder.path() / "bad.las").string(), folder);
  CHECK(code == 3);
  CHECK_THAT(text, Catch::Contains("300 read") && Catch::Contains("1 of 2 files"));
}

}  // namespace
}  // namespace tessera::convert_points_test
