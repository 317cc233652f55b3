#include <algorithm>
#include <catch2/catch.hpp>
#include <map>

#include "kernels/holes/boundary_chain.h"
#include "tests/helpers/random.h"

namespace boundary_chain_test {

using namespace tessera;

namespace {

struct Rings {
  std::vector<BoundaryEdge> edges;
  std::map<std::uint64_t, std::size_t> length;  ///< of the ring with that smallest number
};

/// Rings of 3 to 40 vertices under shuffled numbers; the third vertex of an edge is its `from` + 1,000,000.
Rings make_rings(std::size_t count, std::uint64_t seed) {
  test::Random random(seed);
  std::vector<std::size_t> length(count);
  std::uint64_t all = 0;
  for (std::size_t& n : length) all += n = 3 + random.below(38);
  std::vector<std::uint64_t> name(all);
  for (std::size_t i = 0; i < all; ++i) name[i] = i;
  for (std::size_t i = all; i > 1; --i) std::swap(name[i - 1], name[random.below(i)]);
  Rings out;
  std::size_t first = 0;
  for (const std::size_t n : length) {
    for (std::size_t k = 0; k < n; ++k) {
      const std::uint64_t from = name[first + k];
      out.edges.push_back({from, name[first + (k + 1) % n], from + 1'000'000});
    }
    out.length[*std::min_element(name.begin() + static_cast<std::ptrdiff_t>(first),
                                 name.begin() + static_cast<std::ptrdiff_t>(first + n))] = n;
    first += n;
  }
  return out;
}

void shuffle_edges(std::vector<BoundaryEdge>& edges, std::uint64_t seed) {
  test::Random random(seed);
  for (std::size_t i = edges.size(); i > 1; --i) std::swap(edges[i - 1], edges[random.below(i)]);
}

}  // namespace

TEST_CASE("boundary chain: every loop that is short enough, once, in any order of its edges", "[unit]") {
  const std::uint64_t seed = GENERATE(1, 2, 3);
  Rings rings = make_rings(60, seed);
  shuffle_edges(rings.edges, seed + 10);
  std::map<std::uint64_t, std::uint64_t> next;
  for (const BoundaryEdge& e : rings.edges) next[e.from] = e.to;
  constexpr std::size_t kLongest = 25;
  BoundaryChain chain(kLongest, 1'000'000);
  std::map<std::uint64_t, std::size_t> found;
  for (const BoundaryEdge& e : rings.edges)
    chain.add(e, [&](HoleBoundary&& loop) {
      REQUIRE(*std::min_element(loop.vertex.begin(), loop.vertex.end()) == loop.vertex[0]);
      for (std::size_t i = 0; i < loop.vertex.size(); ++i) {
        CHECK(next.at(loop.vertex[i]) == loop.vertex[(i + 1) % loop.vertex.size()]);
        CHECK(loop.third[i] == loop.vertex[i] + 1'000'000);
      }
      CHECK(loop.taken.empty());
      CHECK(found.emplace(loop.vertex[0], loop.vertex.size()).second);
    });
  std::erase_if(rings.length, [](const auto& ring) { return ring.second > kLongest; });
  CHECK(found == rings.length);
  CHECK(chain.open_edges() == 0);
  CHECK(chain.given_up() == 0);
}

TEST_CASE("boundary chain: what is open is bounded, and loops behind are whole again", "[unit]") {
  const Rings rings = make_rings(40, 7);
  std::vector<BoundaryEdge> shuffled = rings.edges;
  shuffle_edges(shuffled, 8);
  BoundaryChain chain(100, 50);
  std::size_t loops = 0;
  const auto count = [&](HoleBoundary&&) { ++loops; };
  for (const BoundaryEdge& e : shuffled) {
    chain.add(e, count);
    REQUIRE(chain.open_edges() <= 50);
  }
  CHECK(chain.given_up() > 0);
  CHECK(loops < rings.length.size());
  // Edges that come loop by loop need no more than one loop's.
  loops = 0;
  for (BoundaryEdge e : rings.edges) {
    e.from += 5'000, e.to += 5'000;
    chain.add(e, count);
  }
  CHECK(loops == rings.length.size());
}

}  // namespace boundary_chain_test
