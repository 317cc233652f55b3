#include "kernels/solid/crease_sheets.h"

#include <catch2/catch.hpp>

namespace crease_sheets_test {

using namespace tessera;

TEST_CASE("crease sheets: two at an edge, three at a corner, none where it is smooth, slivers tell nothing",
          "[unit]") {
  // Two walls of a box, from x = -4 to 4, and its end there; the strip of the roof along the edge is a row of slivers.
  MeshBlock block;
  const auto vertex = [&](double x, double y, double z) {
    block.position.push_back({x, y, z});
    return static_cast<std::uint32_t>(block.position.size() - 1);
  };
  std::array<std::array<std::uint32_t, 9>, 4> at;
  for (std::size_t i = 0; i < 9; ++i) {
    const double x = static_cast<double>(i) - 4.0;
    at[0][i] = vertex(x, -3, 0), at[1][i] = vertex(x, -1e-4, 0), at[2][i] = vertex(x, 0, 0),
    at[3][i] = vertex(x, 0, -2);
  }
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t i = 0; i < 8; ++i) {
      block.faces.push_back({at[row][i], at[row][i + 1], at[row + 1][i]});
      block.faces.push_back({at[row][i + 1], at[row + 1][i + 1], at[row + 1][i]});
    }
  const std::uint32_t below = vertex(4, -3, -2);
  block.faces.push_back({at[2][8], at[0][8], below});
  block.faces.push_back({at[2][8], below, at[3][8]});
  // A sliver that shows anywhere.
  block.faces.push_back({at[2][4], at[2][5], vertex(-0.5, 0.001, 0.001)});
  const CreaseSheets sheets(block);
  const auto has = [&](std::uint32_t v, const Double3& normal) {
    for (const Double3& n : sheets.at(v))
      if (norm(n - normal) < 1e-3) return true;
    return false;
  };
  for (std::size_t i = 0; i < 9; ++i) {
    CAPTURE(i);
    CHECK(sheets.at(at[2][i]).size() == (i < 7 ? 2 : 3));
    CHECK(has(at[2][i], {0, 0, 1}));
    CHECK(has(at[2][i], {0, 1, 0}));
    CHECK(has(at[2][i], {1, 0, 0}) == (i >= 7));
  }
  // Flat for two rings around.
  MeshBlock flat;
  flat.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0.1}};
  flat.faces = {{0, 1, 2}, {1, 3, 2}};
  CHECK(CreaseSheets(flat).at(0).empty());
}

}  // namespace crease_sheets_test
