// Chains of contour lines on meshes whose lines are known.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/mesh/orientation_sign.h"
#include "kernels/survey/contour_chains.h"
#include "tests/helpers/random.h"

namespace contour_chains_test {

using namespace tessera;

namespace {

/// Heights over a grid of n x n squares of edge 1.
template <class Height>
MeshBlock grid_block(std::uint32_t n, const Height& height) {
  MeshBlock block;
  for (std::uint32_t y = 0; y <= n; ++y)
    for (std::uint32_t x = 0; x <= n; ++x) {
      block.key.push_back(block.key.size());
      block.position.push_back({double(x), double(y), height(double(x), double(y))});
    }
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
      block.faces.push_back({a, b, d});
      block.faces.push_back({a, d, c});
    }
  return block;
}

double signed_area(const std::vector<Double2>& p) {
  double sum = 0.0;
  for (std::size_t k = 0; k < p.size(); ++k) {
    const Double2 &a = p[k], &b = p[(k + 1) % p.size()];
    sum += a[0] * b[1] - a[1] * b[0];
  }
  return 0.5 * sum;
}

}  // namespace

TEST_CASE("contour chains: levels above a height, and at it", "[unit]") {
  const ContourLevels levels{0.0, 0.1};
  CHECK(levels.above(0.25) == 3);
  CHECK(levels.above(levels.height(3)) == 4);
  CHECK(levels.above(-0.05) == 0);
  CHECK(ContourLevels{5.0, 2.0}.above(4.0) == 0);
}

TEST_CASE("contour chains: a ramp has straight lines from border to border, higher ground on the left",
          "[unit]") {
  const MeshBlock block = grid_block(4, [](double x, double) { return 0.5 * x; });
  const auto chains = contour_chains(block, {0.0, 0.8}, -10, 10);
  REQUIRE(chains.size() == 2);
  for (std::size_t k = 0; k < 2; ++k) {
    CHECK(chains[k].level == std::int64_t(k) + 1);
    CHECK_FALSE(chains[k].closed);
    CHECK(chains[k].points.size() == 9);
    for (const Double2& p : chains[k].points) CHECK(p[0] == Approx(1.6 * double(k + 1)));
    CHECK(chains[k].points.front()[1] == 4.0);  // southwards: east is higher
    CHECK(chains[k].points.back()[1] == 0.0);
  }
}

TEST_CASE("contour chains: a pyramid has closed lines, also at the heights of vertices, none at its tip",
          "[unit]") {
  // Vertices at heights 0 to 4 exactly.
  const MeshBlock block =
      grid_block(8, [](double x, double y) { return 4.0 - std::max(std::abs(x - 4), std::abs(y - 4)); });
  auto chains = contour_chains(block, {0.0, 1.0}, 0, 10);
  REQUIRE(chains.size() == 4);
  for (std::size_t k = 0; k < 4; ++k) {
    CHECK(chains[k].closed);
    CHECK(chains[k].level == std::int64_t(k) + 1);
    CHECK(chains[k].begin == chains[k].smallest);
    remove_spikes(chains[k].points, true);
    const double side = 2.0 * (3.0 - double(k));
    if (k < 3) {
      CHECK(signed_area(chains[k].points) == side * side);  // to the left: inside
      CHECK(chains[k].points.size() == 8 * (3 - k));
    } else {
      CHECK(chains[k].points.empty());  // a point
    }
  }
}

TEST_CASE("contour chains: in random heights with many ties every line is closed or ends at the border",
          "[property]") {
  test::Random random(5);
  const MeshBlock block = grid_block(30, [&](double, double) { return std::floor(random.in(0.0, 5.0)); });
  const auto chains = contour_chains(block, {0.0, 0.5}, 0, 20);
  const auto border = [&](const Double2& p) {
    return p[0] == 0.0 || p[1] == 0.0 || p[0] == 30.0 || p[1] == 30.0;
  };
  std::size_t closed = 0, open = 0, steps = 0;
  for (const ContourChain& c : chains) {
    (c.closed ? closed : open) += 1;
    steps += c.points.size() - (c.closed ? 0 : 1);
    if (!c.closed) {
      CHECK(border(c.points.front()));
      CHECK(border(c.points.back()));
    }
  }
  CHECK(closed > 100);
  CHECK(open > 20);
  // Every face that a level meets has one step of it.
  std::size_t met = 0;
  for (const auto& f : block.faces)
    for (int k = 0; k < 20; ++k) {
      const auto above = [&](std::size_t c) { return block.position[f[c]][2] >= 0.5 * k; };
      met += above(0) != above(1) || above(1) != above(2);
    }
  CHECK(steps == met);
}

TEST_CASE("contour chains: lines of rough ground do not cross", "[property]") {
  test::Random random(11);
  const MeshBlock block = grid_block(14, [&](double, double) { return random.in(0.0, 5.0); });
  std::vector<std::array<Double2, 2>> pieces;
  for (const ContourChain& c : contour_chains(block, {0.0, 0.3}, 0, 20)) {
    for (std::size_t k = 1; k < c.points.size(); ++k) pieces.push_back({c.points[k - 1], c.points[k]});
    if (c.closed) pieces.push_back({c.points.back(), c.points.front()});
  }
  const auto apart = [](const std::array<Double2, 2>& line, const std::array<Double2, 2>& ends) {
    return orient2d_sign(line[0], line[1], ends[0]) * orient2d_sign(line[0], line[1], ends[1]) < 0;
  };
  std::size_t crossings = 0;
  for (std::size_t i = 0; i < pieces.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      crossings += apart(pieces[i], pieces[j]) && apart(pieces[j], pieces[i]);
  CHECK(pieces.size() > 1000);
  CHECK(crossings == 0);
}

TEST_CASE("contour chains: spikes and repeated points go, rings keep what turns", "[unit]") {
  std::vector<Double2> way = {{0, 0}, {1, 0}, {1, 0}, {2, 0}, {1, 0}, {1, 1}};
  remove_spikes(way, false);
  CHECK(way == std::vector<Double2>{{0, 0}, {1, 0}, {1, 1}});
  std::vector<Double2> ring = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {-1, 0}};
  remove_spikes(ring, true);
  CHECK(ring == std::vector<Double2>{{0, 0}, {1, 0}, {1, 1}});
  std::vector<Double2> flat = {{0, 0}, {1, 0}, {2, 0}, {1, 0}};
  remove_spikes(flat, true);
  CHECK(flat.empty());
}

}  // namespace contour_chains_test
