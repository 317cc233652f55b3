#include "kernels/merge/edge_crossings.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "tests/helpers/random.h"

namespace edge_crossings_test {

namespace {

using namespace tessera;

/// By the signs of areas alone, one edge after the other.
bool crosses_any(const std::vector<Double3>& at, const std::vector<FrontEdge>& edges, std::uint32_t p,
                 std::uint32_t q, const Double3& n) {
  for (const FrontEdge& e : edges) {
    if (e.from == p || e.from == q || e.to == p || e.to == q) continue;
    const Double3 &a = at[p], &b = at[q], &c = at[e.from], &d = at[e.to];
    const auto side = [&](const Double3& x, const Double3& y, const Double3& z) {
      return dot(cross(y - x, z - x), n) >= 0.0;
    };
    if (side(a, b, c) == side(a, b, d) || side(c, d, a) == side(c, d, b)) continue;
    if (std::fabs(dot((c + d) * 0.5 - (a + b) * 0.5, n)) <= norm(b - a) + norm(d - c)) return true;
  }
  return false;
}

}  // namespace

TEST_CASE("edge crossings: as asked of one edge after the other, of needles and short ones", "[property]") {
  test::Random random(3);
  for (const std::size_t count : {1u, 6u, 40u, 203u}) {
    std::vector<Double3> at;
    std::vector<FrontEdge> edges;
    std::vector<std::uint32_t> all;
    for (std::uint32_t i = 0; i < count; ++i) {
      const Double3 from = {random.in(1000.0, 1100.0), random.in(0.0, 100.0), random.in(0.0, 5.0)};
      const double length = i % 5 == 0 ? 60.0 : 4.0;
      at.push_back(from);
      at.push_back({from[0] + random.in(-length, length), from[1] + random.in(-1.0, 1.0), from[2]});
      edges.push_back({2 * i, 2 * i + 1, 0});
      all.push_back(i);
    }
    EdgeCrossings crossings(at);
    std::size_t yes = 0, no = 0;
    for (int i = 0; i < 400; ++i) {
      const auto any_end = [&] { return static_cast<std::uint32_t>(random.unit() * 1.999 * double(count)); };
      const std::uint32_t u = any_end(), p = any_end(), q = any_end();
      if (p == q) continue;
      crossings.load(at[u], at[p], edges, all);
      const Double3 n = unit_or_zero(Double3{random.in(-0.3, 0.3), random.in(-0.3, 0.3), 1.0});
      const bool expected = crosses_any(at, edges, p, q, n);
      (expected ? yes : no) += 1;
      CHECK(crossings.crosses_any(p, q, n) == expected);
    }
    if (count >= 40) CHECK(yes > 50);
    CHECK(yes + no > 100);
  }
}

}  // namespace edge_crossings_test
