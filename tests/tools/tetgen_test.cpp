// Debian's tetgen fills what resurface and remesh make: nothing crosses, nothing is open, and all of the inside is met.
#include <catch2/catch.hpp>

#include <fstream>

#include "tests/helpers/made_meshes.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/solid_command.h"
#include "tests/helpers/solids.h"

namespace tetgen_test {

namespace {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

void write_off(const fs::path& path, const WholeMesh& mesh) {
  std::ofstream out(path);
  out.precision(17);
  out << "OFF\n" << mesh.points.size() << " " << mesh.faces.size() << " 0\n";
  for (const Double3& p : mesh.points) out << p[0] << " " << p[1] << " " << p[2] << "\n";
  for (const MeshFace& f : mesh.faces) out << "3 " << f[0] << " " << f[1] << " " << f[2] << "\n";
}

/// Sum of the tetrahedra that tetgen wrote beside `stem`; 0 where it wrote none.
double tetrahedra_volume(const fs::path& stem) {
  std::ifstream nodes(stem.string() + ".1.node"), cells(stem.string() + ".1.ele");
  std::size_t count = 0, dimension = 0, ignored = 0;
  nodes >> count >> dimension >> ignored >> ignored;
  std::vector<Double3> point(count);
  std::size_t first = 0;
  for (std::size_t i = 0; i < count; ++i) {
    std::size_t name = 0;
    nodes >> name >> point[i][0] >> point[i][1] >> point[i][2];
    if (i == 0) first = name;
  }
  cells >> count >> ignored >> ignored;
  double sum = 0.0;
  for (std::size_t i = 0; i < count && cells; ++i) {
    std::size_t name = 0, v[4] = {};
    cells >> name >> v[0] >> v[1] >> v[2] >> v[3];
    const auto at = [&](std::size_t k) { return point.at(v[k] - first); };
    sum += std::abs(dot(at(1) - at(0), cross(at(2) - at(0), at(3) - at(0)))) / 6.0;
  }
  return sum;
}

/// What tetgen makes of a mesh, its surface as it is (-Y).
void check_filled(const TempFolder& folder, const fs::path& mesh_file) {
  const WholeMesh mesh = read_whole(mesh_file);
  CHECK(is_closed(mesh));
  const fs::path stem = folder / "filled";
  write_off(stem.string() + ".off", mesh);
  const Outcome outcome = shell("timeout 120 tetgen -pYQ " + stem.string() + ".off");
  INFO(outcome.said);
  CHECK(outcome.code == 0);
  CHECK(tetrahedra_volume(stem) == Approx(volume(mesh)).epsilon(1e-6));
  for (const char* kind : {"node", "ele", "face", "edge", "smesh"}) fs::remove(stem.string() + ".1." + kind);
}

bool has_tetgen() {
  if (shell("command -v tetgen").code == 0) return true;
  skip("needs tetgen: apt install tetgen");
  return false;
}

}  // namespace

TEST_CASE("tetgen: fills what resurface and remesh make of bodies, parts and soups", "[pipeline]") {
  if (!has_tetgen()) return;
  const TempFolder folder;
  std::map<std::string, WholeMesh> inputs = {
      {"body", made_body(4)},
      {"open body", made_open_body(4)},
      {"part", made_part({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {1, 1, 1}}, 3)}};
  // Two bodies that cross, as one file.
  WholeMesh crossing = made_body(3, 2);
  const WholeMesh other = made_body(3, 3);
  const std::size_t first = crossing.points.size();
  for (const Double3& p : other.points) crossing.points.push_back(p + Double3{0.7, 0.2, 0.1});
  for (const MeshFace& f : other.faces) crossing.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
  inputs.emplace("crossing", counted(crossing));
  for (const auto& [name, mesh] : inputs) {
    INFO(name);
    const std::string in = (folder / "in.ply").string(), closed = (folder / "closed.ply").string(),
                      even = (folder / "even.ply").string();
    fs::remove(in);
    write_whole(in, mesh);
    REQUIRE(solid_command({"resurface", in, "-o", closed, "--resolution", "0.05", "--force"}).code == 0);
    check_filled(folder, closed);
    REQUIRE(solid_command({"remesh", closed, "-o", even, "--faces", "4000", "--force"}).code == 0);
    check_filled(folder, even);
  }
}

}  // namespace tetgen_test
