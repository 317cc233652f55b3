// `tools/panel_crossings` on a made mesh: every operation has a figure, and what crosses as given is told apart from what came to cross.
#include <catch2/catch.hpp>

#include "stream/files/json.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace panel_crossings_test {

namespace {

using namespace tessera;
using namespace tessera::test;

const std::string kPanel = std::string(TESSERA_SOURCE_DIR) + "/tools/panel_crossings ";

/// One ball, or two that pass through each other.
void write_balls(const std::filesystem::path& path, int count) {
  WholeMesh mesh;
  for (int n = 0; n < count; ++n) {
    const Icosphere s = icosphere(3);
    const auto first = static_cast<std::uint64_t>(mesh.points.size());
    for (const Double3& p : s.positions) mesh.points.push_back({p[0] + 0.7 * n, p[1] + 0.1 * n, p[2]});
    for (const auto& f : s.faces) mesh.faces.push_back({first + f[0], first + f[1], first + f[2]});
  }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  mesh.header.double_positions = true;
  write_whole(path, mesh);
}

}  // namespace

TEST_CASE("panel_crossings: a row of each operation, CGAL's count beside ours", "[pipeline]") {
  const TempFolder folder;
  write_balls(folder / "one.ply", 1);
  write_balls(folder / "two.ply", 2);
  const std::filesystem::path json = folder / "table.json";
  const Outcome outcome =
      shell(kPanel + (folder / "one.ply").string() + " " + (folder / "two.ply").string() + " --tessera " +
            TESSERA_BINARY + " --json " + json.string() + " --only decimate,deform,merge,smooth-repair");
  INFO(outcome.said);
  CHECK(outcome.code == 0);
  CHECK(outcome.said.find("pairs that the input has not: none") != std::string::npos);
  const Json table = parse_json(file_bytes(json));
  const Json &one = table.at("one.ply"), &two = table.at("two.ply");
  for (const char* name : {"input", "decimate", "deform", "merge"}) {
    INFO(name);
    CHECK(one.at(name).at("cross") == 0);
    CHECK(one.at(name).at("faces") > 0);
  }
  CHECK(!one.contains("smooth-repair"));
  CHECK(two.at("input").at("cross") > 20);
  CHECK(two.at("smooth-repair").at("cross") == 0);
  // What stands there is not run again.
  CHECK(shell(kPanel + (folder / "one.ply").string() + " --tessera /bin/false --json " + json.string() +
              " --only decimate")
            .code == 0);
}

TEST_CASE("panel_crossings: ends with 1 where an operation makes faces cross", "[unit]") {
  const TempFolder folder;
  spill(
      folder / "table.json",
      R"({"a.off": {"input": {"cross": 0, "overlap": 0, "touch": 0, "faces": 4, "cgal": 0, "box": [[0, 0, 0], [1, 1, 1]]},
          "decimate": {"cross": 0, "overlap": 0, "touch": 2, "faces": 4, "cgal": 2}}})");
  const Outcome outcome =
      shell(kPanel + (folder / "a.off").string() + " --tessera /bin/false --only decimate --json " +
            (folder / "table.json").string());
  CHECK(outcome.code == 1);
  CHECK(outcome.said.find("decimate 0/0/2=") != std::string::npos);
  CHECK(outcome.said.find("a.off decimate") != std::string::npos);
}

}  // namespace panel_crossings_test
