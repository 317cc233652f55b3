// tessera field as a user runs it, and OpenVDB as who reads what it wrote.
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/vector.h"
#include "tests/helpers/command.h"
#include "tests/helpers/temp_folder.h"

namespace {

using namespace tessera;
using namespace tessera::test;

CommandResult run(std::vector<std::string> words, unsigned kill_after_ms = 0) {
  words.insert(words.end(), {"--no-html", "--progress", "none"});
  return tessera_command(words, kill_after_ms);
}

openvdb::FloatGrid::Ptr read(const std::filesystem::path& path) {
  openvdb::initialize();
  openvdb::io::File file(path.string());
  file.open();
  return openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("distance"));
}

}  // namespace

TEST_CASE("field: OpenVDB finds the distances of a box, signs to the depth of it", "[pipeline]") {
  const TempFolder folder;
  const std::string box =
      folder
          .write(
              "box.obj",  // off the lattice, and no side as another
              "v -0.997 -1.003 -1.007\nv 0.997 -1.003 -1.007\nv 0.997 1.003 -1.007\nv -0.997 1.003 -1.007\n"
              "v -0.997 -1.003 1.007\nv 0.997 -1.003 1.007\nv 0.997 1.003 1.007\nv -0.997 1.003 1.007\n"
              "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n")
          .string();
  const Double3 kHalf = {0.997, 1.003, 1.007};
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
    const openvdb::Vec3d p = grid->indexToWorld(at.getCoord());
    Double3 beyond{};
    double deepest = -10.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double over = std::fabs(p[static_cast<int>(k)]) - kHalf[k];
      beyond[k] = std::max(0.0, over);
      deepest = std::max(deepest, over);
    }
    const double truth = deepest > 0.0 ? norm(beyond) : deepest;
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
    unsigned killed = 0;
    for (const unsigned ms : {30u, 100u, 250u})
      killed +=
          run({"field", box, "-o", part, "--resolution", "0.02", "--band", "4"}, ms).code == 128 + SIGKILL;
    CHECK(killed > 0);
    if (!std::filesystem::exists(part))
      REQUIRE(run({"field", box, "-o", part, "--resolution", "0.02", "--band", "4"}).code == 0);
    CHECK(file_bytes(part) == bytes);
  }
  CHECK(run({"field", box, "-o", (folder / "o.ply").string()}).code == 2);
  CHECK(run({"field", (folder / "none.ply").string(), "-o", (folder / "x.vdb").string()}).code == 3);
}
