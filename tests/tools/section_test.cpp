// `section` on meshes whose sections are known, as tables, drawings and lines in place.
#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/height_sheet.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace section_test {

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

constexpr double kX = 500000.0, kY = 5400000.0;

struct Row {
  int section = 0;
  double station = 0.0;
  int line = 0, closed = 0;
  std::string offset;
  double height = 0.0, x = 0.0, y = 0.0, z = 0.0;
  double right() const { return std::strtod(offset.c_str(), nullptr); }
};
using Line = std::vector<Row>;

void make(std::vector<std::string> words) {
  words.insert(words.begin(), "section");
  const CommandResult r = tessera_command(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
}

/// Lines of a table, in its order.
std::vector<Line> read_table(const fs::path& csv) {
  std::istringstream text(file_bytes(csv));
  std::string row;
  std::getline(text, row);
  CHECK(row == "section,station,line,closed,offset,height,x,y,z");
  std::vector<Line> lines;
  while (std::getline(text, row)) {
    std::vector<std::string> cells;
    std::istringstream cut(row);
    for (std::string cell; std::getline(cut, cell, ',');) cells.push_back(cell);
    REQUIRE(cells.size() == 9);
    const auto number = [&](std::size_t k) { return std::strtod(cells[k].c_str(), nullptr); };
    const Row r{int(number(0)), number(1), int(number(2)), int(number(3)), cells[4],
                number(5),      number(6), number(7),      number(8)};
    if (lines.empty() || lines.back().back().section != r.section || lines.back().back().line != r.line)
      lines.emplace_back();
    lines.back().push_back(r);
  }
  return lines;
}

std::vector<Line> table(const TempFolder& folder, std::vector<std::string> words) {
  const fs::path csv = folder / "sections.csv";
  words.insert(words.end(), {"-o", csv.string(), "--force"});
  make(words);
  return read_table(csv);
}

/// A line over places beside (kX, kY).
std::string axis(const TempFolder& folder, const std::vector<std::array<double, 2>>& corners) {
  tessera::Json line = tessera::Json::array();
  for (const auto& c : corners) line.push_back({kX + c[0], kY + c[1]});
  const tessera::Json collection = {{"type", "FeatureCollection"},
                                    {"features",
                                     {{{"type", "Feature"},
                                       {"properties", nullptr},
                                       {"geometry", {{"type", "Point"}, {"coordinates", {1.0, 2.0}}}}},
                                      {{"type", "Feature"},
                                       {"properties", nullptr},
                                       {"geometry", {{"type", "LineString"}, {"coordinates", line}}}}}}};
  return folder.write("axis.geojson", tessera::dump_json(collection)).string();
}

/// 10 x 4 x 3, closed.
std::string box(const TempFolder& folder) {
  std::string text = "OFF 8 6 0\n";
  for (const double z : {0.0, 3.0})
    for (const auto& c : {std::array{0, 0}, {10, 0}, {10, 4}, {0, 4}}) {
      char line[80];
      std::snprintf(line, sizeof line, "%.17g %.17g %.17g\n", kX + c[0], kY + c[1], 250.0 + z);
      text += line;
    }
  text += "4 3 2 1 0\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";
  return folder.write("box.off", text).string();
}

std::string ramp(const TempFolder& folder) {
  return folder
      .write("ramp.off", height_sheet(40, 40.0, kX, kY, [](double x, double) { return 100.0 + 0.5 * x; }))
      .string();
}

/// Of offsets and heights, counter-clockwise positive.
double area(const Line& line) {
  double sum = 0.0;
  for (std::size_t k = 1; k < line.size(); ++k)
    sum += line[k - 1].right() * line[k].height - line[k].right() * line[k - 1].height;
  return 0.5 * sum;
}

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

}  // namespace

