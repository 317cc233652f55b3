// Formats for printers, solvers and modellers, as commands write and read them; second readers where a machine has them.
#include <catch2/catch.hpp>

#include <algorithm>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/helpers/command.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace models_test {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

/// Corners of all faces in their order, whatever the vertices are called.
std::vector<Double3> corners(const WholeMesh& mesh) {
  std::vector<Double3> all;
  for (const MeshFace& f : mesh.faces)
    for (const std::uint64_t v : f) all.push_back(mesh.points[v]);
  return all;
}

fs::path made(const TempFolder& folder, const char* name, WholeMesh mesh) {
  write_whole(folder / name, counted(std::move(mesh)));
  return folder / name;
}

}  // namespace

TEST_CASE("models command: every format comes back as it went", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = made(folder, "body.ply", made_body(4));
  const std::vector<Double3> want = corners(read_whole(mesh));
  for (const std::string to : {"3mf", "vtu", "msh"}) {
    const std::string there = (folder / ("there." + to)).string(), back = (folder / (to + ".ply")).string();
    const CommandResult r = tessera_command({"convert", mesh.string(), "-o", there});
    INFO(to << r.errors);
    REQUIRE(r.code == 0);
    CHECK((r.errors.find("millimetres") != std::string::npos) == (to == "3mf"));
    CHECK(r.errors.find("is open") == std::string::npos);
    REQUIRE(tessera_command({"convert", there, "-o", back}).code == 0);
    CHECK((corners(read_whole(back)) == want));
    REQUIRE(tessera_command({"check", there, "--strict"}).code == 0);
  }
}

TEST_CASE("models command: a job writes them, with a page, and the same bytes on any threads and cap",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = made(folder, "body.ply", made_open_body(5));
  for (const std::string to : {"3mf", "vtu", "msh"}) {
    const fs::path one = folder / ("one." + to), two = folder / ("two." + to);
    const CommandResult r = tessera_command({"decimate", mesh.string(), "-o", one.string(), "--tolerance",
                                             "0.01", "--threads", "1", "--memory", "1G"});
    INFO(to << r.errors);
    REQUIRE(r.code == 0);
    CHECK((r.errors.find("this mesh is open") != std::string::npos) == (to == "3mf"));
    REQUIRE(tessera_command({"decimate", mesh.string(), "-o", two.string(), "--tolerance", "0.01",
                             "--threads", "2", "--memory", "300M"})
                .code == 0);
    CHECK((file_bytes(one) == file_bytes(two)));
    REQUIRE(
        tessera_command({"check", one.string(), "--reference", mesh.string(), "--tolerance", "0.01"}).code ==
        0);
    // What is written can be worked on.
    REQUIRE(tessera_command({"smooth", one.string(), "-o", (folder / (to + ".ply")).string()}).code == 0);
  }
  REQUIRE(shell(std::string(TESSERA_BINARY) + " decimate " + mesh.string() + " -o " +
                (folder / "page.3mf").string() + " --tolerance 0.01 -q")
              .code == 0);
  CHECK(file_bytes(folder / "page.3mf.report.html").find("is not a mesh") == std::string::npos);
}

TEST_CASE("models command: 3MF tells its unit", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = made(folder, "part.ply", made_bracket(2));
  const auto unit_of = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {"convert", mesh.string(), "-o", (folder / "a.3mf").string(), "--force"});
    const CommandResult r = tessera_command(words);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    CHECK(r.errors.empty() == (words.size() > 5));
    return read_whole(folder / "a.3mf").header.unit;
  };
  CHECK(unit_of({}) == 1e-3);
  CHECK(unit_of({"--unit", "inch"}) == 0.0254);
  CHECK(unit_of({"--unit", "metre"}) == 1.0);
  // It goes from 3MF to 3MF.
  REQUIRE(tessera_command({"convert", (folder / "a.3mf").string(), "-o", (folder / "b.3mf").string()}).code ==
          0);
  CHECK(read_whole(folder / "b.3mf").header.unit == 1.0);
  CHECK(
      tessera_command({"convert", mesh.string(), "-o", (folder / "a.msh").string(), "--unit", "inch"}).code ==
      2);
  CHECK(
      tessera_command({"convert", mesh.string(), "-o", (folder / "a.xml").string(), "--unit", "inch"}).code ==
      2);
}

