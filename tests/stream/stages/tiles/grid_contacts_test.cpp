#include "stream/stages/tiles/grid_contacts.h"

#include <catch2/catch.hpp>

#include "kernels/mesh/block_contacts.h"

namespace grid_contacts_test {

using namespace tessera;

namespace {

/// Two sheets of 4 x 4 squares of 1 x 1, one a quarter aside and so far above the other.
MeshBlock sheets(double apart) {
  MeshBlock block;
  const auto add = [&](double aside, double z) {
    const auto first = static_cast<std::uint32_t>(block.key.size());
    for (int j = 0; j <= 4; ++j)
      for (int i = 0; i <= 4; ++i) {
        block.key.push_back(block.key.size());
        block.position.push_back({i + aside, j + aside, z});
      }
    for (std::uint32_t j = 0; j < 4; ++j)
      for (std::uint32_t i = 0; i < 4; ++i) {
        const std::uint32_t v = first + 5 * j + i;
        block.faces.push_back({v, v + 1, v + 6});
        block.faces.push_back({v, v + 6, v + 5});
      }
  };
  add(0.0, 0.0);
  add(0.25, apart);
  return block;
}

}  // namespace

TEST_CASE("grid contacts: sheets nearer than a step meet on the grid, and not those that met before",
          "[unit]") {
  const TileGrid grid{{0, 0, 0}, 0.125};
  CHECK(pairs_met_by_grid(sheets(0.05), quantise_tile(sheets(0.05), grid, {})) > 32);
  CHECK(pairs_met_by_grid(sheets(0.2), quantise_tile(sheets(0.2), grid, {})) == 0);
  MeshBlock crossing = sheets(0.0);
  for (std::size_t v = 25; v < 50; ++v) crossing.position[v][2] = 0.5 * (crossing.position[v][0] - 2.1);
  CHECK(count_contacts(crossing) > 4);
  CHECK(pairs_met_by_grid(crossing, quantise_tile(crossing, TileGrid{{0, 0, 0}, 0x1p-20}, {})) == 0);
}

}  // namespace grid_contacts_test