TEST_CASE("section: across a box at survey coordinates it is its rectangle, closed, the solid on the right",
          "[pipeline]") {
  const TempFolder folder;
  const std::vector<std::string> words = {box(folder), "--line", axis(folder, {{-4, 2}, {14, 2}}),
                                          "--spacing", "5"};
  const std::vector<Line> lines = table(folder, words);
  // Stations -4, 1, 6 and 11 of the box: two meet it.
  REQUIRE(lines.size() == 2);
  for (std::size_t k = 0; k < 2; ++k) {
    const Line& line = lines[k];
    CHECK(line.front().section == int(k) + 1);
    CHECK(line.front().x == line.back().x);
    CHECK(line.front().y == line.back().y);
    CHECK(line.front().z == line.back().z);
    for (const Row& r : line) {
      CHECK(r.closed == 1);
      CHECK(r.line == 0);
      CHECK(r.station == 5.0 * double(k + 1));
      CHECK(r.x == kX + 1.0 + 5.0 * double(k));
      CHECK(r.y == kY + 2.0 - r.right());
      CHECK(r.height == r.z);
      CHECK((std::abs(r.right()) == 2.0 || r.z == 250.0 || r.z == 253.0));
      CHECK(std::abs(r.right()) <= 2.0);
    }
    CHECK(area(line) == Approx(-12.0));
  }
}

TEST_CASE("section: --width cuts lines off beside the axis", "[pipeline]") {
  const TempFolder folder;
  const std::vector<Line> lines = table(
      folder, {box(folder), "--line", axis(folder, {{-4, 1}, {14, 1}}), "--spacing", "5", "--width", "1.5"});
  REQUIRE(lines.size() == 4);  // floors and ceilings
  for (const Line& line : lines) {
    const double way = line.front().z == 253.0 ? 1.0 : -1.0;
    CHECK(line.front().closed == 0);
    CHECK(line.front().right() == -0.75 * way);
    CHECK(line.back().right() == 0.75 * way);
    for (const Row& r : line) CHECK(r.z == line.front().z);
  }
  const std::vector<Line> wide = table(
      folder, {box(folder), "--line", axis(folder, {{-4, 1}, {14, 1}}), "--spacing", "5", "--width", "6"});
  REQUIRE(wide.size() == 2);  // the far wall stands just where the width ends
  CHECK(wide[0].front().closed == 1);
}

TEST_CASE("section: an axis with a corner turns its sections, and stations run on", "[pipeline]") {
  const TempFolder folder;
  const std::string bent = axis(folder, {{5, 5}, {25, 5}, {25, 5}, {25, 30}});
  const std::vector<Line> lines = table(folder, {ramp(folder), "--line", bent, "--spacing", "10"});
  REQUIRE(lines.size() == 5);
  for (std::size_t k = 0; k < 5; ++k) {
    const Line& line = lines[k];
    CHECK(line.front().closed == 0);
    for (std::size_t i = 0; i < line.size(); ++i) {
      const Row& r = line[i];
      CHECK(r.station == 10.0 * double(k));
      if (i > 0) CHECK(r.right() > line[i - 1].right());  // ground runs to the right
      if (k < 2) {
        CHECK(r.x == kX + 5.0 + 10.0 * double(k));
        CHECK(r.y == kY + 5.0 - r.right());
      } else {
        CHECK(r.y == kY + 5.0 + 10.0 * double(k - 2));
        CHECK(r.x == kX + 25.0 + r.right());
      }
      CHECK(r.height == Approx(100.0 + 0.5 * (r.x - kX)));
    }
    CHECK(line.front().right() == (k < 2 ? -35.0 : -25.0));
    CHECK(line.back().right() == (k < 2 ? 5.0 : 15.0));
  }
  // Along it: a section for each piece, cut off at its ends.
  const std::vector<Line> along = table(folder, {ramp(folder), "--line", bent, "--along"});
  REQUIRE(along.size() == 2);
  CHECK(along[0].front().station == 0.0);
  CHECK(along[0].back().station == 20.0);
  CHECK(along[1].front().station == 20.0);
  CHECK(along[1].back().station == 45.0);
  for (const Row& r : along[0]) {
    CHECK(r.offset == "0");
    CHECK(r.y == kY + 5.0);
    CHECK(r.x == Approx(kX + 5.0 + r.station).epsilon(1e-15));
    CHECK(r.height == Approx(102.5 + 0.5 * r.station));
  }
  for (const Row& r : along[1]) {
    CHECK(r.x == kX + 25.0);
    CHECK(r.height == Approx(112.5));
  }
}

