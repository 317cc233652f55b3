// `classify` on scenes whose ground is known: classes, bytes that stay, one result for every cap, and what is refused.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/formats/points/las_records.h"
#include "tests/helpers/aerial_scene.h"
#include "tests/helpers/command.h"
#include "tests/helpers/temp_folder.h"

namespace classify_test {

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

CommandResult classify(std::vector<std::string> words) {
  words.insert(words.begin(), "classify");
  return tessera_command(words);
}

std::uint64_t must_classify(const std::vector<std::string>& words) {
  const CommandResult r = classify(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return r.peak_bytes;
}

struct Errors {
  double ground_lost = 0.0, objects_taken = 0.0;  ///< types I and II
};

Errors errors_of(const std::vector<ScenePoint>& points, const std::vector<int>& classes) {
  double ground = 0, lost = 0, objects = 0, taken = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    (points[i].truth == 2 ? ground : objects) += 1;
    if (points[i].truth == 2 && classes[i] != 2) lost += 1;
    if (points[i].truth != 2 && classes[i] == 2) taken += 1;
  }
  return {lost / ground, taken / objects};
}

}  // namespace

TEST_CASE("classify: ground, vegetation, houses and noise of a known scene, and nothing else changes",
          "[pipeline]") {
  const int format = GENERATE(1, 6);
  CAPTURE(format);
  const TempFolder folder;
  std::vector<ScenePoint> points = aerial_scene();
  points[10].withheld = true, points[10].given = 9;
  points[11].synthetic = true, points[11].given = 12;
  points[12].given = 7;
  SceneFile file;
  file.format = format;
  const std::string bytes = las_of(points, file);
  const fs::path in = folder.write("in.las", bytes);
  must_classify({in.string(), "-o", (folder / "out.las").string(), "--report", (folder / "r.json").string()});
  const std::string out = file_bytes(folder / "out.las");
  REQUIRE(out.size() == bytes.size());
  CHECK(without_classes(out) == without_classes(bytes));
  std::vector<int> classes = las_classes(out);
  CHECK(classes[10] == 9);
  CHECK(classes[11] == 12);
  CHECK(classes[12] == 7);
  const Errors errors = errors_of(points, classes);
  CHECK(errors.ground_lost < 0.01);
  CHECK(errors.objects_taken < 0.02);
  std::size_t noise = 0, wrong_noise = 0, high = 0, roofs = 0, crowns_as_roofs = 0;
  for (std::size_t i = 13; i < points.size(); ++i) {
    if ((points[i].truth == 7) != (classes[i] == 7)) ++wrong_noise;
    if (points[i].truth == 7) ++noise;
    if (classes[i] == 5) ++high;
    if (classes[i] == 6 && points[i].truth == 6) ++roofs;
    if (classes[i] == 6 && points[i].truth == 5) ++crowns_as_roofs;
  }
  CHECK(noise > 15);
  CHECK(wrong_noise == 0);
  CHECK(high > 1000);
  CHECK(roofs > 1900);
  CHECK(crowns_as_roofs < 60);  // those beside a house
  const tessera::Json report = tessera::parse_json(file_bytes(folder / "r.json"));
  CHECK(report.at("points") == points.size());
  CHECK(report.at("kept") == 3);
  CHECK(report.at("classes").at("2") == std::count(classes.begin(), classes.end(), 2));

  must_classify({in.string(), "-o", (folder / "two.las").string(), "--classes", "ground", "--all-points"});
  const std::vector<int> two = las_classes(file_bytes(folder / "two.las"));
  CHECK(std::all_of(two.begin(), two.end(), [](int c) { return c == 1 || c == 2; }));
}

