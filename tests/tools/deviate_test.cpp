// `deviate` on points whose deviations are known.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/files/json.h"
#include "stream/formats/points/las_records.h"
#include "tests/helpers/aerial_scene.h"
#include "tests/helpers/command.h"
#include "tests/helpers/height_sheet.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/surfaces.h"
#include "tests/helpers/temp_folder.h"

namespace deviate_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr Double3 kSize = {4.0, 3.0, 2.0};

/// A box from the origin on, outward faces.
constexpr const char* kBox =
    "OFF 8 12 0\n0 0 0\n4 0 0\n0 3 0\n4 3 0\n0 0 2\n4 0 2\n0 3 2\n4 3 2\n"
    "3 0 2 1\n3 1 2 3\n3 4 5 6\n3 5 7 6\n3 0 1 4\n3 1 5 4\n3 2 6 3\n3 3 6 7\n3 0 4 2\n3 2 4 6\n3 1 3 5\n3 3 "
    "7 5\n";

double box_distance(const Double3& p) {
  Double3 outside{};
  double inside = -1e300;
  for (std::size_t a = 0; a < 3; ++a) {
    const double d = std::abs(p[a] - 0.5 * kSize[a]) - 0.5 * kSize[a];
    outside[a] = std::max(d, 0.0);
    inside = std::max(inside, d);
  }
  return norm(outside) + std::min(inside, 0.0);
}

/// Around the box, many of them beside edges and corners.
std::vector<Double3> box_points(std::size_t count) {
  Random random(2);
  std::vector<Double3> points;
  while (points.size() < count) {
    Double3 p;
    for (std::size_t a = 0; a < 3; ++a)
      p[a] = random.below(3) == 0 ? kSize[a] * static_cast<double>(random.below(2)) + random.in(-1e-3, 1e-3)
                                  : random.in(-1.0, kSize[a] + 1.0);
    points.push_back(p);
  }
  return points;
}

std::string text_of(const std::vector<Double3>& points) {
  std::string text;
  char line[100];
  for (const Double3& p : points) {
    std::snprintf(line, sizeof line, "%.17g %.17g %.17g\n", p[0], p[1], p[2]);
    text += line;
  }
  return text;
}

/// Numbers of a table without its head; NaN where there is none.
std::vector<std::vector<double>> rows_of(const std::filesystem::path& path) {
  std::istringstream in(file_bytes(path));
  std::string line;
  std::getline(in, line);
  std::vector<std::vector<double>> rows;
  while (std::getline(in, line)) {
    rows.emplace_back();
    std::string cell;
    std::istringstream cells(line + ",");
    while (std::getline(cells, cell, ',')) rows.back().push_back(cell.empty() ? NAN : std::stod(cell));
  }
  return rows;
}

int deviate(std::vector<std::string> words, std::string* errors = nullptr) {
  words.insert(words.begin(), "deviate");
  const CommandResult r = tessera_command(words);
  if (errors != nullptr) *errors = r.errors;
  if (r.code != 0 && errors == nullptr) WARN(r.errors);
  return r.code;
}

}  // namespace

