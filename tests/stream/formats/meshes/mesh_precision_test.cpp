// Meshes far from zero in formats of 32-bit floats: where they count from, what rounding moves, and what it breaks.
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <fstream>
#include <iterator>
#include <string>

#include "octree/error.h"
#include "octree/vector.h"
#include "stream/runtime/numbers.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::mesh_precision_test {
namespace {

using test::read_whole;
using test::WholeMesh;

const Double3 kFar = {691607.137, 5334760.481, 512.3};

/// A sheet of squares with this edge, its corner at `at`, bumpy.
WholeMesh sheet(const Double3& at, double edge, int side) {
  WholeMesh mesh;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i)
      mesh.points.push_back({at[0] + i * edge, at[1] + j * edge, at[2] + 0.1 * edge * ((i * 7 + j * 3) % 5)});
  const auto number = [&](int i, int j) { return static_cast<std::uint64_t>(j * (side + 1) + i); };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      mesh.faces.push_back({number(i, j), number(i + 1, j), number(i + 1, j + 1)});
      mesh.faces.push_back({number(i, j), number(i + 1, j + 1), number(i, j + 1)});
    }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  mesh.header.double_positions = true;
  return mesh;
}

MeshPlacement placement(const std::filesystem::path& path, const WholeMesh& mesh, double tolerance = 0.0) {
  Double3 low = mesh.points[0], high = low;
  for (const Double3& p : mesh.points)
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  return place_mesh(path, mesh.header.double_positions, low, high,
                    fine_rounding(mesh.faces.size(), low, high, tolerance));
}

TEST_CASE("mesh precision: a local origin only where floats are too coarse without", "[unit]") {
  const WholeMesh far = sheet(kFar, 0.12, 100), near = sheet({100, 0, -3}, 0.12, 100);
  const MeshPlacement stl = placement("a.stl", far);
  CHECK(stl.origin == Double3{691610, 5334770, 510});
  CHECK(stl.rounding < 2e-6);
  CHECK(stl.rounding > 0.0);
  CHECK(placement("a.GLB", far).origin == stl.origin);
  for (const char* other : {"a.ply", "a.obj"}) {
    CHECK(placement(other, far).origin == Double3{0, 0, 0});
    CHECK(placement(other, far).rounding == 0.0);
  }
  // Near zero STL stays where it is; a tolerance that asks for more than that moves it.
  CHECK(placement("a.stl", near).origin == Double3{0, 0, 0});
  CHECK(placement("a.stl", near).rounding < 8e-6);
  WholeMesh part = sheet({5000, 0, 0}, 1.0, 100);
  CHECK(placement("a.stl", part).origin == Double3{0, 0, 0});
  CHECK(placement("a.stl", part, 0.01).origin == Double3{5100, 0, 0});
  part.header.double_positions = false;  // floats already
  CHECK(placement("a.stl", part, 0.01).rounding == 0.0);
}

TEST_CASE("mesh precision: no position moves farther than was said", "[property]") {
  const test::TempFolder folder;
  test::Random random(5);
  for (int round = 0; round < 60; ++round) {
    const double size = std::ldexp(1.0, static_cast<int>(random.below(60)) - 30);
    const double far = size * std::ldexp(1.0, static_cast<int>(random.below(24)));
    WholeMesh mesh = sheet({far * random.in(-1, 1), far * random.in(-1, 1), far * random.in(-1, 1)}, size, 6);
    for (Double3& p : mesh.points)
      for (double& c : p) c += size * random.in(-0.1, 0.1);
    for (const char* name : {"a.stl", "a.glb"}) {
      const auto path = folder.path() / name;
      const MeshPlacement placed = placement(path, mesh);
      mesh.header.origin = placed.origin;
      CAPTURE(round, name, size, far);
      test::write_whole(path, mesh);
      const WholeMesh back = read_whole(path);
      double farthest = 0.0;
      for (std::size_t f = 0; f < mesh.faces.size(); ++f)
        for (std::size_t k = 0; k < 3; ++k)
          farthest = std::max(farthest, norm(back.points[back.faces[f][k]] - mesh.points[mesh.faces[f][k]]));
      CHECK(farthest <= placed.rounding);
      CHECK(farthest >= placed.rounding / 50);
    }
  }
}

TEST_CASE("mesh precision: a tolerance that rounding would eat is refused before any work", "[unit]") {
  const WholeMesh wide = sheet(kFar, 1000.0, 100);  // 100 km
  const MeshPlacement placed = placement("a.stl", wide, 0.01);
  CHECK(placed.rounding > 1e-3);
  CHECK(tolerance_before_rounding("a.stl", 1.0, placed) + placed.rounding <= 1.0);
  CHECK(tolerance_before_rounding("a.stl", 0.01, {}) == 0.01);
  CHECK_THROWS_WITH(tolerance_before_rounding("a.stl", 0.004, placed),
                    Catch::Contains("STL holds floats of 32 bits") && Catch::Contains("write .ply or .obj"));
  CHECK_THROWS_AS(tolerance_before_rounding("a.stl", 0.004, placed), ValidationError);
}