TEST_CASE("classify: as COPC points have all that they have as LAS", "[pipeline]") {
  const TempFolder folder;
  SceneFile file;
  file.format = GENERATE(1, 6);
  CAPTURE(file.format);
  const fs::path in = folder.write("in.las", las_of(aerial_scene(), file));
  const auto path = [&](const char* name) { return (folder / name).string(); };
  must_classify({in.string(), "-o", path("a.las")});
  must_classify({in.string(), "-o", path("a.copc.laz"), "-t", "1", "--memory", "256M"});
  must_classify({in.string(), "-o", path("b.copc.laz"), "-t", "2"});
  CHECK((file_bytes(folder / "a.copc.laz") == file_bytes(folder / "b.copc.laz")));
  const auto records = [&](const char* name) {
    const tessera::LasRecords all(folder / name);
    std::vector<std::string> found;
    all.read(
        1, [](tessera::LasBatch&) {},
        [&](tessera::LasBatch& batch) {
          for (std::size_t i = 0; i < batch.count; ++i)
            found.emplace_back(batch.records.data() + i * all.record_bytes(), all.record_bytes());
        });
    return found;
  };
  std::vector<std::string> want = records("a.las"), got = records("a.copc.laz");
  if (file.format == 1) {
    // By hand: the fields of LAS 1.4's format 6.
    for (std::string& old : want) {
      std::string r(32, '\0');
      r.replace(0, 14, old, 0, 14);
      r[14] = static_cast<char>((old[14] & 7) | (old[14] >> 3 & 7) << 4);
      r[15] = static_cast<char>((old[15] >> 5 & 7) | (static_cast<unsigned char>(old[14]) >> 6) << 6);
      r[16] = static_cast<char>(old[15] & 31);
      r[17] = old[17];
      const auto angle = static_cast<std::int16_t>(std::lround(static_cast<signed char>(old[16]) / 0.006));
      std::memcpy(&r[18], &angle, 2);
      r.replace(20, 2, old, 18, 2), r.replace(22, 8, old, 20, 8), r.replace(30, 2, old, 28, 2);
      old = r;
    }
  }
  CHECK((got != want));  // in the order of its nodes
  std::sort(want.begin(), want.end()), std::sort(got.begin(), got.end());
  CHECK((got == want));
  const auto scan = tessera::open_point_file(folder / "a.copc.laz", {});
  CHECK(scan->info().octree);
  CHECK(scan->info().warnings.empty());
  const auto times = file_bytes(folder / "a.copc.laz").substr(429 + 56, 16);
  double first = 0.0, last = 0.0, lowest = 1e300, highest = -1e300;
  std::memcpy(&first, times.data(), 8), std::memcpy(&last, times.data() + 8, 8);
  for (const std::string& r : want) {
    double time = 0.0;
    std::memcpy(&time, &r[22], 8);
    lowest = std::min(lowest, time), highest = std::max(highest, time);
  }
  CHECK(first == lowest);
  CHECK(last == highest);
}

TEST_CASE("classify: one result whatever the cap, the threads and the way the points are stored",
          "[pipeline]") {
  const TempFolder folder;
  SceneFile file;
  file.format = GENERATE(1, 6);
  const fs::path in = folder.write("in.las", las_of(aerial_scene(), file));
  const auto path = [&](const char* name) { return (folder / name).string(); };
  constexpr std::uint64_t kMiB = 1u << 20;
  CHECK(must_classify({in.string(), "-o", path("a.las"), "--memory", "64M", "-t", "1"}) < 64 * kMiB);
  must_classify({in.string(), "-o", path("b.las"), "--memory", "2G", "-t", "4"});
  const std::string want = file_bytes(folder / "a.las");
  CHECK(file_bytes(folder / "b.las") == want);
  CHECK(must_classify({in.string(), "-o", path("c.laz"), "--memory", "100M", "-t", "1"}) < 100 * kMiB);
  must_classify({in.string(), "-o", path("d.laz"), "-t", "3"});
  CHECK(file_bytes(folder / "c.laz") == file_bytes(folder / "d.laz"));
  CHECK(file_bytes(folder / "c.laz").size() < want.size());
  must_classify({path("c.laz"), "-o", path("e.las"), "--all-points"});
  CHECK(file_bytes(folder / "e.las") == want);
  must_classify({path("c.laz"), "-o", path("f.laz"), "--all-points"});
  CHECK(file_bytes(folder / "f.laz") == file_bytes(folder / "c.laz"));
}

