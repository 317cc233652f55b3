#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <set>

#include "kernels/holes/boundary_loops.h"
#include "tests/helpers/random.h"

namespace boundary_loops_test {

using namespace tessera;

namespace {

/// Faces of a grid of n x n quads of which some are missing, vertices under shuffled numbers.
struct Sheet {
  std::vector<std::array<std::uint64_t, 3>> faces;
  std::uint64_t vertices = 0;
};

Sheet make_sheet(std::size_t n, std::uint64_t seed) {
  test::Random random(seed);
  Sheet out;
  out.vertices = (n + 1) * (n + 1);
  std::vector<std::uint64_t> name(out.vertices);
  for (std::size_t i = 0; i < name.size(); ++i) name[i] = i;
  for (std::size_t i = name.size(); i > 1; --i) std::swap(name[i - 1], name[random.below(i)]);
  for (std::size_t y = 0; y < n; ++y)
    for (std::size_t x = 0; x < n; ++x) {
      // Holes with a quad between them never touch in a vertex.
      if (x % 4 == 2 && y % 4 == 2 && random.below(2) == 0) continue;
      if (y % 4 == 2 && x > 4 && x < 12 && y < 4) continue;
      const std::uint64_t a = name[y * (n + 1) + x], b = name[y * (n + 1) + x + 1],
                          c = name[(y + 1) * (n + 1) + x + 1], d = name[(y + 1) * (n + 1) + x];
      out.faces.push_back({a, b, c});
      out.faces.push_back({a, c, d});
    }
  return out;
}

BoundaryMatcher match(const Sheet& sheet, const std::set<std::uint64_t>* known = nullptr) {
  std::vector<EdgeRecord> records;
  for (const auto& f : sheet.faces)
    for (std::size_t e = 0; e < 3; ++e) {
      const std::uint64_t a = f[e], b = f[(e + 1) % 3];
      if (known && known->count(a) == 0 && known->count(b) == 0) continue;
      records.push_back(edge_record(a, b, f[(e + 2) % 3]));
    }
  std::sort(records.begin(), records.end());
  BoundaryMatcher boundaries;
  for (const EdgeRecord& r : records) boundaries.add(r);
  boundaries.finish();
  return boundaries;
}

}  // namespace

TEST_CASE("hole rims: loops run against the faces, with the faces beyond and the chords across", "[unit]") {
  // A tube of three quads around: both ends are triangles, no chord joins their vertices.
  Sheet tube;
  for (std::uint64_t i = 0; i < 3; ++i) {
    const std::uint64_t j = (i + 1) % 3;
    tube.faces.push_back({i, j, 3 + j});
    tube.faces.push_back({i, 3 + j, 3 + i});
  }
  std::vector<HoleBoundary> boundaries;
  const LoopCounts counts =
      for_each_boundary_loop(match(tube), 3, [&](HoleBoundary&& r) { boundaries.push_back(std::move(r)); });
  CHECK((counts.loops == 2 && counts.longest == 3 && counts.broken == 0));
  REQUIRE(boundaries.size() == 2);
  CHECK(boundaries[0].vertex == std::vector<std::uint64_t>{0, 2, 1});
  CHECK(boundaries[0].third == std::vector<std::uint64_t>{3, 5, 4});
  CHECK(boundaries[0].taken.empty());
  CHECK(boundaries[1].vertex == std::vector<std::uint64_t>{3, 4, 5});
  CHECK(for_each_boundary_loop(match(tube), 2, [&](HoleBoundary&&) { FAIL("too long"); }).loops == 2);
  // Two triangles: their common edge is a chord of the loop around them.
  const Sheet quad = {{{0, 1, 2}, {0, 2, 3}}, 4};
  const std::vector<HoleBoundary> around = short_boundary_loops(match(quad), 0, 4, 10);
  REQUIRE(around.size() == 1);
  CHECK(around[0].vertex == std::vector<std::uint64_t>{0, 3, 2, 1});
  CHECK(around[0].taken == std::vector<std::array<std::uint32_t, 2>>{{0, 2}});
}

TEST_CASE("hole rims: a vertex with two border edges out ends the way", "[unit]") {
  // Two triangles that touch in a vertex.
  const Sheet bow = {{{0, 1, 2}, {0, 3, 4}}, 5};
  std::size_t found = 0;
  const LoopCounts counts = for_each_boundary_loop(match(bow), 10, [&](HoleBoundary&&) { ++found; });
  CHECK(counts.broken == 1);
  CHECK(found == 1);
  CHECK(short_boundary_loops(match(bow), 0, 5, 10).size() == 1);
}

TEST_CASE("hole rims: ranges of numbers find alone what all find together", "[property]") {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    CAPTURE(seed);
    const Sheet sheet = make_sheet(24, seed);
    const BoundaryMatcher all = match(sheet);
    std::map<std::uint64_t, HoleBoundary> want;
    for_each_boundary_loop(all, 20, [&](HoleBoundary&& r) { want[r.vertex[0]] = std::move(r); });
    REQUIRE(want.size() > 10);
    REQUIRE(std::any_of(want.begin(), want.end(), [](const auto& w) { return w.second.vertex.size() > 12; }));
    std::vector<HoleBoundary> got;
    const std::uint64_t step = 97;
    for (std::uint64_t first = 0; first < sheet.vertices; first += step)
      for (HoleBoundary& r : short_boundary_loops(all, first, first + step, 20)) got.push_back(std::move(r));
    REQUIRE(got.size() == want.size());
    auto it = want.begin();
    for (const HoleBoundary& r : got) {
      CHECK(r.vertex == it->second.vertex);
      CHECK(r.third == it->second.third);
      CHECK(r.taken == it->second.taken);
      ++it;
    }
    // Where edges of a loop are not known, it is not found, and no other in its place.
    const HoleBoundary& lost = want.begin()->second;
    std::set<std::uint64_t> known;
    for (std::uint64_t v = 0; v < sheet.vertices; ++v) known.insert(v);
    for (std::size_t k = 1; k < 3; ++k) known.erase(lost.vertex[k]);
    for (const HoleBoundary& r : short_boundary_loops(match(sheet, &known), 0, sheet.vertices, 20))
      CHECK(want.count(r.vertex[0]) == 1);
    CHECK(short_boundary_loops(match(sheet, &known), lost.vertex[0], lost.vertex[0] + 1, 20).empty());
  }
}

}  // namespace boundary_loops_test
