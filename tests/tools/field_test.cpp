// tessera field as a user runs it, and OpenVDB as who reads what it wrote.
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "kernels/solid/distance_octree.h"
#include "octree/vector.h"
#include "stream/files/json.h"
#include "stream/formats/octree_file.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace field_test {

namespace {

using namespace tessera;
using namespace tessera::test;

CommandResult run(std::vector<std::string> words) {
  words.insert(words.end(), {"--no-html", "--progress", "none"});
  return tessera_command(words);
}

openvdb::FloatGrid::Ptr read(const std::filesystem::path& path) {
  openvdb::initialize();
  openvdb::io::File file(path.string());
  file.open();
  return openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("distance"));
}

/// Off the lattice, and no side as another.
const Double3 kHalf = {0.997, 1.003, 1.007};
std::string write_box(const TempFolder& folder) {
  return folder
      .write("box.obj",
             "v -0.997 -1.003 -1.007\nv 0.997 -1.003 -1.007\nv 0.997 1.003 -1.007\nv -0.997 1.003 -1.007\n"
             "v -0.997 -1.003 1.007\nv 0.997 -1.003 1.007\nv 0.997 1.003 1.007\nv -0.997 1.003 1.007\n"
             "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n")
      .string();
}
double distance_to_box(const Double3& p) {
  Double3 beyond{};
  double deepest = -10.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double excess = std::fabs(p[k]) - kHalf[k];
    beyond[k] = std::max(0.0, excess);
    deepest = std::max(deepest, excess);
  }
  return deepest > 0.0 ? norm(beyond) : deepest;
}
Double3 world_position(const openvdb::FloatGrid& grid, const openvdb::Coord& at) {
  const openvdb::Vec3d p = grid.indexToWorld(at);
  return {p[0], p[1], p[2]};
}

struct OctreeFile {
  OctreeFileHeader header;
  std::vector<DistanceOctree> cubes;
};
OctreeFile read_octrees(const std::string& bytes) {
  OctreeFile file;
  std::size_t at = 0;
  const auto take = [&](void* to, std::size_t size) {
    REQUIRE(at + size <= bytes.size());
    std::memcpy(to, bytes.data() + at, size);
    at += size;
  };
  take(&file.header, sizeof file.header);
  REQUIRE(file.header.magic == OctreeFileHeader{}.magic);
  while (at < bytes.size()) {
    OctreeRecord record;
    take(&record, sizeof record);
    std::vector<std::uint64_t> halved((record.nodes + 63) / 64);
    std::vector<std::array<float, 8>> cells(record.cells);
    take(halved.data(), halved.size() * 8);
    take(cells.data(), cells.size() * 32);
    file.cubes.emplace_back(record.corner, record.edge, std::move(halved), record.nodes, std::move(cells));
  }
  return file;
}

}  // namespace