TEST_CASE("classify: cells are wide where few points get through leaves, not where points are few",
          "[pipeline]") {
  // Undulating land, under a forest or bare, with houses.
  const TempFolder folder;
  std::mt19937 random(5);
  const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0; };
  const auto run = [&](double density, double canopy) {
    std::vector<ScenePoint> points;
    for (int k = 0; k < static_cast<int>(density * 240.0 * 240.0); ++k) {
      const double x = 240.0 * uniform(), y = 240.0 * uniform();
      ScenePoint p{x, y, 3.0 * std::sin(x / 40.0) * std::cos(y / 30.0), 2, 1};
      const bool house = std::fmod(x, 60.0) < 12.0 && std::fmod(y, 60.0) < 15.0;
      if (canopy == 0.0 && house) p.z += 7.0, p.truth = 6;
      if (uniform() < canopy) p.z += 8.0 + 6.0 * uniform(), p.truth = 5;
      points.push_back(p);
    }
    const fs::path in = folder.write("in.las", las_of(points, {}));
    const std::string out = (folder / "out.las").string(), report = (folder / "out.json").string();
    must_classify({in.string(), "-o", out, "--report", report, "--force"});
    const Errors errors = errors_of(points, las_classes(file_bytes(out)));
    CAPTURE(density, canopy, errors.ground_lost, errors.objects_taken);
    CHECK(errors.ground_lost < 0.05);
    CHECK(errors.objects_taken < 0.05);
    return tessera::parse_json(file_bytes(report)).at("cell").get<double>();
  };
  CHECK(run(0.7, 0.0) == 1.0);
  CHECK(run(0.15, 0.0) == 1.0);
  CHECK(run(0.7, 0.75) >= 3.0);
  CHECK(run(12.0, 0.75) == 1.0);
}

TEST_CASE("classify: files that border on each other get the classes of one file", "[pipeline]") {
  const TempFolder folder;
  const std::vector<ScenePoint> points = aerial_scene(2);
  // Across a house.
  std::vector<ScenePoint> west, east;
  for (const ScenePoint& p : points) (p.x < 27.3 ? west : east).push_back(p);
  SceneFile file;
  folder.write("all.las", las_of(points, file));
  folder.write("west.las", las_of(west, file));
  file.east = 5e5 + 20.0;
  std::vector<ScenePoint> moved = east;
  for (ScenePoint& p : moved) p.x -= 20.0;
  folder.write("east.las", las_of(moved, file));
  const auto path = [&](const char* name) { return (folder / name).string(); };
  must_classify({path("all.las"), "-o", path("out.las")});
  must_classify({path("west.las"), path("east.las"), "-o", path("tiles/")});
  const std::vector<int> one = las_classes(file_bytes(folder / "out.las"));
  const std::vector<int> w = las_classes(file_bytes(folder / "tiles" / "west.las"));
  const std::vector<int> e = las_classes(file_bytes(folder / "tiles" / "east.las"));
  std::size_t at_west = 0, at_east = 0, differ = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (one[i] != (points[i].x < 27.3 ? w[at_west++] : e[at_east++])) ++differ;
  CHECK(at_west == w.size());
  CHECK(at_east == e.size());
  CHECK(differ == 0);
}

TEST_CASE("classify: a pond with few returns is water where that is asked for, and nothing else is",
          "[pipeline]") {
  const TempFolder folder;
  // Level land, eight points to a square metre; a pond in it, a car park, a house with a void behind it.
  std::mt19937 random(3);
  const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<ScenePoint> points;
  const auto within = [](double x, double y, double x0, double y0, double x1, double y1) {
    return x >= x0 && x < x1 && y >= y0 && y < y1;
  };
  for (int k = 0; k < 8 * 120 * 100; ++k) {
    const double x = 120.0 * uniform(), y = 100.0 * uniform();
    const bool pond = within(x, y, 15, 20, 45, 60);
    ScenePoint p{x, y, 10.0 + 0.3 * std::sin(x / 9.0) * std::cos(y / 7.0), 2, 1};
    if (within(x, y, 60, 10, 95, 40)) p.z = 9.8;
    if (within(x, y, 60, 55, 80, 75)) p.z = 18.0, p.truth = 6;
    if (within(x, y, 80, 55, 95, 75)) continue;
    if (pond) {
      if (uniform() > 0.04) continue;
      p.z = 9.5 + 0.06 * (uniform() - 0.5), p.truth = 9;
    }
    points.push_back(p);
  }
  const fs::path in = folder.write("in.las", las_of(points, {}));
  const auto run = [&](const std::vector<std::string>& how) {
    const std::string out = (folder / "out.las").string();
    std::vector<std::string> words = {in.string(), "-o", out, "--force"};
    words.insert(words.end(), how.begin(), how.end());
    must_classify(words);
    return file_bytes(out);
  };
  const std::string with = run({"--water", "on", "--memory", "2G", "-t", "2"}), without = run({});
  CHECK((run({"--water", "on", "--memory", "64M", "-t", "1"}) == with));
  CHECK((run({"--water", "off"}) == without));
  CHECK((run({"--water", "on", "--water-width", "35"}) == without));
  CHECK((run({"--water", "on", "--water-density", "0.01"}) == without));
  const std::vector<int> classes = las_classes(with), before = las_classes(without);
  std::size_t wet = 0, found = 0, at_rim = 0, wrong = 0, others = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].truth == 9) ++wet, found += classes[i] == 9 ? 1 : 0;
    // A cell of land that has few points by chance goes with the pond that it touches.
    if (points[i].truth != 9 && classes[i] == 9)
      ++(within(points[i].x, points[i].y, 14, 19, 46, 61) ? at_rim : wrong);
    if (classes[i] != 9 && classes[i] != before[i]) ++others;
    if (before[i] == 9) ++others;
  }
  CHECK(wet > 300);
  CHECK(10 * found > 9 * wet);
  CHECK(wrong == 0);
  CHECK(at_rim < 60);  // of some 1,100
  CHECK(others == 0);
  // With ground alone asked for there is no other class.
  const std::vector<int> two = las_classes(run({"--water", "on", "--classes", "ground"}));
  CHECK(std::all_of(two.begin(), two.end(), [](int c) { return c == 1 || c == 2; }));
}

