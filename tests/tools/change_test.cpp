// `change` on pairs of scans whose distance is known.
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
#include "tests/helpers/command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace change_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// A bent sheet of 40 by 40 with noise, far from zero; where x is above the middle it lies higher by `lift`.
std::vector<Double3> sheet(std::size_t count, unsigned seed, double lift) {
  Random random(seed);
  std::vector<Double3> points;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = random.in(0.0, 40.0), y = random.in(0.0, 40.0);
    points.push_back({500000.0 + x, 5200000.0 + y,
                      100.0 + 0.02 * x * y + 0.02 * random.gaussian() + (x > 20.0 ? lift : 0.0)});
  }
  return points;
}

std::string text_of(const std::vector<Double3>& points) {
  std::string text;
  char line[100];
  for (const Double3& p : points) {
    std::snprintf(line, sizeof line, "%.3f %.3f %.3f\n", p[0], p[1], p[2]);
    text += line;
  }
  return text;
}

struct Row {
  std::vector<double> values;
  bool operator<(const Row& o) const { return values < o.values; }
};
/// Of a table, with its head; NaN where there is no number.
std::vector<Row> rows_of(const std::filesystem::path& path, std::string* head = nullptr) {
  std::istringstream in(file_bytes(path));
  std::string line;
  std::getline(in, line);
  if (head != nullptr) *head = line;
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    rows.emplace_back();
    std::string cell;
    std::istringstream cells(line + ",");
    while (std::getline(cells, cell, ',')) rows.back().values.push_back(cell.empty() ? NAN : std::stod(cell));
  }
  return rows;
}

int change(std::vector<std::string> words, std::string* errors = nullptr) {
  words.insert(words.begin(), "change");
  words.insert(words.end(), {"--progress", "none"});
  const CommandResult r = tessera_command(words);
  if (errors != nullptr) *errors = r.errors;
  if (r.code != 0 && errors == nullptr) WARN(r.errors);
  return r.code;
}

}  // namespace

TEST_CASE("change: a lifted half is told from one that stayed, in every file and figure", "[pipeline]") {
  const TempFolder folder;
  const std::vector<Double3> points = sheet(20000, 1, 0.0);
  const auto before = folder.write("old.xyz", text_of(points));
  const auto after = folder.write("new.xyz", text_of(sheet(20000, 2, 0.5)));
  const auto areas = folder.write(
      "areas.json",
      R"({"type":"Polygon","coordinates":[[[500002,5200002],[500016,5200002],[500016,5200038],[500002,5200038],[500002,5200002]]]})");
  REQUIRE(change({before.string(), "--to", after.string(), "-o", (folder / "out.csv").string(), "--json",
                  (folder / "out.json").string(), "--all-fields", "--within", areas.string(), "--csv",
                  (folder / "rows.csv").string(), "--histogram", (folder / "bins.csv").string(), "--normals",
                  "vertical"}) == 0);
  std::string head;
  const std::vector<Row> rows = rows_of(folder / "out.csv", &head);
  CHECK(head ==
        "x,y,z,M3C2 distance,distance uncertainty,significant change,STD_cloud1,STD_cloud2,Npoints_cloud1,"
        "Npoints_cloud2,NormalX,NormalY,NormalZ");
  REQUIRE(rows.size() == points.size());
  double stayed = 0.0, lifted = 0.0, false_alarms = 0.0, found = 0.0, level = 0.0;
  for (const Row& r : rows) {
    const std::vector<double>& v = r.values;
    const double x = v[0] - 500000.0;
    if (x > 3.0 && x < 17.0) ++stayed, false_alarms += v[5], level += v[4];
    if (x > 23.0 && x < 37.0)
      ++lifted, found += v[5] == 1.0 && std::abs(v[3] - 0.5) < v[4] + 0.25 ? 1.0 : 0.0;
    CHECK((v[10] == 0.0 && v[11] == 0.0 && v[12] == 1.0));
    CHECK((v[5] == 1.0) == (std::abs(v[3]) > v[4]));
    // As it is defined, from the fields beside it.
    CHECK(v[4] == Approx(1.96 * std::sqrt(v[6] * v[6] / v[8] + v[7] * v[7] / v[9])));
  }
  CHECK(false_alarms / stayed < 0.1);  // neighbours share points: few trials
  CHECK(found / lifted == 1.0);
  const Json report = parse_json(file_bytes(folder / "out.json"));
  CHECK(report.at("core_points") == points.size());
  const Json& all = report.at("areas")[0];
  CHECK(all.at("points") == points.size());
  CHECK(all.at("without") == 0);
  CHECK(all.at("mean").get<double>() == Approx(0.25).margin(0.02));
  CHECK(report.at("areas")[1].at("mean").get<double>() == Approx(0.0).margin(0.01));
  CHECK(report.at("share_significant").get<double>() == Approx(0.5).margin(0.05));
  CHECK(report.at("area").at("compared").get<double>() == Approx(1600.0).epsilon(0.15));
  CHECK(report.at("area").at("significant").get<double>() == Approx(800.0).epsilon(0.2));
  REQUIRE(report.at("largest").size() == 10);
  CHECK(report.at("largest")[0].at("mean").get<double>() == Approx(0.5).margin(0.2));
  CHECK(report.at("largest")[0].at("at")[0].get<double>() > 500019.0);
  const std::string table = file_bytes(folder / "rows.csv");
  CHECK(table.rfind("area,points,without,significant,mean,", 0) == 0);
  CHECK(std::count(table.begin(), table.end(), '\n') == 3);
  double counted = 0.0;
  for (const Row& r : rows_of(folder / "bins.csv")) counted += r.values[2];
  CHECK(counted == static_cast<double>(points.size()));
}