TEST_CASE("mesh precision: GLB is written y-up from a translated node, in doubles", "[unit]") {
  const test::TempFolder folder;
  WholeMesh mesh = sheet(kFar, 0.1, 4);
  mesh.header.origin = {691607, 5334760, 512};
  const auto path = folder.path() / "a.glb";
  test::write_whole(path, mesh);
  std::ifstream in(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const auto document = tessera::parse_json(bytes.substr(20, bytes.find("BIN") - 24));
  CHECK(document.at("nodes").at(0).at("translation") == tessera::Json({691607.0, 512.0, -5334760.0}));
  // The box of the accessor: x, z up, -y.
  const auto low = document.at("accessors").at(0).at("min"), high = document.at("accessors").at(0).at("max");
  CHECK(low[0].get<double>() == Approx(0.137).margin(1e-4));
  CHECK(low[1].get<double>() == Approx(0.3).margin(1e-4));
  CHECK(high[2].get<double>() == Approx(-0.481).margin(1e-4));
  CHECK(read_whole(path).header.double_positions);
  mesh.header.origin = {0, 0, 0};
  for (Double3& p : mesh.points) p = p - kFar;
  test::write_whole(path, mesh);
  CHECK_FALSE(read_whole(path).header.double_positions);  // no translation, so floats
}

TEST_CASE("mesh precision: the 80 bytes of an STL tell what its coordinates count from", "[unit]") {
  const test::TempFolder folder;
  WholeMesh mesh = sheet(kFar, 0.1, 4);
  mesh.header.origin = {691600, 5334700, 500};
  mesh.header.comments = {"a comment that is much longer than the eighty bytes of the header of an STL have"};
  mesh.header.shift = {1.5, 2, 3};
  const auto path = folder.path() / "a.stl";
  test::write_whole(path, mesh);
  const WholeMesh back = read_whole(path);
  CHECK(norm(back.points[0] - mesh.points[0]) < 1e-5);
  CHECK(back.header.shift == mesh.header.shift);
  // A number that was cut off is none.
  mesh.header.origin = {0, 0, 0};
  mesh.header.shift = {1234567.123456789, 1234567.123456789, 1234567.123456789};
  mesh.header.comments = {};
  test::write_whole(path, mesh);
  const Double3 shift = read_whole(path).header.shift;
  CHECK((shift == mesh.header.shift || shift == Double3{0, 0, 0}));
}

TEST_CASE("mesh precision: what rounding breaks is counted, and much of it refused", "[unit]") {
  const test::TempFolder folder;
  const std::string name = GENERATE("a.stl", "a.glb", "a.ply", "a.obj");
  CAPTURE(name);
  const auto path = folder.path() / name;
  WholeMesh mesh = sheet({0, 0, 0}, 1.0, 50);
  mesh.header.double_positions = name == "a.stl" || name == "a.glb";
  mesh.header.check_rounding = true;
  // One sliver that floats flatten, and one vertex that they put onto another.
  mesh.points.insert(mesh.points.end(), {{1000, 0, 0}, {1000 + 1e-9, 0, 0}, {1000, 5, 0}});
  mesh.faces.push_back({2601, 2602, 2603});
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  {
    const auto writer = create_mesh_file(path, mesh.header);
    writer->vertices(mesh.points, {});
    writer->faces(mesh.faces);
    writer->finish();
    CHECK(writer->rounding().merged_vertices == 1);
    CHECK(writer->rounding().flattened_faces == 1);
    CHECK(writer->rounding().largest > 0.0);
    CHECK(writer->rounding().joined_vertices == 0);
    CHECK(rounding_notices(writer->rounding()).size() == 2);
  }
  // STL knows places, not vertices: that two of a sound mesh lie at one is told.
  WholeMesh doubled = sheet({0, 0, 0}, 1.0, 3);
  doubled.header.double_positions = mesh.header.double_positions;
  doubled.points.insert(doubled.points.end(), {doubled.points[5], {50, 0, 0}, {50, 5, 0}});
  doubled.faces.push_back({16, 17, 18});
  doubled.header.vertices = doubled.points.size();
  doubled.header.faces = doubled.faces.size();
  {
    const auto writer = create_mesh_file(path, doubled.header);
    writer->vertices(doubled.points, {});
    writer->faces(doubled.faces);
    writer->finish();
    CHECK(writer->rounding().joined_vertices == (name == "a.stl" ? 1 : 0));
    CHECK(rounding_notices(writer->rounding()).size() == (name == "a.stl" ? 1 : 0));
  }
  std::filesystem::remove(path);
  for (Double3& p : mesh.points)
    p = Double3{0.1 * p[0], 0.1 * p[1], 0} + kFar;  // level: a row of squares has one y
  CHECK_THROWS_AS(test::write_whole(path, mesh), ValidationError);
  CHECK_THROWS_WITH(test::write_whole(path, mesh), Catch::Contains("faces without area"));
  CHECK(std::filesystem::is_empty(folder.path()));
}

TEST_CASE("bound text: never below the bound, and no wider than its digits", "[property]") {
  CHECK(bound_text(0.00980049) == "0.009801");
  CHECK(bound_text(0.0098) == "0.0098");
  CHECK(bound_text(0.5) == "0.5");
  test::Random random(7);
  for (int i = 0; i < 20000; ++i) {
    const double value = std::ldexp(random.in(0.5, 1.0), static_cast<int>(random.below(120)) - 60);
    const int digits = 3 + static_cast<int>(random.below(4));
    const double shown = std::stod(bound_text(value, digits));
    CAPTURE(value, digits, shown);
    REQUIRE(shown >= value);
    REQUIRE(shown <= value * (1.0 + 1.6 * std::pow(10.0, 1 - digits)));
  }
}

}  // namespace
}  // namespace tessera::mesh_precision_test
