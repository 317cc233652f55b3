#include "kernels/field/band_vdb.h"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <catch2/catch.hpp>
#include <sstream>

#include "kernels/field/field.h"
#include "tests/helpers/oriented_samples.h"

using namespace tessera;

TEST_CASE("vdb: a grid read back holds the band of both blocks, in scan units", "[unit]") {
  test::Random random(1);
  test::Samples samples;
  test::add_sphere({128, 96, 96}, 20.3, 1 / 1.5, random, samples);
  Lattice lattice;
  lattice.h = 0.25;
  lattice.origin_brick = {1000, -3, 0};
  VdbExport vdb(lattice);
  std::size_t nodes = 0;
  const Int3 origins[] = {{64, 64, 64}, {128, 64, 64}};
  for (const Int3& origin : origins) {
    const auto field =
        evaluate_field(test::make_block(samples, origin, {64, 64, 64}, field_halo_cells({})), {});
    for (const BandLeaf& leaf : field.leaves)
      for (const auto word : leaf.valid) nodes += static_cast<std::size_t>(std::popcount(word));
    vdb.add(field);
  }
  CHECK(vdb.node_count() > 10000);
  CHECK(vdb.node_count() < nodes);  // both blocks hold the nodes along their common face
  std::stringstream file;
  vdb.write(file);
  REQUIRE(file.good());

  std::istream& in = file;
  openvdb::io::Stream stream(in);
  const auto grids = stream.getGrids();
  REQUIRE(grids->size() == 1);
  const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(grids->front());
  CHECK(grid->activeVoxelCount() == vdb.node_count());
  for (auto it = grid->cbeginValueOn(); it; ++it) {
    const auto p = it.getCoord();
    const double x = p.x() - 128.0, y = p.y() - 96.0, z = p.z() - 96.0;
    REQUIRE(std::abs(static_cast<double>(*it) - 0.25 * (std::sqrt(x * x + y * y + z * z) - 20.3)) < 0.02);
  }
  const auto world = grid->indexToWorld(openvdb::Coord(4, 0, 0));
  CHECK(world.x() == 64000 * 0.25 + 1.0);
  CHECK(world.y() == -192 * 0.25);
}
