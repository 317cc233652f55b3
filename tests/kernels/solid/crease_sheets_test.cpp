#include "kernels/solid/crease_sheets.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <catch2/catch.hpp>

#include "tests/helpers/random.h"

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

TEST_CASE("crease sheets: the same bits in whatever order vertices and faces come", "[property]") {
  MeshBlock roof;  // bent, its triangles irregular
  test::Random random(3);
  constexpr std::uint32_t kRow = 24;
  for (std::uint32_t y = 0; y < kRow; ++y)
    for (std::uint32_t x = 0; x < kRow; ++x)
      roof.position.push_back({x + random.in(-0.3, 0.3), y + random.in(-0.3, 0.3),
                               -0.8 * std::fabs(y - 11.5 - 0.02 * x * x) + random.in(-0.05, 0.05)});
  for (std::uint32_t y = 0; y + 1 < kRow; ++y)
    for (std::uint32_t x = 0; x + 1 < kRow; ++x) {
      const std::uint32_t v = y * kRow + x;
      roof.faces.push_back({v, v + 1, v + kRow + 1});
      roof.faces.push_back({v, v + kRow + 1, v + kRow});
    }
  MeshBlock cone;  // smooth but for its tip
  constexpr std::uint32_t kSides = 32, kRings = 6;
  cone.position.push_back({0, 0, 0});
  for (std::uint32_t r = 1; r <= kRings; ++r)
    for (std::uint32_t k = 0; k < kSides; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / kSides;
      cone.position.push_back({r * std::cos(angle), r * std::sin(angle), -1.0 * r});
    }
  const auto at = [&](std::uint32_t r, std::uint32_t k) {
    return r == 0 ? 0 : 1 + (r - 1) * kSides + k % kSides;
  };
  for (std::uint32_t r = 0; r < kRings; ++r)
    for (std::uint32_t k = 0; k < kSides; ++k) {
      cone.faces.push_back({at(r, k), at(r + 1, k), at(r + 1, k + 1)});
      if (r > 0) cone.faces.push_back({at(r, k), at(r + 1, k + 1), at(r, k + 1)});
    }
  for (const auto& [mesh, at_least] : {std::pair(&roof, 100), std::pair(&cone, 1)}) {
    const CreaseSheets sheets(*mesh);
    const auto vertices = static_cast<std::uint32_t>(mesh->position.size());
    for (const std::uint32_t step : {1u, 5u, 247u}) {
      REQUIRE(std::gcd(step, vertices) == 1);
      const auto other = [&](std::uint32_t v) { return vertices - 1 - v * step % vertices; };
      MeshBlock turned;
      turned.position.resize(vertices);
      for (std::uint32_t v = 0; v < vertices; ++v) turned.position[other(v)] = mesh->position[v];
      for (std::size_t f = mesh->faces.size(); f-- > 0;)
        turned.faces.push_back(
            {other(mesh->faces[f][0]), other(mesh->faces[f][1]), other(mesh->faces[f][2])});
      const CreaseSheets of_turned(turned);
      int creased = 0;
      for (std::uint32_t v = 0; v < vertices; ++v) {
        CAPTURE(step, v);
        const auto a = sheets.at(v), b = of_turned.at(other(v));
        REQUIRE(std::equal(a.begin(), a.end(), b.begin(), b.end()));
        REQUIRE(sheets.share(v) == of_turned.share(other(v)));
        creased += !a.empty();
      }
      CHECK(creased >= at_least);
    }
  }
}

}  // namespace crease_sheets_test
