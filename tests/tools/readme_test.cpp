// What the pages for people say of options is what the commands say of them: `tessera COMMAND --markdown` prints the rows.
#include <catch2/catch.hpp>

#include <fstream>
#include <set>
#include <sstream>

#include "tests/helpers/shell.h"

namespace readme_test {

using namespace tessera::test;

TEST_CASE("pages: their options are those of the commands, word for word", "[pipeline]") {
  std::set<std::string> known;
  for (const char* command :
       {"reconstruct", "smooth",   "decimate", "remesh", "resurface", "csg",    "field",  "deform",
        "merge",       "plan",     "resample", "tiles",  "submit",    "volume", "raster", "contours",
        "section",     "classify", "deviate",  "change", "bake",      "watch"}) {
    const Outcome r = shell(std::string(TESSERA_BINARY " ") + command + " --markdown");
    REQUIRE(r.code == 0);
    std::istringstream rows(r.said);
    for (std::string row; std::getline(rows, row);) known.insert(row);
  }
  std::size_t rows = 0;
  for (const char* page : {"/README.md", "/tools/COMMANDS.md"}) {
    std::ifstream text(std::string(TESSERA_SOURCE_DIR) + page);
    REQUIRE(text);
    for (std::string line; std::getline(text, line);) {
      if (line.rfind("| `-", 0) != 0) continue;
      CAPTURE(page, line);
      CHECK(known.count(line) == 1);
      ++rows;
    }
  }
  CHECK(rows > 90);
}

TEST_CASE("every command has help, and shows what its options are", "[pipeline]") {
  for (const std::string command :
       {"plan",   "reconstruct", "resurface", "csg",     "field",        "smooth",  "decimate", "remesh",
        "task",   "status",      "cancel",    "check",   "render",       "report",  "tiles",    "view",
        "deform", "merge",       "info",      "convert", "parameterize", "synth",   "doctor",   "resample",
        "volume", "raster",      "contours",  "section", "classify",     "deviate", "bake",     "watch"}) {
    CAPTURE(command);
    const Outcome r = shell(TESSERA_BINARY " " + command + " --help");
    CHECK(r.code == 0);
    CHECK(r.said.find("--job FILE") != std::string::npos);
  }
}

}  // namespace readme_test