TEST_CASE("change: two words are the old and the new scan, and the sign follows the side of the normals",
          "[pipeline]") {
  const TempFolder folder;
  const auto before = folder.write("old.xyz", text_of(sheet(8000, 1, 0.0)));
  const auto after = folder.write("new.xyz", text_of(sheet(8000, 2, 0.4)));
  const auto mean = [&](std::vector<std::string> words) {
    words.insert(words.end(), {"--json", (folder / "out.json").string(), "--force"});
    REQUIRE(change(words) == 0);
    return parse_json(file_bytes(folder / "out.json")).at("areas")[0].at("mean").get<double>();
  };
  const double up = mean({before.string(), after.string()});
  CHECK(up == Approx(0.18).margin(0.04));
  CHECK(mean({before.string(), after.string(), "--orient", "-z"}) == -up);
  CHECK(mean({before.string(), after.string(), "--orient", "500020,5200020,-900"}) == -up);
  CHECK(mean({before.string(), after.string(), "--median"}) == Approx(up).margin(0.01));
  // An error of registration is added before the factor.
  REQUIRE(change({before.string(), after.string(), "-o", (folder / "a.csv").string()}) == 0);
  REQUIRE(change({before.string(), after.string(), "-o", (folder / "b.csv").string(), "--registration-error",
                  "0.1"}) == 0);
  const std::vector<Row> a = rows_of(folder / "a.csv"), b = rows_of(folder / "b.csv");
  for (std::size_t i = 0; i < a.size(); i += 100)
    CHECK(b[i].values[4] == Approx(a[i].values[4] + 0.196).margin(1e-9));
}

