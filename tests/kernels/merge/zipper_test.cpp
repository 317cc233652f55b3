#include "kernels/merge/zipper.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <map>

#include "tests/helpers/random.h"

namespace zipper_test {

namespace {

using namespace tessera;

/// Adds a grid of squares over [x0, x1] x [0, y1], vertices moved a little.
void add_grid(ZipPieces& z, double x0, double x1, double y1, int nx, int ny, std::uint8_t flags,
              test::Random& random) {
  const auto first = static_cast<std::uint32_t>(z.position.size());
  for (int j = 0; j <= ny; ++j)
    for (int i = 0; i <= nx; ++i)
      z.position.push_back({x0 + (x1 - x0) * i / nx + random.in(-0.02, 0.02), y1 * j / ny,
                            0.1 * std::sin(y1 * j / ny) + random.in(-0.02, 0.02)});
  const auto at = [&](int i, int j) { return first + static_cast<std::uint32_t>(j * (nx + 1) + i); };
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) {
      z.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      z.edges.push_back(static_cast<std::uint8_t>(flags | (j == 0 ? ZipPieces::kEnds : 0)));
      z.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      z.edges.push_back(static_cast<std::uint8_t>(flags | (j + 1 == ny ? ZipPieces::kEnds << 1 : 0)));
    }
}

struct Counts {
  std::size_t border = 0, bad = 0;
};

Counts count_edges(const ZipPieces& z, const Zipped& zipped, double x_low, double x_high) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> half_edges;
  const auto add = [&](const std::array<std::uint32_t, 3>& f) {
    for (std::size_t k = 0; k < 3; ++k) ++half_edges[{f[k], f[(k + 1) % 3]}];
  };
  for (std::size_t f = 0; f < z.faces.size(); ++f)
    if (!zipped.removed[f]) add(z.faces[f]);
  for (const auto& f : zipped.added) add(f);
  Counts c;
  for (const auto& [edge, n] : half_edges) {
    if (n > 1) ++c.bad;
    if (half_edges.count({edge.second, edge.first})) continue;
    const Double3 &a = z.position[edge.first], &b = z.position[edge.second];
    const double x = 0.5 * (a[0] + b[0]), y = 0.5 * (a[1] + b[1]);
    if (x > x_low && x < x_high && y > 0.2 && y < 11.8) ++c.border;
  }
  return c;
}

}  // namespace

TEST_CASE("zip: pieces of different density become one, no border left between them", "[property]") {
  for (const int seed : {1, 2, 3, 4}) {
    for (const int coarse : {60, 24, 7}) {
      CAPTURE(seed, coarse);
      test::Random random(static_cast<std::uint64_t>(seed));
      ZipPieces z;
      add_grid(z, 0.0, 3.0, 12.0, 15, 60, ZipPieces::kOriginal, random);
      add_grid(z, 3.25, 6.0, 12.0, 14, 60, 0, random);
      add_grid(z, 6.3, 9.0, 12.0, std::max(1, coarse / 4), coarse, ZipPieces::kOriginal, random);
      const Zipped zipped = zip(z, 0.5);
      CHECK(zipped.report.removed == 0);
      CHECK(zipped.added.size() >= 120u + 60u + static_cast<std::size_t>(coarse));
      const Counts c = count_edges(z, zipped, 2.0, 7.0);
      CHECK(c.border == 0);
      CHECK(c.bad == 0);
    }
  }
}

TEST_CASE("zip: what is too far apart stays apart", "[unit]") {
  test::Random random(9);
  ZipPieces z;
  add_grid(z, 0.0, 3.0, 12.0, 15, 60, 0, random);
  add_grid(z, 6.0, 9.0, 12.0, 15, 60, 0, random);
  const Zipped zipped = zip(z, 0.5);
  CHECK(zipped.added.size() < 4);
  CHECK(count_edges(z, zipped, -1.0, 10.0).border > 100);
}

TEST_CASE("zip: a needle far away, which makes all edges candidates of all, changes nothing", "[property]") {
  test::Random random(7);
  ZipPieces z;
  add_grid(z, 0.0, 3.0, 12.0, 15, 60, ZipPieces::kOriginal, random);
  add_grid(z, 3.25, 6.0, 12.0, 14, 60, 0, random);
  const Zipped alone = zip(z, 0.5);
  REQUIRE(alone.added.size() >= 120u);
  const auto v = static_cast<std::uint32_t>(z.position.size());
  for (const double x : {-2000.0, -1000.0}) z.position.push_back({x, 0.0, 500.0});
  z.position.push_back({-1500.0, 0.1, 500.0});
  z.faces.push_back({v, v + 1, v + 2});
  // No crumb: it goes on elsewhere.
  z.edges.push_back(static_cast<std::uint8_t>(ZipPieces::kOriginal | ZipPieces::kGoesOn << 1));
  const Zipped zipped = zip(z, 0.5);
  CHECK(zipped.added == alone.added);
  CHECK(zipped.report.removed == 0);
}

TEST_CASE("zip: faces at a vertex where borders touch go, crumbs too", "[unit]") {
  ZipPieces z;
  // Two triangles that share a vertex alone.
  z.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  z.faces = {{0, 1, 2}, {0, 3, 4}};
  z.edges = {0, 0};
  const Zipped zipped = zip(z, 0.01);
  CHECK(zipped.report.removed == 2);
  CHECK(zipped.added.empty());
}

TEST_CASE("zip: faces at a vertex of two fans go where faces that are not here follow, too", "[unit]") {
  // As above, but beyond both triangles the surface goes on.
  ZipPieces z;
  z.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  z.faces = {{0, 1, 2}, {0, 3, 4}};
  z.edges = {ZipPieces::kGoesOn << 1, ZipPieces::kGoesOn << 1};
  const Zipped zipped = zip(z, 0.01);
  CHECK(zipped.report.removed == 2);
  CHECK(zipped.report.open_edges == 2);
  CHECK(zipped.report.pinched == 0);
}

TEST_CASE("zip: a vertex whose fans faces close that are not here keeps them", "[unit]") {
  // Around vertex 0: two triangles, between them one that is not here on one side, and nothing on the other.
  ZipPieces z;
  z.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  z.faces = {{0, 1, 2}, {0, 3, 4}};
  z.edges = {ZipPieces::kGoesOn << 1 | ZipPieces::kGoesOn << 2, ZipPieces::kGoesOn << 1 | ZipPieces::kGoesOn};
  CHECK(zip(z, 0.01).report.removed == 0);
  // One that ends on both sides meets one that goes on: of two fans.
  z.edges = {ZipPieces::kGoesOn << 1, ZipPieces::kGoesOn << 1 | ZipPieces::kGoesOn << 2};
  const Zipped zipped = zip(z, 0.01);
  CHECK(zipped.report.removed == 2);
  CHECK(zipped.report.pinched == 0);
}

}  // namespace zipper_test
