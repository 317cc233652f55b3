// `tools/panel_scans` with a program that only claims to be tessera: which scans it takes, rows, summary, exit codes.
#include <catch2/catch.hpp>

#include "stream/files/json.h"
#include "tests/helpers/shell.h"

namespace panel_scans_test {

namespace {

using namespace tessera;

const std::string kPanel = std::string(TESSERA_SOURCE_DIR) + "/tools/panel_scans ";

/// Refuses scans that are called bad, makes a defect of those that are called torn, and sleeps over those called slow.
std::string program(const test::TempFolder& folder) {
  const std::filesystem::path path = folder / "tessera";
  test::spill(path, R"(#!/bin/sh
if [ $1 = check ]; then
  while [ $# -gt 0 ]; do case $1 in --json) json=$2; shift 2 ;; *.ply) mesh=$1; shift ;; *) shift ;; esac; done
  grep -q torn "$mesh" && defect='"1 face has no area"'
  echo "{\"defects\": [$defect], \"cleanliness\": {\"sharp_edges_per_1000\": 6.5, \"border_jaggedness\": 1.1}}" > "$json"
  exit 0
fi
scan=$2
case $scan in *slow*) sleep 60 ;; *bad*) echo 'tessera: error: it is bad' >&2; exit 6 ;; esac
while [ $# -gt 0 ]; do case $1 in -o) out=$2; shift 2 ;; *) shift ;; esac; done
echo "$scan" > "$out"
echo '{"points": 1234, "coverage": {"plan": 0.99, "confirmed": 0.98}, "mesh": {"faces": 77}, "wall_s": 1.5, "peak_bytes": 1048576,
  "stages": [{"name": "orient", "result": {"scene": "object", "uncertain_fraction": 0.005}}]}' > "$out.report.json"
)");
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  return path.string();
}

}  // namespace

TEST_CASE("panel_scans: senseless lines end with 2 and say how", "[unit]") {
  const test::TempFolder folder;
  std::filesystem::create_directories(folder / "empty");
  for (const std::string& line :
       {std::string(), (folder / "none").string(), (folder / "empty").string(),
        (folder / "empty").string() + " --dance", folder.path().string() + " --keep"}) {
    INFO(line);
    const test::Outcome outcome = test::shell(kPanel + line);
    CHECK(outcome.code == 2);
    CHECK(!outcome.said.empty());
  }
}

TEST_CASE("panel_scans: one row a scan, and how many keep to what is asked", "[unit]") {
  const test::TempFolder folder;
  const std::filesystem::path scans = folder / "scans";
  std::filesystem::create_directories(scans / "below");
  for (const char* name : {"a.las", "below/b.PLY", "bad.e57", "slow.pts", "notes.txt"})
    test::spill(scans / name, name);
  test::spill(scans / "copy.las", "a.las");
  const std::string line = kPanel + scans.string() + " --tessera " + program(folder) +
                           " --seconds 3 --json " + (folder / "panel.json").string();
  const test::Outcome outcome = test::shell(line);
  INFO(outcome.said);
  CHECK(outcome.code == 0);
  const Json panel = parse_json(test::file_bytes(folder / "panel.json"));
  REQUIRE(panel.at("rows").size() == 4);
  const Json& first = panel.at("rows").at(0);
  CHECK(first.at("scan") == (scans / "a.las").string());
  CHECK(first.at("points") == 1234);
  CHECK(first.at("scene") == "object");
  CHECK(first.at("code") == 0);
  CHECK(first.at("faces") == 77);
  CHECK(first.at("plan") == 0.99);
  CHECK(first.at("confirmed") == 0.98);
  CHECK(first.at("doubt") == 0.005);
  CHECK(first.at("sharp") == 6.5);
  CHECK(first.at("jaggedness") == 1.1);
  CHECK(panel.at("rows").at(1).at("code") == 6);
  CHECK(panel.at("rows").at(1).at("error") == "error: it is bad");
  CHECK(panel.at("rows").at(3).at("code") == 124);
  CHECK(outcome.said.find("it is bad") != std::string::npos);
  const Json& summary = panel.at("summary");
  CHECK(summary.at("codes") == Json({{"0", 2}, {"6", 1}, {"124", 1}}));
  CHECK(summary.at("plan_0.97") == Json({{"of", 2}, {"hold", 2}}));
  CHECK(summary.at("sharp_5") == Json({{"of", 2}, {"hold", 0}}));
}

TEST_CASE("panel_scans: a defect ends with 1", "[unit]") {
  const test::TempFolder folder;
  test::spill(folder / "torn.laz", "x");
  const test::Outcome outcome =
      test::shell(kPanel + (folder / "torn.laz").string() + " --tessera " + program(folder) + " --out " +
                  (folder / "out").string() + " --keep");
  INFO(outcome.said);
  CHECK(outcome.code == 1);
  CHECK(std::filesystem::exists(folder / "out" / "0000.ply.report.json"));
}

}  // namespace panel_scans_test