TEST_CASE("deviate: points around a box have its signed distances, figures are those of all of them",
          "[pipeline]") {
  const TempFolder folder;
  const auto box = folder.write("box.off", kBox);
  std::vector<Double3> points = box_points(20000);
  points.push_back({50.0, 0.0, 0.0});  // far
  const auto scan = folder.write("scan.xyz", text_of(points));
  REQUIRE(
      deviate({scan.string(), "--to", box.string(), "-o", (folder / "out.csv").string(), "--max-distance",
               "5", "--report", (folder / "out.json").string(), "--histogram", (folder / "bins.csv").string(),
               "--csv", (folder / "rows.csv").string(), "--tolerance", "0.25", "--share", "0.1"}) == 0);
  const auto rows = rows_of(folder / "out.csv");
  REQUIRE(rows.size() == points.size());
  std::vector<double> values;
  double sum = 0.0, squares = 0.0, within = 0.0;
  std::size_t wrong = 0;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const double want = box_distance(points[i]), value = rows[i][3];
    wrong +=
        rows[i][0] == points[i][0] && rows[i][2] == points[i][2] && std::abs(value - want) < 1e-12 ? 0 : 1;
    values.push_back(value), sum += value, squares += value * value,
        within += std::abs(value) <= 0.25 ? 1 : 0;
  }
  CHECK(wrong == 0);
  CHECK(std::isnan(rows.back()[3]));

  const Json report = parse_json(file_bytes(folder / "out.json"));
  const Json& all = report.at("areas")[0];
  const double n = static_cast<double>(values.size());
  CHECK(all.at("points") == values.size());
  CHECK(all.at("far") == 1);
  CHECK(all.at("mean").get<double>() == Approx(sum / n));
  CHECK(all.at("rms").get<double>() == Approx(std::sqrt(squares / n)));
  CHECK(all.at("standard_deviation").get<double>() ==
        Approx(std::sqrt((squares - sum * sum / n) / (n - 1.0))));
  CHECK(all.at("share_within").get<double>() == Approx(within / n));
  std::sort(values.begin(), values.end());
  CHECK(all.at("min").at("value") == values.front());
  CHECK(all.at("max").at("value") == values.back());
  CHECK(box_distance(all.at("max").at("at").get<Double3>()) == Approx(values.back()));
  for (const int percent : {1, 5, 25, 50, 75, 95, 99}) {
    const double at = (n - 1.0) * percent / 100.0;
    const auto k = static_cast<std::size_t>(at);
    const double want = values[k] + (at - std::floor(at)) * (values[k + 1] - values[k]);
    CHECK(all.at("percentiles").at(std::to_string(percent)).get<double>() == Approx(want).margin(1e-15));
  }
  double counted = 0.0;
  for (const auto& bin : rows_of(folder / "bins.csv")) {
    counted += bin[2];
    const auto low = std::lower_bound(values.begin(), values.end(), std::isnan(bin[0]) ? -1e300 : bin[0]);
    const auto high = std::lower_bound(values.begin(), values.end(), std::isnan(bin[1]) ? 1e300 : bin[1]);
    CHECK(std::abs(static_cast<double>(high - low) - bin[2]) <=
          1.0);  // a value on a bound may be rounded across
  }
  CHECK(counted == n);
  CHECK(file_bytes(folder / "rows.csv").find("\nall,20000,1,") != std::string::npos);
}

TEST_CASE("deviate: the verdict is exit code 6, with the files written", "[pipeline]") {
  const TempFolder folder;
  const auto box = folder.write("box.off", kBox);
  const auto scan = folder.write("scan.xyz", "1 1 2.01\n2 1 2.02\n1 2 1.99\n2 2 2.3\n");
  const auto run = [&](const std::vector<std::string>& more, std::string* errors = nullptr) {
    std::vector<std::string> words = {
        scan.string(), "--to", box.string(), "-o", (folder / "out.csv").string(), "--force"};
    words.insert(words.end(), more.begin(), more.end());
    return deviate(words, errors);
  };
  CHECK(run({"--tolerance", "0.31"}) == 0);
  CHECK(run({"--tolerance", "0.03", "--share", "0.75"}) == 0);
  std::filesystem::remove(folder / "out.csv");
  std::string errors;
  CHECK(run({"--tolerance", "0.03"}, &errors) == 6);
  CHECK(errors.find("1 of 4 measured points deviate by more than 0.03") != std::string::npos);
  CHECK(rows_of(folder / "out.csv").size() == 4);
  CHECK(run({"--tolerance", "0.03", "--share", "0.8"}, &errors) == 6);
}