TEST_CASE("models command: OBJ has a group for each component", "[pipeline]") {
  const TempFolder folder;
  // Faces of the two parts take turns.
  WholeMesh both = joined(made_bracket(2), made_bracket(3), {10, 0, 0});
  std::vector<MeshFace> mixed;
  const std::size_t half = made_bracket(2).faces.size();
  for (std::size_t i = 0; i < both.faces.size(); ++i) {
    if (i < half) mixed.push_back(both.faces[i]);
    if (half + i < both.faces.size()) mixed.push_back(both.faces[half + i]);
  }
  both.faces = mixed;
  const fs::path mesh = made(folder, "both.ply", both), out = folder / "both.obj";
  const CommandResult r =
      tessera_command({"convert", mesh.string(), "-o", out.string(), "--groups", "components"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  std::istringstream lines(file_bytes(out));
  std::vector<std::string> names;
  std::vector<std::size_t> faces;
  std::vector<std::set<bool>> sides;
  std::vector<double> x;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string keyword;
    words >> keyword;
    if (keyword == "v") words >> x.emplace_back();
    if (keyword == "g") names.emplace_back(line.substr(2)), faces.push_back(0), sides.emplace_back();
    if (keyword != "f") continue;
    REQUIRE(!names.empty());
    ++faces.back();
    std::size_t v = 0;
    while (words >> v) sides.back().insert(x[v - 1] > 5.0);
  }
  CHECK(names == std::vector<std::string>{"component_1", "component_2"});
  CHECK(faces == std::vector<std::size_t>{half, both.faces.size() - half});
  CHECK(sides == std::vector<std::set<bool>>{{false}, {true}});
  CHECK(
      tessera_command({"convert", mesh.string(), "-o", (folder / "a.ply").string(), "--groups", "components"})
          .code == 2);
  // Without it faces stay where they were, and no line says otherwise.
  REQUIRE(tessera_command({"convert", mesh.string(), "-o", (folder / "plain.obj").string()}).code == 0);
  CHECK(file_bytes(folder / "plain.obj").find("\ng ") == std::string::npos);
  CHECK(read_whole(folder / "plain.obj").faces == both.faces);
}

TEST_CASE("models command: Gmsh reads MSH", "[pipeline]") {
  const TempFolder folder;
  if (shell("gmsh --version").code != 0) return skip("there is no gmsh");
  const fs::path mesh = made(folder, "part.ply", made_bracket(4)), out = folder / "part.msh";
  REQUIRE(tessera_command({"convert", mesh.string(), "-o", out.string()}).code == 0);
  // As Gmsh writes what it has read, in a form that is read here: the faces are the same.
  const fs::path again = folder / "again.msh";
  const Outcome gmsh = shell("gmsh -0 " + out.string() + " -format msh41 -bin -o " + again.string());
  INFO(gmsh.said);
  REQUIRE(gmsh.code == 0);
  const WholeMesh want = read_whole(mesh), got = read_whole(again);
  CHECK((corners(got) == corners(want)));
}

TEST_CASE("models command: meshio reads VTU and MSH", "[pipeline]") {
  const TempFolder folder;
  if (shell("python3 -c 'import meshio'").code != 0) return skip("there is no python3-meshio");
  const fs::path mesh = made(folder, "part.ply", made_bracket(4));
  const WholeMesh want = read_whole(mesh);
  for (const std::string to : {"vtu", "msh"}) {
    const std::string out = (folder / ("part." + to)).string();
    REQUIRE(tessera_command({"convert", mesh.string(), "-o", out}).code == 0);
    const Outcome meshio =
        shell("python3 -c \"import meshio; m = meshio.read('" + out +
              "'); print(len(m.points), [(c.type, len(c.data)) for c in m.cells], m.points.sum())\"");
    INFO(meshio.said);
    REQUIRE(meshio.code == 0);
    CHECK_THAT(meshio.said, Catch::Contains(std::to_string(want.points.size()) + " [('triangle', " +
                                            std::to_string(want.faces.size()) + ")]"));
  }
}

TEST_CASE("models command: Assimp reads 3MF", "[pipeline]") {
  const TempFolder folder;
  if (shell("assimp version").code != 0) return skip("there is no assimp (assimp-utils)");
  const fs::path mesh = made(folder, "part.ply", made_bracket(4)), out = folder / "part.3mf";
  REQUIRE(tessera_command({"convert", mesh.string(), "-o", out.string(), "--unit", "millimetre"}).code == 0);
  const Outcome info = shell("assimp info " + out.string());
  INFO(info.said);
  REQUIRE(info.code == 0);
  CHECK_THAT(info.said,
             Catch::Contains("Faces:              " + std::to_string(read_whole(mesh).faces.size())));
}

}  // namespace models_test