TEST_CASE("section: a tube aslant has closed lines across it, as wide as it is", "[pipeline]") {
  const TempFolder folder;
  constexpr int kRings = 30, kSides = 16;
  std::string text =
      "OFF " + std::to_string(kRings * kSides) + " " + std::to_string((kRings - 1) * kSides) + " 0\n";
  for (int ring = 0; ring < kRings; ++ring)
    for (int side = 0; side < kSides; ++side) {
      const double turn = 2.0 * 3.14159265358979323846 * side / kSides, u = 2.0 * std::cos(turn);
      char line[80];
      std::snprintf(line, sizeof line, "%.17g %.17g %.17g\n", kX + 0.6 * ring + 0.8 * u,
                    kY + 0.8 * ring - 0.6 * u, 20.0 + 2.0 * std::sin(turn));
      text += line;
    }
  for (int ring = 0; ring + 1 < kRings; ++ring)
    for (int side = 0; side < kSides; ++side) {
      const int a = ring * kSides + side, b = ring * kSides + (side + 1) % kSides;
      text += "4 " + std::to_string(a) + " " + std::to_string(b) + " " + std::to_string(b + kSides) + " " +
              std::to_string(a + kSides) + "\n";
    }
  const std::string tube = folder.write("tube.off", text).string();
  const std::vector<Line> lines =
      table(folder, {tube, "--line", axis(folder, {{-0.6, -0.8}, {15, 20}}), "--spacing", "2.5"});
  REQUIRE(lines.size() == 10);  // the tube begins at station 1
  for (const Line& line : lines) {
    CHECK(line.front().closed == 1);
    CHECK(std::abs(area(line)) == Approx(0.5 * kSides * 4.0 * std::sin(2.0 * 3.14159265358979 / kSides)));
    for (const Row& r : line) CHECK(std::hypot(r.right(), r.z - 20.0) <= Approx(2.0));
  }
}

TEST_CASE("section: horizontal ones are floor plans, and slices from a height upwards", "[pipeline]") {
  const TempFolder folder;
  const std::vector<Line> plan = table(folder, {box(folder), "--horizontal", "--from", "251.5"});
  REQUIRE(plan.size() == 1);
  double sum = 0.0;
  for (std::size_t k = 0; k < plan[0].size(); ++k) {
    const Row& r = plan[0][k];
    CHECK(r.closed == 1);
    CHECK(r.offset.empty());
    CHECK(r.station == 251.5);
    CHECK(r.z == 251.5);
    if (k > 0) sum += (plan[0][k - 1].x - kX) * (r.y - kY) - (r.x - kX) * (plan[0][k - 1].y - kY);
  }
  CHECK(0.5 * sum == 40.0);
  const std::vector<Line> slices =
      table(folder, {box(folder), "--horizontal", "--from", "249.75", "--spacing", "1"});
  REQUIRE(slices.size() == 3);
  for (std::size_t k = 0; k < 3; ++k) {
    CHECK(slices[k].front().section == int(k) + 1);
    CHECK(slices[k].front().z == 250.75 + double(k));
  }
}