TEST_CASE("deviate: LAS gets extra bytes and keeps every other one, LAZ the same", "[pipeline]") {
  const TempFolder folder;
  std::vector<ScenePoint> points;
  Random random(4);
  for (int i = 0; i < 3000; ++i) {
    ScenePoint p{random.in(0.5, 3.5), random.in(0.5, 2.5), 2.0 + random.in(-0.3, 0.3), 0, 2};
    p.withheld = i % 50 == 0;
    points.push_back(p);
  }
  SceneFile file;
  file.format = GENERATE(1, 6);
  file.east = 0.0, file.north = 0.0;
  const std::string bytes = las_of(points, file);
  const auto scan = folder.write("scan.las", bytes), box = folder.write("box.off", kBox);
  REQUIRE(deviate({scan.string(), "--to", box.string(), "-o", (folder / "out.las").string()}) == 0);
  REQUIRE(deviate({scan.string(), "--to", box.string(), "-o", (folder / "out.laz").string()}) == 0);
  const LasRecords before(scan);
  const std::string written = file_bytes(folder / "out.las");
  // Two bytes that nobody described, then the number.
  const std::size_t record = written.find("LASF_Spec");
  REQUIRE(record != std::string::npos);
  std::uint16_t length = 0;
  std::memcpy(&length, written.data() + record + 18, 2);
  CHECK(length == 2 * 192);
  const char* descriptions = written.data() + record + 52;
  CHECK(descriptions[2] == 0);
  CHECK(descriptions[3] == 2);
  CHECK(descriptions[192 + 2] == 10);
  CHECK(std::string(descriptions + 192 + 4) == "deviation");
  CHECK(written.find("kept as it is") != std::string::npos);
  CHECK((written.find("what follows") != std::string::npos) == (file.format == 6));

  const auto check = [&](const std::filesystem::path& path) {
    const LasRecords after(path);
    REQUIRE(after.points() == before.points());
    REQUIRE(after.record_bytes() == before.record_bytes() + 8);
    std::string old;
    before.read(
        2, [](LasBatch&) {}, [&](LasBatch& b) { old.append(b.records.begin(), b.records.end()); });
    std::size_t at = 0, wrong = 0;
    after.read(
        2, [](LasBatch&) {},
        [&](LasBatch& b) {
          for (std::size_t i = 0; i < b.count; ++i, ++at) {
            const char* r = b.records.data() + i * after.record_bytes();
            wrong +=
                std::memcmp(r, old.data() + at * before.record_bytes(), before.record_bytes()) == 0 ? 0 : 1;
            double value = 0.0;
            std::memcpy(&value, r + before.record_bytes(), 8);
            const double height = std::round(points[at].z * 100.0) * 0.01;
            const Double3 p = {std::round(points[at].x * 100.0) * 0.01,
                               std::round(points[at].y * 100.0) * 0.01, height};
            wrong += points[at].withheld ? !std::isnan(value) : std::abs(value - box_distance(p)) > 1e-12;
          }
        });
    CHECK(at == points.size());
    CHECK(wrong == 0);
  };
  check(folder / "out.las");
  check(folder / "out.laz");
  // Once more: which of the two would be meant?
  std::string errors;
  CHECK(deviate({(folder / "out.las").string(), "--to", box.string(), "-o", (folder / "twice.las").string()},
                &errors) == 2);
  CHECK_FALSE(std::filesystem::exists(folder / "twice.las"));
  // A folder gets a file for each, all measured as one.
  const auto half = folder.write("half.las", las_of({points.begin(), points.begin() + 100}, file));
  const std::string parts = (folder / "parts").string() + "/";
  REQUIRE(deviate({half.string(), scan.string(), "--to", box.string(), "-o", parts, "--report",
                   (folder / "parts.json").string()}) == 0);
  CHECK(file_bytes(folder / "parts/scan.las") == written);
  CHECK(LasRecords(folder / "parts/half.las").points() == 100);
  const Json parts_report = parse_json(file_bytes(folder / "parts.json"));
  CHECK(parts_report.at("points") == 3100 - 62);
  CHECK(parts_report.at("left_out") == 62);
  CHECK(deviate({scan.string(), box.string(), "--to", box.string(), "-o", parts, "--force"}, &errors) == 3);
  CHECK(deviate({scan.string(), "--to", box.string(), "-o", parts, "--colours", "1"}, &errors) == 2);
  // Other formats into LAS and LAZ, several scans into one file.
  const auto text = folder.write("more.xyz", "1 1 2.5\n1 2 1.75\n");
  for (const char* name : {"all.las", "all.laz"}) {
    REQUIRE(deviate({scan.string(), text.string(), "--to", box.string(), "-o", (folder / name).string()}) ==
            0);
    const LasRecords all(folder / name);
    CHECK(all.points() == points.size() - 60 + 2);
    std::vector<double> values;
    all.read(
        2, [](LasBatch&) {},
        [&](LasBatch& b) {
          for (std::size_t i = 0; i < b.count; ++i) {
            double value = 0.0;
            std::memcpy(&value, b.records.data() + (i + 1) * all.record_bytes() - 8, 8);
            values.push_back(value);
          }
        });
    CHECK(values[values.size() - 2] == Approx(0.5));
    CHECK(values.back() == Approx(-0.25));
  }
}

