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

}  // namespace survey_page_test