TEST_CASE("classify: what cannot be classified is refused in one sentence", "[pipeline]") {
  const TempFolder folder;
  const std::string bytes = las_of(aerial_scene(), {});
  const std::string in = folder.write("in.las", bytes).string();
  const auto path = [&](const char* name) { return (folder / name).string(); };
  const auto refused = [&](const std::vector<std::string>& words, int code, const std::string& sentence) {
    const CommandResult r = classify(words);
    CAPTURE(words, r.errors);
    CHECK(r.code == code);
    CHECK(r.errors.find(sentence) != std::string::npos);
    CHECK(!fs::exists(folder / "out.las"));
  };
  refused({in}, 2, "-o");
  refused({in, "-o", in, "--force"}, 2, "in.las");
  refused({in, "-o", path("out.ply")}, 2, ".las or .laz");
  refused({in, in + "x", "-o", path("out.las")}, 3, "in.lasx");
  folder.write("other.las", bytes);
  refused({in, path("other.las"), "-o", path("out.las")}, 2, "name a folder");
  refused({in, "-o", path("out.las"), "--memory", "24M"}, 4, "--memory");
  refused({in, "-o", path("out.las"), "--cell", "0.01"}, 2, "--window");
  refused({in, "-o", path("out.las"), "--water", "on", "--water-width", "500"}, 2, "--water-width");
  folder.write("scan.ply", "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n");
  refused({path("scan.ply"), "-o", path("out.las")}, 3, "neither LAS nor LAZ");
  SceneFile degrees;
  degrees.degrees = true;
  refused({folder.write("d.las", las_of(aerial_scene(), degrees)).string(), "-o", path("out.las")}, 3,
          "degrees");
  refused({folder.write("e.las", las_of({}, {})).string(), "-o", path("out.las")}, 5, "no points");
  refused({folder.write("t.las", bytes.substr(0, bytes.size() - 100)).string(), "-o", path("out.las")}, 3,
          "declares");
  std::vector<ScenePoint> hidden = aerial_scene();
  for (ScenePoint& p : hidden) p.withheld = true;
  refused({folder.write("w.las", las_of(hidden, {})).string(), "-o", path("out.las")}, 5, "--all-points");
}

TEST_CASE("classify: a killed run leaves no file of the final name", "[fault]") {
  const TempFolder folder;
  const std::string in = folder.write("in.las", las_of(aerial_scene(), {})).string();
  const std::string out = (folder / "out.las").string();
  for (const char* fault : {"TESSERA_FAULT=write:1", "TESSERA_FAULT=write:3", "TESSERA_FAULT=stop:1"}) {
    CAPTURE(fault);
    const CommandResult r = tessera_command({"classify", in, "-o", out}, 0, fault);
    CHECK(r.code != 0);
    CHECK(!fs::exists(out));
  }
  must_classify({in, "-o", out});
}

}  // namespace classify_test
