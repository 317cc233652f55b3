// A machine that loses its power: what was not brought to the disk is damaged, and the same command ends in the same bytes.
#include <catch2/catch.hpp>

#include <signal.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/helpers/command.h"
#include "tests/helpers/power_cut.h"
#include "tests/helpers/random.h"
#include "tests/helpers/reconstruct_command.h"
#include "tests/helpers/temp_folder.h"

namespace power_cut_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// Of the programs that are run while it lives.
struct Variable {
  Variable(const char* variable, const std::string& value) : name(variable) {
    ::setenv(name, value.c_str(), 1);
  }
  ~Variable() { ::unsetenv(name); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;
  const char* name;
};

}  // namespace

TEST_CASE("power cut: what was not synced is done again, whichever of it is lost", "[fault]") {
  namespace fs = std::filesystem;
  const TempFolder folder;
  const std::string scan = (folder / "scan.ply").string();
  REQUIRE(tessera_command(
              {"synth", "--scene", "csg", "--points", "30000", "--normals", "--noise", "0.2s", "-o", scan})
              .code == 0);
  const std::vector<std::string> more =
      GENERATE(std::vector<std::string>{}, std::vector<std::string>{"--tolerance", "auto"},
               std::vector<std::string>{"--processes"});
  fs::create_directories(folder / "whole");
  fs::create_directories(folder / "cut");
  const fs::path whole = folder / "whole/out.ply", out = folder / "cut/out.ply",
                 synced = folder / "synced.txt";
  reconstructed(scan, whole, more);
  const Variable layer("LD_PRELOAD", TESSERA_FAULT_LAYER), log("TESSERA_SYNCED", synced.string());
  Random random(31);
  std::size_t cuts = 0, hurt = 0, resumed = 0;
  // Later each time: of a young job everything may be lost.
  for (std::size_t commit = 9;; commit += commit) {
    const CommandResult r = tessera_command(reconstruct_words(scan, out, more), 0,
                                            "TESSERA_FAULT=commit:" + std::to_string(commit));
    INFO("killed at commit " << commit << "\n" << r.errors);
    if (r.code == 0) {
      const Json report = parse_json(file_bytes(out.string() + ".report.json"));
      for (const Json& stage : report.at("stages")) resumed += stage.at("tasks_resumed").get<std::size_t>();
      resumed += report.at("run").at("stages_resumed").get<std::size_t>();
      break;
    }
    REQUIRE(r.code == 128 + SIGKILL);
    if (fs::exists(out)) CHECK(file_bytes(out) == file_bytes(whole));
    ++cuts;
    hurt += lose_unsynced(folder / "cut", synced, random);
  }
  CHECK(file_bytes(out) == file_bytes(whole));
  CHECK(cuts >= 3);
  CHECK(hurt >= 10);
  CHECK(resumed > 0);
}

}  // namespace power_cut_test