TEST_CASE("change: LAS gets extra bytes and keeps every other one, PLY names without blanks", "[pipeline]") {
  const TempFolder folder;
  const auto text = folder.write("old.xyz", text_of(sheet(5000, 1, 0.0)));
  const auto before = folder / "old.las";
  REQUIRE(tessera_command({"convert", text.string(), "-o", before.string()}).code == 0);
  const auto after = folder.write("new.xyz", text_of(sheet(5000, 2, 0.3)));
  REQUIRE(change({before.string(), "--to", after.string(), "-o", (folder / "out.las").string()}) == 0);
  REQUIRE(change({before.string(), "--to", after.string(), "-o", (folder / "out.csv").string()}) == 0);
  const std::vector<Row> rows = rows_of(folder / "out.csv");
  const LasRecords old(before), made(folder / "out.las");
  REQUIRE(made.record_bytes() == old.record_bytes() + 24);
  REQUIRE(made.points() == rows.size());
  std::vector<char> was;
  old.read(
      1, [](LasBatch&) {},
      [&](LasBatch& b) {
        was.insert(was.end(), b.records.begin(),
                   b.records.begin() + static_cast<std::ptrdiff_t>(b.count * old.record_bytes()));
      });
  std::size_t wrong = 0, i = 0;
  made.read(
      1, [](LasBatch&) {},
      [&](LasBatch& b) {
        for (std::size_t k = 0; k < b.count; ++k, ++i) {
          const char* record = b.records.data() + k * made.record_bytes();
          wrong += std::memcmp(record, was.data() + i * old.record_bytes(), old.record_bytes()) == 0 ? 0 : 1;
          double values[3];
          std::memcpy(values, record + old.record_bytes(), sizeof values);
          for (std::size_t v = 0; v < 3; ++v)
            wrong += values[v] == rows[i].values[3 + v] ||
                             (std::isnan(values[v]) && std::isnan(rows[i].values[3 + v]))
                         ? 0
                         : 1;
        }
      });
  CHECK(wrong == 0);
  const std::string bytes = file_bytes(folder / "out.las");
  for (const char* name : {"M3C2 distance", "distance uncertainty", "significant change"})
    CHECK(bytes.find(name) != std::string::npos);
  std::string errors;
  CHECK(change({(folder / "out.las").string(), "--to", after.string(), "-o", (folder / "twice.las").string()},
               &errors) == 2);
  CHECK(errors.find("extra bytes 'M3C2 distance' already") != std::string::npos);
  REQUIRE(change({before.string(), "--to", after.string(), "-o", (folder / "out.ply").string(), "--colours",
                  "0.3"}) == 0);
  const std::string ply = file_bytes(folder / "out.ply");
  CHECK(ply.find("property double scalar_M3C2_distance\nproperty double scalar_distance_uncertainty\n"
                 "property double scalar_significant_change\n") != std::string::npos);
  CHECK(ply.find("property uchar red") != std::string::npos);
}

TEST_CASE("change: a raster has the mean distance of every cell", "[pipeline]") {
  const TempFolder folder;
  const auto before = folder.write("old.xyz", text_of(sheet(20000, 1, 0.0)));
  const auto after = folder.write("new.xyz", text_of(sheet(20000, 2, 0.5)));
  const auto out = folder / "out.tif";
  REQUIRE(change({before.string(), after.string(), "--raster", out.string(), "--cell", "4", "-o",
                  (folder / "out.csv").string()}) == 0);
  REQUIRE(std::filesystem::file_size(out) > 0);
  if (shell("gdalinfo --version").code != 0) return skip("there is no gdalinfo (gdal-bin)");
  const Outcome r = shell("gdalinfo -json " + out.string());
  REQUIRE(r.code == 0);
  const Json info = parse_json(r.said);
  const std::vector<int> size = info.at("size").get<std::vector<int>>();
  CHECK((size[0] == 11 && size[1] == 10));  // a point lies on the eastern border
  CHECK(info.at("geoTransform")[0].get<double>() == 500000.0);
  CHECK(info.at("geoTransform")[3].get<double>() == 5200040.0);
  // Column 1 from west, row 1 from north, and so on: means of the distances in the cell.
  const std::vector<Row> rows = rows_of(folder / "out.csv");
  for (const auto& [column, row] : {std::pair{1, 1}, std::pair{8, 2}, std::pair{5, 9}}) {
    double sum = 0.0, count = 0.0;
    for (const Row& p : rows)
      if (std::floor((p.values[0] - 500000.0) / 4.0) == column &&
          std::floor((p.values[1] - 5200000.0) / 4.0) == 9 - row && !std::isnan(p.values[3]))
        sum += p.values[3], ++count;
    const Outcome value = shell("gdallocationinfo -valonly " + out.string() + " " + std::to_string(column) +
                                " " + std::to_string(row));
    REQUIRE(value.code == 0);
    CHECK(std::stod(value.said) == Approx(sum / count).margin(1e-6));
  }
}

TEST_CASE("change: core points are one in a cell, whatever the order of the scan", "[pipeline]") {
  const TempFolder folder;
  std::vector<Double3> points = sheet(20000, 1, 0.0);
  const auto after = folder.write("new.xyz", text_of(sheet(20000, 2, 0.2)));
  std::vector<std::vector<Row>> found;
  for (const char* name : {"a", "b"}) {
    const auto before = folder.write(std::string(name) + ".xyz", text_of(points));
    const auto out = folder / (std::string(name) + ".csv");
    REQUIRE(change({before.string(), after.string(), "-o", out.string(), "--core-spacing", "1"}) == 0);
    found.push_back(rows_of(out));
    std::sort(found.back().begin(), found.back().end());
    std::reverse(points.begin(), points.end());
  }
  CHECK(found[0].size() > 1400);
  CHECK(found[0].size() < 4000);
  REQUIRE(found[0].size() == found[1].size());
  for (std::size_t i = 0; i < found[0].size(); ++i) CHECK(found[0][i].values == found[1][i].values);
}

