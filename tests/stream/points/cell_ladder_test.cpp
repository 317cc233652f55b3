#include "stream/points/cell_ladder.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::cell_ladder_test {
namespace {

/// Bricks of a level plane of side x side blocks that lie `step` blocks apart, `points` in each.
std::vector<BrickCount> plane(const std::filesystem::path& file, int side, std::int64_t step, int points) {
  BrickCounter counter(file);
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < points; ++k) counter.add({i * step, j * step, 3});
  counter.finish();
  return merge_brick_counts({file}, 1u << 20);
}

TEST_CASE("cell ladder: clumps by the blocks that hold points", "[unit]") {
  const test::TempFolder folder;
  const PointClumps clumps = clumps_of_bricks(plane(folder / "a", 60, 100, 7));
  CHECK(clumps.spacing == Approx(800.0).epsilon(0.35));  // cells
  CHECK(clumps.points == Approx(7.0).epsilon(0.2));
  CHECK(clumps_of_bricks(plane(folder / "a", 200, 1, 7)).spacing == 0.0);   // every block of a plane
  CHECK(clumps_of_bricks(plane(folder / "a", 60, 100, 1)).spacing == 0.0);  // lone points
}

TEST_CASE("cell ladder: a resolution measured within clumps is not answered with the next larger one",
          "[fault]") {
  const test::TempFolder folder;
  // Bricks over more than 2^20 cells.
  const std::vector<BrickCount> wide = plane(folder / "a", 100, 4000, 9);
  for (const bool measured : {false, true}) {
    std::string said;
    try {
      scan_window(wide, 1e-5, measured);
    } catch (const InputError& e) {
      said = e.what();
    }
    CAPTURE(said);
    CHECK((said.find("choose --resolution") != std::string::npos) == !measured);
    CHECK((said.find("clumps of about 9") != std::string::npos) == measured);
  }
  CHECK(scan_window(plane(folder / "a", 60, 1, 9), 1.0, true).max[0] == 7);
}

TEST_CASE("cell ladder: the sentence of a job stands in its work directory", "[unit]") {
  const test::TempFolder folder;
  CHECK(clump_sentence(folder.path()).empty());
  save_clumps(folder / kClumpFile, {0.05, 9.7});
  CHECK_THAT(clump_sentence(folder.path()), Catch::Contains("about 10, 0.05 from one") &&
                                                Catch::Contains("--thin 0.025") &&
                                                Catch::Contains("--resolution 0.07"));
  CHECK(clump_sentence(PointClumps{}).empty());
}

}  // namespace
}  // namespace tessera::cell_ladder_test