TEST_CASE("deviate: a mesh gets a scalar of its vertices, and colours of their deviations", "[pipeline]") {
  const TempFolder folder;
  const auto box = folder.write("box.off", kBox);
  const auto sheet = folder.write(
      "sheet.off", height_sheet(4, 2.0, 0.5, 0.5, [](double x, double) { return 1.9 + 0.1 * x; }));
  const auto out = folder / "out.ply";
  REQUIRE(deviate({sheet.string(), "--to", box.string(), "-o", out.string(), "--colours", "0.2"}) == 0);
  const WholeMesh mesh = read_whole(out);
  REQUIRE(mesh.points.size() == 25);
  CHECK(mesh.faces.size() == 32);
  REQUIRE(mesh.rgba.size() == 25);
  const std::string bytes = file_bytes(out);
  CHECK(bytes.find("property double deviation\n") != std::string::npos);
  const std::size_t begin = bytes.find("end_header\n") + 11, record = 24 + 4 + 8;
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    double value = 0.0;
    std::memcpy(&value, bytes.data() + begin + i * record + 28, 8);
    CHECK(value == Approx(box_distance(mesh.points[i])).margin(1e-12));
    const std::uint32_t red = mesh.rgba[i] & 255u, blue = mesh.rgba[i] >> 16 & 255u;
    if (value > 0.05) CHECK(red > blue);
    if (value < -0.05) CHECK(blue > red);
  }
  // Triangles without shared vertices: each place is measured once.
  const auto stl = folder / "sheet.stl";
  REQUIRE(tessera_command({"convert", sheet.string(), "-o", stl.string()}).code == 0);
  REQUIRE(deviate({stl.string(), "--to", box.string(), "-o", (folder / "stl.csv").string()}) == 0);
  CHECK(rows_of(folder / "stl.csv").size() == 25);
}

TEST_CASE("deviate: areas have figures of their own", "[pipeline]") {
  const TempFolder folder;
  const auto box = folder.write("box.off", kBox);
  std::vector<Double3> points;
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 20; ++j) points.push_back({0.5 + 0.1 * i, 0.5 + 0.1 * j, i < 15 ? 2.25 : 1.5});
  const auto scan = folder.write("scan.xyz", text_of(points));
  const auto areas = folder.write("areas.geojson", R"({"type": "FeatureCollection", "features": [
      {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[[0,0],[1.95,0],[1.95,3],[0,3],[0,0]]]}},
      {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[[1.95,0],[4,0],[4,1.45],[1.95,1.45],[1.95,0]]]}}]})");
  REQUIRE(deviate({scan.string(), "--to", box.string(), "--within", areas.string(), "--report",
                   (folder / "out.json").string()}) == 0);
  const Json rows = parse_json(file_bytes(folder / "out.json")).at("areas");
  REQUIRE(rows.size() == 3);
  CHECK(rows[0].at("points") == 600);
  CHECK(rows[1].at("points") == 300);
  CHECK(rows[1].at("mean").get<double>() == Approx(0.25));
  CHECK(rows[1].at("standard_deviation").get<double>() == Approx(0.0).margin(1e-9));
  CHECK(rows[2].at("points") == 150);
  CHECK(rows[2].at("percentiles").at("50").get<double>() == Approx(-0.5));
}

