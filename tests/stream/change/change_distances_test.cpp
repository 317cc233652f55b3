// Tiles own every point once and load all that is near; what is found is that of the kernel over all points.
#include <catch2/catch.hpp>

#include <bit>
#include <cmath>
#include <vector>

#include "octree/error.h"
#include "stream/change/change_distances.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace change_distances_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr Double3 kOrigin = {1000.0, -2000.0, 0.0};

/// A floor, a wall and strewn points, some of them in one place.
std::vector<Double3> scene(std::size_t count, unsigned seed) {
  Random random(seed);
  std::vector<Double3> points;
  for (std::size_t i = 0; i < count; ++i) {
    const double u = random.in(0.0, 60.0), v = random.in(0.0, 60.0), n = 0.05 * random.gaussian() + 1.0;
    const std::uint64_t kind = random.below(8);
    points.push_back(kOrigin + (kind == 0   ? Double3{u, 20.0 + n, 1.0 + 0.5 * v}
                                : kind == 1 ? Double3{30.0 + n, 30.0 + 0.1 * n, 0.1 * v}
                                            : Double3{u, v, n + 0.05 * u}));
  }
  return points;
}

ChangeSettings settings() {
  ChangeSettings s;
  s.rule.normal_scale = 2.0, s.rule.projection_scale = 1.0, s.rule.max_depth = 1.5;
  s.details = true;
  s.origin = kOrigin, s.extent = 61.5;
  return s;
}

std::uint64_t bits_of(double x) {
  return std::bit_cast<std::uint64_t>(x);
}

}  // namespace

TEST_CASE("change tiles: every old point has one owner, which loads all points of the halo", "[property]") {
  const std::vector<Double3> before = scene(20000, 1), after = scene(20000, 2);
  constexpr double kHalo = 1.8;
  CloudCounts counts(0.9);
  for (const Double3& p : before) counts.add(0, p - kOrigin);
  for (const Double3& p : after) counts.add(1, p - kOrigin);
  ChangeTiles tiles(counts, kHalo, 4000, 0.5);
  CHECK(tiles.tiles().size() > 8);
  std::vector<std::vector<Double3>> loaded(tiles.tiles().size()), owned(tiles.tiles().size());
  std::size_t owners = 0;
  for (const Double3& p : before)
    tiles.for_tiles(p - kOrigin, [&](std::uint32_t k) {
      loaded[k].push_back(p - kOrigin);
      if (!tiles.owns(tiles.tiles()[k], p - kOrigin)) return;
      ++owners;
      owned[k].push_back(p - kOrigin);
    });
  CHECK(owners == before.size());
  std::size_t missed = 0;
  for (std::size_t k = 0; k < owned.size(); ++k) {
    CHECK(owned[k].size() == tiles.tiles()[k].own);
    CHECK(loaded[k].size() <= tiles.tiles()[k].loaded[0]);
    for (std::size_t i = 0; i < owned[k].size(); i += 50) {
      std::size_t near = 0, all = 0;
      for (const Double3& q : loaded[k]) near += norm(q - owned[k][i]) <= kHalo ? 1 : 0;
      for (const Double3& q : before) all += norm(q - kOrigin - owned[k][i]) <= kHalo ? 1 : 0;
      missed += all - near;
    }
  }
  CHECK(missed == 0);
}

TEST_CASE("change distances: the kernel over all points finds the same, whatever the memory and the threads",
          "[property]") {
  const TempFolder folder;
  const std::vector<Double3> before = scene(60000, 1), after = scene(50000, 2);
  const ChangeSettings s = settings();
  std::vector<Double3> a, b;
  for (const Double3& p : before) a.push_back(p - kOrigin);
  for (const Double3& p : after) b.push_back(p - kOrigin);
  const PointCells all_before(a, change_cell_size(s.rule), true),
      all_after(b, change_cell_size(s.rule), false);
  ChangeWork work;
  std::vector<CoreChange> want(before.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    changes_at(all_before, all_after, std::span(a).subspan(i, 1), s.rule, work,
               std::span(want).subspan(i, 1));
  ChangeArea first;
  for (const auto& [memory, threads] :
       {std::pair{std::uint64_t{1} << 16, 3}, std::pair{std::uint64_t{64} << 20, 1}}) {
    SpillPool pool(folder.path(), memory);
    CloudPoints old_points(pool), new_points(pool);
    for (const Double3& p : before) old_points.add(p);
    for (const Double3& p : after) new_points.add(p);
    ChangeDistances distances(s, folder.path(), memory);
    MemoryBudget budget(std::uint64_t{1} << 30, 0);
    distances.deal(old_points, new_points, threads, budget);
    ChangeCells cells(1.0, 3.0, folder.path(), 1u << 20);
    WorkerPool workers(threads);
    std::uint64_t told = 0;
    distances.measure(workers, budget, cells, [&](std::uint64_t n) { told += n; });
    CHECK(distances.core_points() == before.size());
    std::size_t wrong = 0;
    for (const CoreChange& c : want) {
      const FoundChange& found = distances.next();
      const ChangeDetails& details = distances.next_details();
      wrong += bits_of(found.distance) == bits_of(c.distance) &&
                       bits_of(found.uncertainty) == bits_of(c.uncertainty) && found.core == 1 &&
                       (found.significant != 0) == c.significant && details.count[0] == c.clouds[0].count &&
                       details.count[1] == c.clouds[1].count &&
                       (c.normal == Double3{} || details.normal == c.normal)
                   ? 0
                   : 1;
    }
    CHECK(wrong == 0);
    const ChangeArea area = change_area(cells);
    if (first.worst.empty()) first = area;
    CHECK(area.compared == first.compared);
    CHECK(area.significant == first.significant);
    REQUIRE(area.worst.size() == first.worst.size());
    for (std::size_t k = 0; k < area.worst.size(); ++k) CHECK(area.worst[k].mean == first.worst[k].mean);
  }
}

TEST_CASE("change distances: a cap that cannot hold the fullest tile is refused before the work",
          "[memory]") {
  const TempFolder folder;
  SpillPool pool(folder.path(), 1u << 20);
  CloudPoints old_points(pool), new_points(pool);
  for (const Double3& p : scene(60000, 1)) old_points.add(p), new_points.add(p);
  ChangeSettings s = settings();
  s.rule.max_depth = 60.0;
  ChangeDistances distances(s, folder.path(), 1u << 20);
  const MemoryBudget budget(std::uint64_t{16} << 20, std::uint64_t{8} << 20);
  CHECK_THROWS_AS(distances.deal(old_points, new_points, 1, budget), ResourceError);
}

}  // namespace change_distances_test
