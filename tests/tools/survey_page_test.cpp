// Pages of survey commands: whole, with the figures and the verdict, the same bytes on any way, and without pictures where none can
// be drawn.
#include <catch2/catch.hpp>

#include <string>
#include <vector>

#include "kernels/picture/caption.h"
#include "stream/files/json.h"
#include "stream/page/html.h"
#include "tests/helpers/command.h"
#include "tests/helpers/html_fault.h"
#include "tests/helpers/temp_folder.h"

namespace survey_page_test {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

/// A square of 10 x 10 in two faces, seen from above.
constexpr const char* kSquare = "OFF 4 2 0\n0 0 0\n10 0 0\n10 10 0\n0 10 0\n3 0 1 2\n3 0 2 3\n";

/// A lattice of points over the square, one in a hundred of them 0.4 above it, the others up to 0.05 above or below.
std::string points_over_square() {
  std::string text;
  for (int i = 0; i < 100; ++i)
    for (int k = 0; k < 100; ++k) {
      const double height = i % 10 == 5 && k % 10 == 5 ? 0.4 : 0.01 * ((i * 7 + k * 3) % 11 - 5);
      text += std::to_string(0.05 + 0.1 * i) + " " + std::to_string(0.05 + 0.1 * k) + " " +
              std::to_string(height) + "\n";
    }
  return text;
}

CommandResult deviate(const TempFolder& folder, const std::string& page, const std::vector<std::string>& more,
                      const std::string& environment = {}) {
  std::vector<std::string> words = {"deviate", (folder / "scan <b>.xyz").string(),
                                    "--to",    (folder / "square.off").string(),
                                    "--page",  (folder / page).string()};
  words.insert(words.end(), more.begin(), more.end());
  return tessera_command(words, 0, environment);
}

void write_scene(const TempFolder& folder) {
  folder.write("square.off", kSquare);
  folder.write("scan <b>.xyz", points_over_square());
}

bool holds(const std::string& page, const std::string& text) {
  return page.find(text) != std::string::npos;
}

/// A box of 4 x 3 x 2 from the origin on, outward faces.
constexpr const char* kBlock =
    "OFF 8 12 0\n0 0 0\n4 0 0\n0 3 0\n4 3 0\n0 0 2\n4 0 2\n0 3 2\n4 3 2\n"
    "3 0 2 1\n3 1 2 3\n3 4 5 6\n3 5 7 6\n3 0 1 4\n3 1 5 4\n3 2 6 3\n3 3 6 7\n3 0 4 2\n3 2 4 6\n3 1 3 5\n3 3 "
    "7 5\n";

std::string section_page(const TempFolder& folder, const std::vector<std::string>& more) {
  folder.write("block & co.off", kBlock);
  folder.write("axis.geojson", R"({"type": "LineString", "coordinates": [[-1, 1], [5, 1]]})");
  std::vector<std::string> words = {"section", (folder / "block & co.off").string(), "--page",
                                    (folder / "s.html").string(), "--force"};
  words.insert(words.end(), more.begin(), more.end());
  const CommandResult r = tessera_command(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return file_bytes(folder / "s.html");
}

std::size_t count_of(const std::string& text, const std::string& what) {
  std::size_t count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

}  // namespace

TEST_CASE("survey page: of deviations it is well formed, loads nothing, and holds figures, verdict and names",
          "[pipeline]") {
  const TempFolder folder;
  write_scene(folder);
  folder.write("lots.geojson",
               R"({"type": "Polygon", "coordinates": [[[0, 0], [5, 0], [5, 10], [0, 10], [0, 0]]]})");
  const CommandResult failed = deviate(folder, "page.html",
                                       {"--tolerance", "0.1", "--within", (folder / "lots.geojson").string(),
                                        "--report", (folder / "d.json").string()});
  INFO(failed.errors);
  REQUIRE(failed.code == 6);
  const std::string page = file_bytes(folder / "page.html");
  CHECK(html_fault(page) == "");
  CHECK(holds(page, "<b>NOT PASSED</b>"));
  CHECK_FALSE(holds(page, "<b>PASSED</b>"));
  CHECK(holds(page, "scan &lt;b&gt;.xyz"));
  CHECK_FALSE(holds(page, "<b>.xyz"));
  for (const char* outside : {"http:", "https:", "<link", "<script", "url("})
    CHECK_FALSE(holds(page, outside));
  CHECK(holds(page, "src=\"data:image/png;base64,"));
  CHECK_FALSE(holds(page, "Pictures left out"));
  const Json all = parse_json(file_bytes(folder / "d.json")).at("areas").at(0);
  CHECK(holds(page, "<td>" + with_commas(all.at("points").get<std::uint64_t>()) + "</td>"));
  char mean[40], rms[40];
  std::snprintf(mean, sizeof mean, "<td>%+.6g</td>", all.at("mean").get<double>());
  std::snprintf(rms, sizeof rms, "<td>%.6g</td>", all.at("rms").get<double>());
  CHECK(holds(page, mean));
  CHECK(holds(page, rms));
  CHECK(holds(page, "99 %, 9,900 points"));
  CHECK(holds(page, "<text class=\"mark\""));
  CHECK(holds(page, ">+0.1</text>"));
  CHECK(holds(page, "By polygon"));
  CHECK(holds(page, "<th scope=\"row\">1</th><td>5,000</td>"));
  // Places are ten, of the hundred that lie high, and a twentieth of the scan apart.
  CHECK(holds(page, "<th scope=\"row\">10</th>"));
  CHECK(holds(page, "<td>+0.4</td>"));

  REQUIRE(deviate(folder, "page.html", {"--tolerance", "0.1", "--share", "0.98", "--force"}).code == 0);
  const std::string passed = file_bytes(folder / "page.html");
  CHECK(html_fault(passed) == "");
  CHECK(holds(passed, "<b>PASSED</b>"));
  CHECK_FALSE(holds(passed, "NOT PASSED"));
  // Without a tolerance there is no verdict, and a page alone is output enough.
  REQUIRE(deviate(folder, "plain.html", {}).code == 0);
  CHECK_FALSE(holds(file_bytes(folder / "plain.html"), "PASSED"));
}

TEST_CASE("survey page: the bytes of the page hang on neither threads nor memory", "[property]") {
  const TempFolder folder;
  write_scene(folder);
  std::string first;
  for (const std::vector<std::string>& run : {std::vector<std::string>{"-t", "1", "--memory", "1G"},
                                              {"-t", "4", "--memory", "400M"},
                                              {"-t", "2"}}) {
    std::vector<std::string> words = {"--force"};
    words.insert(words.end(), run.begin(), run.end());
    REQUIRE(deviate(folder, "page.html", words).code == 0);
    const std::string page = file_bytes(folder / "page.html");
    if (first.empty()) first = page;
    CHECK(page == first);
  }
  CHECK(holds(first, "data:image/png"));
}

TEST_CASE(
    "survey page: without OSMesa, and under a cap too small for pictures, the page says why it has none",
    "[fault]") {
  const TempFolder folder;
  write_scene(folder);
  fs::create_directory(folder / "none");
  for (const char* name : {"libOSMesa.so.8", "libOSMesa.so.6"}) folder.write(std::string("none/") + name, "");
  REQUIRE(deviate(folder, "page.html", {}, "LD_LIBRARY_PATH=" + (folder / "none").string()).code == 0);
  const std::string page = file_bytes(folder / "page.html");
  CHECK(html_fault(page) == "");
  CHECK(holds(page, "Pictures left out: rasterizer: the software OpenGL library OSMesa cannot be loaded"));
  CHECK_FALSE(holds(page, "data:image/png"));
  CHECK(holds(page, "root mean square"));
  CHECK(holds(page, "Worst places"));

  const CommandResult r = deviate(folder, "small.html", {"--memory", "130M"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.peak_bytes < std::uint64_t{130} << 20);
  CHECK(holds(file_bytes(folder / "small.html"), "Pictures left out: render: a picture of"));
}

TEST_CASE("survey page: names that are no page, and inputs, are not written to", "[fault]") {
  const TempFolder folder;
  write_scene(folder);
  const CommandResult r = deviate(folder, "page.pdf", {});
  CHECK(r.code == 2);
  CHECK(holds(r.errors, "end its name in .html"));
  folder.write("page.html", "mine");
  CHECK(deviate(folder, "page.html", {}).code == 2);
  CHECK(file_bytes(folder / "page.html") == "mine");
}

TEST_CASE("survey page: of sections it has a drawing, chainage and length of each, and a map", "[pipeline]") {
  const TempFolder folder;
  const std::string axis = (folder / "axis.geojson").string();
  const std::string page =
      section_page(folder, {"--line", axis, "--spacing", "1", "-o", (folder / "s.csv").string()});
  CHECK(html_fault(page) == "");
  CHECK(holds(page, "block &amp; co.off"));
  // The planes at 2, 3 and 4 cut through the block, those at 1 and 5 lie in its sides.
  const auto drawn = count_of(page, "<figure class=\"drawing\">");
  CHECK(drawn >= 4);
  CHECK(drawn <= 6);
  CHECK(holds(page, "Axis and sections from above"));
  CHECK(holds(
      page, "<th scope=\"row\">Section 3</th><td>3</td><td>1</td><td>1</td><td>10</td><td>0</td><td>2</td>"));
  CHECK(holds(page, "chainage <b>3</b>"));
  CHECK(fs::file_size(folder / "s.csv") > 100);
  CHECK(section_page(folder, {"--line", axis, "--spacing", "1", "-t", "3", "--memory", "200M"}) == page);

  const std::string plan = section_page(folder, {"--horizontal", "--from", "0.5"});
  CHECK(html_fault(plan) == "");
  CHECK(
      holds(plan, "<th scope=\"row\">Section 0</th><td>0.5</td><td>1</td><td>1</td><td>14</td><td>12</td>"));
  const std::string along = section_page(folder, {"--line", axis, "--along"});
  CHECK(html_fault(along) == "");
  CHECK(holds(along, "stations <b>1 to 5</b>"));
}

TEST_CASE("survey page: of thousands of sections a page shows some and says so", "[pipeline]") {
  const TempFolder folder;
  const std::string page = section_page(
      folder, {"--line", (folder / "axis.geojson").string(), "--spacing", "0.002", "--width", "1"});
  CHECK(html_fault(page) == "");
  const std::size_t drawn = count_of(page, "<figure class=\"drawing\">");
  CHECK(drawn > 100);
  CHECK(drawn <= 201);
  CHECK(holds(page, "This page shows one in 10 of the "));
  CHECK(page.size() < 1000000);
}

TEST_CASE("survey page: of volumes it has figures by polygon, what they may be off, and the polygons",
          "[pipeline]") {
  const TempFolder folder;
  folder.write("square.off", kSquare);
  folder.write("lots.geojson",
               R"({"type": "MultiPolygon", "coordinates": [[[[0, 0], [5, 0], [5, 10], [0, 10], [0, 0]],
                [[1, 1], [2, 1], [2, 2], [1, 2], [1, 1]]], [[[6, 0], [8, 0], [8, 2], [6, 0]]]]})");
  std::vector<std::string> words = {"volume",      (folder / "square.off").string(),
                                    "--base",      "plane:-1.5",
                                    "--page",      (folder / "v.html").string(),
                                    "--within",    (folder / "lots.geojson").string(),
                                    "--tolerance", "0.01"};
  REQUIRE(tessera_command(words).code == 0);
  const std::string page = file_bytes(folder / "v.html");
  CHECK(html_fault(page) == "");
  CHECK(holds(
      page, "<th scope=\"row\">1</th><td>49</td><td>49</td><td>73.5</td><td>0</td><td>73.5</td><td>1</td>"));
  CHECK(holds(page, "<th scope=\"row\">2</th><td>2</td><td>2</td><td>3</td><td>0</td><td>3</td><td>1</td>"));
  CHECK(count_of(page, "<path class=\"area\"") == 2);
  CHECK(count_of(page, "<path class=\"outline\"") == 1);
  CHECK(holds(page, "square.off over plane:-1.5"));
  words[1] = (folder / "none.off").string();
  words[5] = (folder / "none.html").string();
  CHECK(tessera_command(words).code == 3);
  CHECK_FALSE(fs::exists(folder / "none.html"));
}

}  // namespace survey_page_test