TEST_CASE("field: OpenVDB finds the distances of a box, signs to the depth of it", "[pipeline]") {
  const TempFolder folder;
  const std::string box = write_box(folder);
  const std::string out = (folder / "o.vdb").string();
  const CommandResult made = run({"field", box, "-o", out, "--resolution", "0.02", "--band", "4"});
  CAPTURE(made.errors);
  REQUIRE(made.code == 0);
  const auto grid = read(out);
  REQUIRE(grid);
  CHECK(grid->getGridClass() == openvdb::GRID_LEVEL_SET);
  CHECK(grid->background() == Approx(0.08));
  double worst = 0.0;
  std::size_t nodes = 0;
  for (auto at = grid->cbeginValueOn(); at; ++at) {
    const double truth = distance_to_box(world_position(*grid, at.getCoord()));
    worst = std::max(worst, std::fabs(truth - double{*at}));
    ++nodes;
  }
  CHECK(nodes > 400'000);
  CHECK(worst < 0.02 * 0.02);  // of the lattice
  const auto value = [&](double x, double y, double z) {
    return grid->getConstAccessor().getValue(
        openvdb::Coord::round(grid->worldToIndex(openvdb::Vec3d(x, y, z))));
  };
  CHECK(value(0, 0, 0) == -grid->background());
  CHECK(value(0.5, -0.3, 0.8) == -grid->background());
  CHECK(value(0, 0, 1.5) == grid->background());
  CHECK(value(40, 0, 0) == grid->background());

  SECTION("the same bytes whatever runs, and after being killed") {
    const std::string bytes = file_bytes(out), again = (folder / "a.vdb").string();
    REQUIRE(run({"field", box, "-o", again, "--resolution", "0.02", "--band", "4", "-t", "1", "--tile-size",
                 "64", "--memory", "200M"})
                .code == 0);
    CHECK(file_bytes(again) == bytes);
    const std::string part = (folder / "p.vdb").string();
    REQUIRE(resumed_after_kills({"field", box, "-o", part, "--resolution", "0.02", "--band", "4", "--no-html",
                                 "--progress", "none"})
                .code == 0);
    CHECK(file_bytes(part) == bytes);
  }
  CHECK(run({"field", box, "-o", (folder / "o.ply").string()}).code == 2);
  CHECK(run({"field", (folder / "none.ply").string(), "-o", (folder / "x.vdb").string()}).code == 3);
}

TEST_CASE("field: a full one has the distance of every node of the box", "[pipeline]") {
  const TempFolder folder;
  const std::string box = write_box(folder), out = (folder / "o.vdb").string();
  const CommandResult made = run({"field", box, "-o", out, "--resolution", "0.05", "--full"});
  CAPTURE(made.errors);
  REQUIRE(made.code == 0);
  const auto grid = read(out);
  double worst = 0.0, farthest = 0.0;
  openvdb::CoordBBox box_of_nodes = grid->evalActiveVoxelBoundingBox();
  for (auto at = grid->cbeginValueOn(); at; ++at) {
    const double truth = distance_to_box(world_position(*grid, at.getCoord()));
    worst = std::max(worst, std::fabs(truth - double{*at}));
    farthest = std::max(farthest, truth);
  }
  CHECK(grid->activeVoxelCount() == box_of_nodes.volume());
  CHECK(worst < 0.02 * 0.05);
  CHECK(grid->background() == Approx(farthest).margin(0.02 * 0.05));
  CHECK(farthest > 10 * 0.05);
  const std::string bytes = file_bytes(out), again = (folder / "a.vdb").string();
  REQUIRE(run({"field", box, "-o", again, "--resolution", "0.05", "--full", "-t", "1", "--memory", "150M"})
              .code == 0);
  CHECK(file_bytes(again) == bytes);
}

TEST_CASE("field: an octree is within its tolerance at samples, and far smaller than a grid", "[pipeline]") {
  const TempFolder folder;
  const std::string box = write_box(folder), out = (folder / "o.octree").string();
  const double h = 0.02;
  std::uint64_t last = 0;
  for (const double tolerance : {0.16, 0.04}) {
    CAPTURE(tolerance);
    const std::vector<std::string> words = {
        "field", box, "-o", out, "--resolution", "0.02", "--tolerance", std::to_string(tolerance), "--force"};
    const CommandResult made = run(words);
    CAPTURE(made.errors);
    REQUIRE(made.code == 0);
    const OctreeFile file = read_octrees(file_bytes(out));
    CHECK(file.header.h == h);
    CHECK(file.header.tolerance == Approx(tolerance));
    Random random(4);
    double worst = 0.0, squares = 0.0;
    std::uint64_t cells = 0;
    std::size_t samples = 0;
    for (const DistanceOctree& cube : file.cubes) {
      cells += cube.cells().size();
      for (int i = 0; i < 2000; ++i, ++samples) {
        Double3 node, p;
        for (std::size_t k = 0; k < 3; ++k) {
          node[k] = cube.corner()[k] + cube.edge() * random.unit();
          p[k] = file.header.origin[k] + node[k] * h;
        }
        const double error = std::fabs(cube.at(node) * h - distance_to_box(p));
        worst = std::max(worst, error);
        squares += error * error;
      }
    }
    CHECK(worst <= tolerance);
    CHECK(worst > 0.1 * tolerance);
    const Json field = parse_json(file_bytes(out + ".report.json")).at("field");
    CHECK(field.at("cells") == cells);
    CHECK(field.at("bytes") == file_bytes(out).size());
    CHECK(field.at("worst_error").get<double>() <= tolerance);
    CHECK(field.at("rms_error").get<double>() ==
          Approx(std::sqrt(squares / static_cast<double>(samples))).epsilon(0.2));
    CHECK(field.at("bytes").get<std::uint64_t>() * 8 < field.at("full_grid_bytes").get<std::uint64_t>());
    CHECK(cells > 4 * last);
    last = cells;
  }
  const std::string bytes = file_bytes(out), again = (folder / "a.octree").string();
  REQUIRE(run({"field", box, "-o", again, "--resolution", "0.02", "--tolerance", "0.04", "-t", "1",
               "--memory", "150M", "--tile-size", "64"})
              .code == 0);
  CHECK(file_bytes(again) == bytes);
  const auto code_of = [&](const std::string& name, std::vector<std::string> more) {
    more.insert(more.begin(), {"field", box, "-o", (folder / name).string()});
    return run(more).code;
  };
  CHECK(code_of("x.vdb", {"--tolerance", "0.04"}) == 2);
  CHECK(code_of("x.octree", {}) == 2);
  CHECK(code_of("x.octree", {"--tolerance", "0.04", "--full"}) == 2);
  CHECK(code_of("x.octree", {"--tolerance", "0.01", "--resolution", "0.02"}) == 2);  // finer than the lattice
}

}  // namespace field_test