TEST_CASE("change: the same bytes for any cap, any threads and any order of the new scan", "[pipeline]") {
  const TempFolder folder;
  const auto old = folder.write("old.xyz", text_of(sheet(60000, 1, 0.0)));
  const auto before = folder / "old.laz";
  REQUIRE(tessera_command({"convert", old.string(), "-o", before.string()}).code == 0);
  std::vector<Double3> points = sheet(60000, 2, 0.5);
  const auto after = folder.write("new.xyz", text_of(points));
  std::reverse(points.begin(), points.end());
  const auto reversed = folder.write("reversed.xyz", text_of(points));
  std::vector<std::string> bytes;
  struct Run {
    const char *threads, *memory;
    std::filesystem::path after;
  };
  for (const Run& run : {Run{"1", "1G", after}, Run{"3", "96M", after}, Run{"2", "160M", reversed}}) {
    REQUIRE(change({before.string(), "--to", run.after.string(), "-o", (folder / "out.laz").string(), "--csv",
                    (folder / "rows.csv").string(), "--json", (folder / "out.json").string(), "--threads",
                    run.threads, "--memory", run.memory, "--all-fields", "--force"}) == 0);
    Json report = parse_json(file_bytes(folder / "out.json"));
    report["seconds"] = 0, report["peak_bytes"] = 0, report["new"] = 0;
    bytes.push_back(file_bytes(folder / "out.laz") + file_bytes(folder / "rows.csv") + dump_json(report, 1));
  }
  CHECK(bytes[0] == bytes[1]);
  CHECK(bytes[0] == bytes[2]);
}

TEST_CASE("change: what cannot be compared is refused, and leaves no file", "[pipeline]") {
  const TempFolder folder;
  const auto before = folder.write("old.xyz", text_of(sheet(5000, 1, 0.0)));
  const auto after = folder.write("new.xyz", text_of(sheet(5000, 2, 0.0)));
  const auto far =
      folder.write("far.xyz", "0 0 0\n1 0 0\n2 0 0\n0 1 0\n1 1 0\n2 1 0\n0 2 0\n1 2 0\n2 2 0\n2 3 0\n");
  const auto few = folder.write("few.xyz", "500001 5200001 100\n500002 5200001 100\n");
  const auto mesh = folder.write("mesh.off", "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  const auto out = folder / "out.csv";
  const auto refused = [&](std::vector<std::string> words, int code, const std::string& said) {
    std::string errors;
    words.insert(words.end(), {"-o", out.string()});
    CHECK(change(words, &errors) == code);
    CAPTURE(errors);
    CHECK(errors.find(said) != std::string::npos);
    CHECK_FALSE(std::filesystem::exists(out));
  };
  refused({before.string()}, 2, "--to is missing");
  refused({before.string(), after.string(), far.string()}, 2, "--to is missing");
  refused({before.string(), after.string(), "--projection-scale", "0.05"}, 2,
          "--projection-scale 0.05: is below the spacing of the points");
  refused({before.string(), after.string(), "--normal-scale", "0.05"}, 2, " works");
  refused({before.string(), after.string(), "--normal-scale", "1e9"}, 2, "times as wide as the scans");
  refused({before.string(), after.string(), "--orient", "left"}, 2, "is neither up, +x");
  refused({before.string(), far.string()}, 5, "are both in one system?");
  refused({few.string(), few.string()}, 3, "too few points to tell their spacing");
  refused({before.string(), mesh.string()}, 3, "is a mesh");
  refused({before.string(), after.string(), "--memory", "30M"}, 4, "--memory");
  CHECK(change({before.string(), "--to", after.string()}) == 2);
  CHECK(change({before.string(), after.string(), "-o", before.string(), "--force"}) == 2);
  CHECK(change({before.string(), after.string(), "-o", (folder / "out.obj").string()}) == 2);
}

}  // namespace change_test