TEST_CASE("deviate: the same bytes for any cap and any threads", "[pipeline]") {
  const TempFolder folder;
  Random random(6);
  Surface s = sphere(7, 10.0);
  for (Double3& p : s.position) p = Double3{1000.0, 2000.0, 300.0} + p * random.in(0.99, 1.0);
  WholeMesh mesh;
  mesh.points = s.position;
  for (const auto& f : s.faces) mesh.faces.push_back({f[0], f[1], f[2]});
  mesh.header.vertices = mesh.points.size(), mesh.header.faces = mesh.faces.size();
  mesh.header.double_positions = true;
  const auto reference = folder / "reference.ply";
  write_whole(reference, mesh);
  std::vector<Double3> points;
  for (int i = 0; i < 60000; ++i) {
    const double away = i % 10 == 0 ? 4.0 : 0.05;
    points.push_back(random_point(s, random.below(s.faces.size()), random) +
                     Double3{random.in(-away, away), random.in(-away, away), random.in(-away, away)});
  }
  const auto scan = folder.write("scan.xyz", text_of(points));
  const auto run = [&](const char* memory, const char* threads) {
    REQUIRE(deviate({scan.string(), "--to", reference.string(), "-o", (folder / "out.ply").string(), "--csv",
                     (folder / "rows.csv").string(), "--histogram", (folder / "bins.csv").string(), "--force",
                     "--memory", memory, "-t", threads}) == 0);
    return file_bytes(folder / "out.ply") + file_bytes(folder / "rows.csv") + file_bytes(folder / "bins.csv");
  };
  const std::string first = run("1G", "2");
  CHECK(run("160M", "1") == first);
  CHECK(run("256M", "3") == first);

  // A cap that cannot work is refused with one that can; the import of the reference may ask first, and for less.
  const auto out = folder / "capped.csv";
  std::string cap = "8M";
  for (int tries = 0; tries < 5; ++tries) {
    const CommandResult r = tessera_command({"deviate", scan.string(), "--to", reference.string(), "-o",
                                             out.string(), "--memory", cap, "-t", "2"});
    INFO(r.errors);
    if (r.code == 0) {
      CHECK(tries > 0);
      CHECK(r.peak_bytes <= std::stoull(cap) << 20);
      break;
    }
    REQUIRE(r.code == 4);
    CHECK_FALSE(std::filesystem::exists(out));
    const std::string words = "would do is --memory ";
    const std::size_t at = r.errors.find(words);
    REQUIRE(at != std::string::npos);
    cap = std::to_string(std::stoull(r.errors.substr(at + words.size()))) + "M";
  }
  CHECK(rows_of(out).size() == points.size());
}

TEST_CASE("deviate: what cannot be measured is refused, and leaves no file", "[pipeline]") {
  const TempFolder folder;
  const auto box = folder.write("box.off", kBox);
  const auto scan = folder.write("scan.xyz", "1 1 2.01\n2 1 2.02\n");
  const auto out = folder / "out.las";
  const auto refused = [&](const std::vector<std::string>& words, int code, const char* why) {
    std::string errors;
    CHECK(deviate(words, &errors) == code);
    INFO(errors);
    CHECK(errors.find(why) != std::string::npos);
    CHECK_FALSE(std::filesystem::exists(out));
  };
  const std::string to = box.string(), from = scan.string();
  refused({from, "-o", out.string()}, 2, "--to is missing");
  refused({from, "--to", to}, 2, "no output");
  refused({from, "--to", to, "-o", (folder / "out.obj").string()}, 2, "unknown extension");
  refused({from, "--to", to, "-o", from, "--force"}, 2, "");
  refused({from, "--to", (folder / "none.ply").string(), "-o", out.string()}, 3, "none.ply");
  const auto points =
      folder.write("points.ply",
                   "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                   "property float z\nend_header\n1 2 3\n");
  refused({from, "--to", points.string(), "-o", out.string()}, 3, "no faces");
  SceneFile degrees;
  degrees.degrees = true;
  const auto round = folder.write("round.las", las_of({{1.0, 1.0, 2.0, 0, 2}}, degrees));
  refused({round.string(), "--to", to, "-o", out.string()}, 3, "degrees");
  const auto away = folder.write("away.xyz", "100 1 2\n");
  refused({away.string(), "--to", to, "-o", out.string()}, 5, "no point lies within");
  refused({from, "--to", to, "-o", out.string(), "--tolerance", "3", "--max-distance", "2"}, 2,
          "raise --max-distance");
  refused({from, "--to", to, "-o", out.string(), "--tolerance", "1", "--share", "95"}, 2, "from 0 to 1");
  refused({box.string(), from, "--to", to, "-o", out.string()}, 2, "one at a time");
}

}  // namespace deviate_test
