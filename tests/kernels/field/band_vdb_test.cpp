#include "kernels/field/band_vdb.h"

#include "kernels/field/vdb_leaf.h"
//
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <catch2/catch.hpp>
#include <sstream>

#include "kernels/field/field.h"
#include "tests/helpers/oriented_samples.h"

namespace band_vdb_test {

using namespace tessera;

TEST_CASE("vdb: nodes and words of a band leaf are those of its OpenVDB leaf", "[unit]") {
  test::Random random(3);
  BandLeaf leaf({64, 128, 64}, {-8, 16, 8});
  CHECK(leaf.vdb().origin() == openvdb::Coord(56, 144, 72));
  CHECK(leaf.vdb().isEmpty());
  LeafWords nodes;
  for (std::uint64_t& word : nodes) word = random.bits() << 11 ^ random.bits();
  leaf.set_valid(nodes);
  CHECK(leaf.valid() == nodes);
  for (std::size_t n = 0; n < 512; ++n) {
    CHECK(leaf.value(n) == kBandBackground);
    leaf.value(n) = static_cast<float>(n);
  }
  for (int k = 0; k < 8; ++k)
    for (int j = 0; j < 8; ++j)
      for (int i = 0; i < 8; ++i) {
        const std::size_t n = BandLeaf::node(i - 8, j + 16, k + 8);
        const openvdb::Coord at = leaf.vdb().origin() + openvdb::Coord(i, j, k);
        REQUIRE(n == static_cast<std::size_t>(i + 8 * j + 64 * k));
        REQUIRE(leaf.vdb().getValue(at) == static_cast<float>(n));
        REQUIRE(leaf.vdb().isValueOn(at) == leaf.is_valid(n));
        REQUIRE(leaf.is_valid(n) == (nodes[n >> 6] >> (n & 63) & 1));
      }
}

TEST_CASE("vdb: a grid read back holds the band of both blocks, in scan units", "[unit]") {
  test::Random random(1);
  test::Samples samples;
  test::add_sphere({128, 96, 96}, 20.3, 1 / 1.5, random, samples);
  Lattice lattice;
  lattice.h = 0.25;
  lattice.origin_brick = {1000, -3, 0};
  VdbExport vdb(lattice);
  std::size_t nodes = 0;
  openvdb::FloatTree expected(0.25f * kBandBackground);
  const Int3 origins[] = {{64, 64, 64}, {128, 64, 64}};
  for (const Int3& origin : origins) {
    auto field = evaluate_field(test::make_block(samples, origin, {64, 64, 64}, field_halo_cells({})), {});
    for (const BandLeaf& leaf : field.leaves) {
      for (const auto word : leaf.valid()) nodes += static_cast<std::size_t>(std::popcount(word));
      for (auto it = leaf.vdb().cbeginValueOn(); it; ++it) expected.setValue(it.getCoord(), 0.25f * *it);
    }
    vdb.add(std::move(field));
  }
  CHECK(vdb.node_count() > 10000);
  CHECK(vdb.node_count() < nodes);  // both blocks hold the nodes along their common face
  std::stringstream file;
  vdb.write(file);
  REQUIRE(file.good());

  std::istream& in = file;
  openvdb::io::Stream stream(in, false);  // values at once: see vdb_leaf.h
  const auto grids = stream.getGrids();
  REQUIRE(grids->size() == 1);
  const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(grids->front());
  CHECK(grid->activeVoxelCount() == vdb.node_count());
  CHECK(grid->tree().leafCount() == expected.leafCount());
  for (auto leaf = expected.cbeginLeaf(); leaf; ++leaf) {
    const VdbLeaf* found = grid->tree().probeConstLeaf(leaf->origin());
    REQUIRE(found != nullptr);
    REQUIRE(*found == *leaf);  // origin, mask and all 512 values
  }
  for (auto it = grid->cbeginValueOn(); it; ++it) {
    const auto p = it.getCoord();
    const double x = p.x() - 128.0, y = p.y() - 96.0, z = p.z() - 96.0;
    REQUIRE(std::abs(static_cast<double>(*it) - 0.25 * (std::sqrt(x * x + y * y + z * z) - 20.3)) < 0.02);
  }
  const auto world = grid->indexToWorld(openvdb::Coord(4, 0, 0));
  CHECK(world.x() == 64000 * 0.25 + 1.0);
  CHECK(world.y() == -192 * 0.25);
}

}  // namespace band_vdb_test