TEST_CASE("section: lines in place for other programs, and a drawing", "[pipeline]") {
  const TempFolder folder;
  const std::string line = axis(folder, {{-4, 2}, {14, 2}});
  const auto write = [&](const std::string& name) {
    make({box(folder), "--line", line, "--spacing", "5", "-o", (folder / name).string(), "--crs",
          "EPSG:25832"});
    return file_bytes(folder / name);
  };
  const tessera::Json json = tessera::parse_json(write("a.geojson"));
  REQUIRE(json.at("features").size() == 2);
  CHECK(json.at("crs").at("properties").at("name").get<std::string>().find("25832") != std::string::npos);
  const tessera::Json& f = json.at("features")[1];
  CHECK(f.at("properties").at("station") == 10.0);
  CHECK(f.at("properties").at("section") == 2);
  CHECK(f.at("properties").at("closed") == 1);
  CHECK(f.at("geometry").at("coordinates").front() == f.at("geometry").at("coordinates").back());
  for (const tessera::Json& p : f.at("geometry").at("coordinates")) {
    CHECK(p[0] == kX + 6.0);
    CHECK(p[1].get<double>() >= kY);
    CHECK(p[1].get<double>() <= kY + 4.0);
    CHECK(p[2].get<double>() >= 250.0);
  }
  const std::string dxf = write("a.dxf");
  CHECK(count(dxf, "\nPOLYLINE\n") == 2);
  CHECK(dxf.find("SECTION_5\n") != std::string::npos);
  CHECK(dxf.find("SECTION_10\n") != std::string::npos);
  CHECK(dxf.find("\n500006\n") != std::string::npos);
  const std::string gpkg = write("a.gpkg");
  CHECK(gpkg.rfind("SQLite format 3", 0) == 0);
  CHECK(gpkg.find("sections") != std::string::npos);
  CHECK(gpkg.find("station") != std::string::npos);
  const std::string svg = write("a.svg");
  CHECK(svg.rfind("<?xml", 0) == 0);
  CHECK(count(svg, "<g id=\"section-") == 2);
  CHECK(count(svg, "<g") == count(svg, "</g>"));
  CHECK(svg.find(">station 10, heights 250 to 253</text>") != std::string::npos);
  CHECK(svg.find("z\"/>") != std::string::npos);
  CHECK(svg.find("1 unit = 1e-05 units") != std::string::npos);
  // Pieces along an axis share a row, each with its station.
  make({box(folder), "--line", axis(folder, {{-1, 2}, {5, 2}, {11, 2}}), "--along", "-o",
        (folder / "along.svg").string()});
  const std::string profile = file_bytes(folder / "along.svg");
  CHECK(count(profile, "<g id=\"section-") == 2);
  CHECK(profile.find(">station 1</text>") != std::string::npos);
  CHECK(profile.find(">station 6</text>") != std::string::npos);
}

TEST_CASE("section: over many patches the same bytes by any way", "[pipeline]") {
  const TempFolder folder;
  const std::string mesh =
      folder
          .write("cone.off", height_sheet(160, 320.0, kX, kY,
                                          [](double x, double y) {
                                            return 50.0 - 0.2 * std::hypot(x - 150.0, y - 150.0) +
                                                   2.0 * std::sin(0.1 * x) * std::cos(0.13 * y);
                                          }))
          .string();
  const std::string line = axis(folder, {{-20, 10}, {150, 170}, {300, 20}, {310, 300}});
  const std::vector<std::vector<std::string>> ways = {{"--line", line, "--spacing", "7", "--width", "90"},
                                                      {"--line", line, "--along"},
                                                      {"--horizontal", "--from", "3", "--spacing", "1.5"}};
  for (const auto& way : ways)
    for (const char* extension : {".csv", ".svg", ".geojson", ".gpkg", ".dxf"}) {
      CAPTURE(way, extension);
      const std::string a = (folder / "a").string() + extension, b = (folder / "b").string() + extension;
      std::vector<std::string> first = {mesh, "-o", a, "--memory", "2G", "-t", "2", "--force"},
                               second = {mesh, "-o", b, "--memory", "192M", "-t", "1", "--force"};
      first.insert(first.end(), way.begin(), way.end());
      second.insert(second.end(), way.begin(), way.end());
      make(first);
      make(second);
      CHECK((file_bytes(a) == file_bytes(b)));
    }
  // Every profile is one line from end to end of its piece; the axis begins beside the mesh.
  const std::vector<Line> along = table(folder, {mesh, "--line", line, "--along"});
  REQUIRE(along.size() == 3);
  CHECK(along[0].front().x == Approx(kX).epsilon(1e-15));
  CHECK(along[0].back().station == along[1].front().station);
  CHECK(along[0].back().height == Approx(along[1].front().height).epsilon(1e-12));
  CHECK(along[1].back().station == along[2].front().station);
  CHECK(along[2].back().y == Approx(kY + 300.0).epsilon(1e-15));
  // Every section is one line from side to side.
  for (const Line& l : table(folder, {mesh, "--line", axis(folder, {{60, 60}, {260, 260}}), "--spacing", "7",
                                      "--width", "60"})) {
    CHECK(l.front().line == 0);
    CHECK(l.front().right() == -30.0);
    CHECK(l.back().right() == 30.0);
  }
}

