// What an install holds beside the program, and what `tessera doctor` says of a machine.
#include <catch2/catch.hpp>

#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace manual_test {

using namespace tessera::test;

namespace {

bool holds(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("manual: the page names commands, options with their defaults, and exit codes", "[pipeline]") {
  const Outcome page = shell(TESSERA_BINARY " --man-page");
  REQUIRE(page.code == 0);
  CHECK(page.said.rfind(".TH TESSERA 1", 0) == 0);
  for (const char* command : {"reconstruct", "decimate", "remesh", "smooth", "report", "doctor"})
    CHECK(holds(page.said, std::string(".SH \"tessera ") + command + "\"\n"));
  CHECK(holds(page.said, "\\fB\\-\\-feature\\-angle\\fR \\fIX\\fR\n"));
  CHECK(holds(page.said, "\\fB\\-\\-threads\\fR, \\fB\\-t\\fR"));
  CHECK(holds(page.said, "[emc]\n"));
  CHECK(holds(page.said, ".TP\n130, 143\n"));
  CHECK_FALSE(holds(page.said, "\\-\\-driven"));  // hidden
}

TEST_CASE("manual: the completion is bash, and completes commands, options and words", "[pipeline]") {
  const TempFolder folder;
  const std::string script = (folder / "tessera.bash").string();
  REQUIRE(shell(TESSERA_BINARY " --bash-completion >" + script).code == 0);
  const auto completes = [&](const std::string& words, int at) {
    return shell("bash -c 'source " + script + "; COMP_WORDS=(" + words +
                 "); COMP_CWORD=" + std::to_string(at) + "; _tessera; echo \"${COMPREPLY[*]}\"'")
        .said;
  };
  CHECK(completes("tessera rec", 1) == "reconstruct\n");
  CHECK(completes("tessera smooth --feat", 2) == "--feature-angle\n");
  CHECK(completes("tessera reconstruct --normals g", 3) == "given\n");
  CHECK(completes("tessera reconstruct scan", 2) == "\n");  // files, by the shell
}

TEST_CASE("doctor: says what a job can count on, and fails where something is missing", "[pipeline]") {
  const TempFolder folder;
  const Outcome good = shell(TESSERA_BINARY " doctor --temp " + folder.path().string());
  INFO(good.said);
  CHECK(good.code == 0);
  for (const char* part : {"tessera 0", "x86-64-v3", "memory cap", "writes ", "OpenGL", "GDAL  ",
                           "GPU          not used", "libmetis.so", "jobs can run here"})
    CHECK(holds(good.said, part));
  CHECK(std::filesystem::is_empty(folder.path()));
  const Outcome small = shell(TESSERA_BINARY " doctor --memory 16M --temp " + folder.path().string());
  CHECK(small.code == 4);
  CHECK(holds(small.said, "a memory cap of 64.0 MiB or more"));
  const Outcome none = shell(TESSERA_BINARY " doctor --temp " + (folder / "none").string());
  CHECK(none.code == 4);
  CHECK(holds(none.said, "--temp"));
}

}  // namespace manual_test
