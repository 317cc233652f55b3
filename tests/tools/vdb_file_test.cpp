#include "stream/formats/vdb_file.h"

#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace vdb_file_test {

using namespace tessera;

TEST_CASE("vdb: what is written leaf by leaf is what OpenVDB reads", "[unit]") {
  // A ball of 150 cells about a node beyond the first root: several upper nodes, tiles inside, leaves that straddle.
  const double centre = 4096.0, radius = 150.0, band = 3.0;
  const auto distance = [&](const Int3& n) {
    return norm(Double3{n[0] - centre, n[1] - centre, n[2] - centre}) - radius;
  };
  std::vector<LevelSetLeaf> leaves;
  std::vector<Int3> origins;
  for (int x = 3900; x < 4300; x += 8)
    for (int y = 3900; y < 4300; y += 8)
      for (int z = 3900; z < 4300; z += 8) {
        LevelSetLeaf leaf;
        leaf.origin = {x & ~7, y & ~7, z & ~7};
        bool any = false;
        for (int n = 0; n < 512; ++n) {
          const Int3 at = {leaf.origin[0] + (n >> 6), leaf.origin[1] + (n >> 3 & 7),
                           leaf.origin[2] + (n & 7)};
          const double d = distance(at);
          const auto word = static_cast<std::size_t>(n >> 6);
          const std::uint64_t bit = std::uint64_t{1} << (n & 63);
          if (d >= 0.0) leaf.outside[word] |= bit;
          if (std::fabs(d) > band) continue;
          leaf.active[word] |= bit;
          leaf.value[static_cast<std::size_t>(n)] = static_cast<float>(0.5 * d);
          any = true;
        }
        if (!any) continue;
        leaves.push_back(leaf);
        origins.push_back(leaf.origin);
      }
  std::reverse(leaves.begin(), leaves.end()), std::reverse(origins.begin(), origins.end());
  LevelSetFile file;
  file.lattice = {0.5, {3, -2, 1}};
  file.background = 1.5f;
  file.origins = origins;
  file.load = [&](std::size_t i, LevelSetLeaf& to) { to = leaves[i]; };
  file.inside = [&](const Int3& n) { return distance(n) < 0.0; };
  const test::TempFolder folder;
  const auto path = folder / "ball.vdb";
  const std::uint64_t bytes = write_level_set(path, file);
  CHECK(bytes == std::filesystem::file_size(path));

  openvdb::initialize();
  openvdb::io::File in(path.string());
  in.open();
  const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(in.readGrid("distance"));
  in.close();
  REQUIRE(grid);
  CHECK(grid->getGridClass() == openvdb::GRID_LEVEL_SET);
  CHECK(grid->background() == 1.5f);
  CHECK(grid->tree().leafCount() == leaves.size());
  const openvdb::Vec3d at = grid->indexToWorld(openvdb::Coord(2, 3, 4));
  CHECK(at == openvdb::Vec3d(file.lattice.world(0, 2), file.lattice.world(1, 3), file.lattice.world(2, 4)));
  const auto reader = grid->getConstAccessor();
  std::size_t active = 0, wrong = 0;
  for (int x = 3930; x < 4262; x += 2)
    for (int y = 3930; y < 4262; ++y)
      for (int z = 3930; z < 4262; ++z) {
        const double d = distance({x, y, z});
        const bool near = std::fabs(d) <= band;
        float value = 0.0f;
        const bool on = reader.probeValue({x, y, z}, value);
        const float want = near ? static_cast<float>(0.5 * d) : d < 0.0 ? -1.5f : 1.5f;
        wrong += on != near || value != want;
        active += on;
      }
  CHECK(wrong == 0);
  CHECK(active > 500'000);
  CHECK(grid->metaValue<std::int64_t>("file_voxel_count") ==
        static_cast<std::int64_t>(grid->activeVoxelCount()));

  SECTION("the same leaves in another order are the same bytes") {
    std::reverse(leaves.begin(), leaves.end()), std::reverse(origins.begin(), origins.end());
    write_level_set(folder / "again.vdb", file);
    CHECK(test::file_bytes(folder / "again.vdb") == test::file_bytes(path));
  }
}

}  // namespace vdb_file_test