TEST_CASE("section: what cannot be is refused in a sentence", "[pipeline]") {
  const TempFolder folder;
  const std::string mesh = box(folder), line = axis(folder, {{-4, 2}, {14, 2}});
  const auto refused = [&](const std::string& out, const std::vector<std::string>& how, int code,
                           const std::string& why) {
    std::vector<std::string> words = {"section", mesh, "-o", (folder / out).string()};
    words.insert(words.end(), how.begin(), how.end());
    const CommandResult r = tessera_command(words);
    CAPTURE(words, r.errors);
    CHECK(r.code == code);
    CHECK_THAT(r.errors, Catch::Contains(why));
    CHECK(count(r.errors, "\n") == 1);
  };
  const std::string
      point = folder.write("p.geojson", R"({"type": "Point", "coordinates": [1, 2]})").string(),
      none = folder.write("n.geojson", R"({"type": "LineString", "coordinates": [[1, 2], [1, 2]]})").string(),
      bad = folder.write("b.geojson", R"({"type": "LineString", "coordinates": [[1], 2]})").string(),
      text = folder.write("t.geojson", "no JSON").string();
  refused("a.csv", {"--spacing", "5"}, 2, "--line is missing");
  refused("a.csv", {"--line", line}, 2, "--spacing is missing");
  refused("a.csv", {"--line", line, "--spacing", "0"}, 2, "--spacing is missing");
  refused("a.csv", {"--line", line, "--spacing", "-5"}, 2, "--spacing");
  refused("a.csv", {"--line", line, "--spacing", "1e-8"}, 2, "sections");
  refused("a.csv", {"--line", line, "--spacing", "5", "--width", "0"}, 2, "--width");
  refused("a.csv", {"--line", line, "--spacing", "5", "--width", "-1.5"}, 2, "--width");
  refused("a.csv", {"--line", line, "--along", "--width", "3"}, 2, "--width");
  refused("a.csv", {"--line", line, "--along", "--horizontal"}, 2, "one or the other");
  refused("a.csv", {"--line", line, "--horizontal"}, 2, "no axis");
  refused("a.shp", {"--line", line, "--spacing", "5"}, 2, ".csv, .svg, .dxf, .gpkg or .geojson");
  refused("a.csv", {"--line", point, "--spacing", "5"}, 3, "no LineString");
  refused("a.csv", {"--line", none, "--spacing", "5"}, 3, "no length");
  refused("a.csv", {"--line", bad, "--spacing", "5"}, 3, "no pair of numbers");
  refused("a.csv", {"--line", text, "--spacing", "5"}, 3, "is not JSON");
  refused("a.csv", {"--line", (folder / "missing").string(), "--spacing", "5"}, 3, "missing");
  refused("a.csv", {"--line", axis(folder, {{-40, 2}, {-30, 2}}), "--spacing", "5"}, 5, "no section across");
  refused("a.csv", {"--line", axis(folder, {{-40, 2}, {-30, 2}}), "--along"}, 5, "no part of the axis");
  refused("a.csv", {"--horizontal", "--from", "300", "--spacing", "1"}, 5, "heights are 250 to 253");
  refused("a.csv", {"--horizontal"}, 5, "no section from 0 on");
  CHECK_FALSE(fs::exists(folder / "a.csv"));
  folder.write("a.csv", "mine");
  refused("a.csv", {"--horizontal", "--from", "251"}, 2, "--force");
  CHECK(file_bytes(folder / "a.csv") == "mine");
  refused("axis.geojson", {"--line", line, "--spacing", "5", "--force"}, 2, "axis.geojson");
}

}  // namespace section_test
