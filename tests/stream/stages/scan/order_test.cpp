#include <catch2/catch.hpp>
#include <cstring>

#include "octree/error.h"
#include "stream/points/hot_brick.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"

namespace order_test {

using namespace tessera;
using namespace tessera::test;

namespace {

bool same_bytes(const std::vector<PointRecord>& a, const std::vector<PointRecord>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0);
}

bool in_order(const std::vector<PointRecord>& points) {
  const auto key = [](const Int3& q) {
    return std::pair{brick_key({q[0] >> 16, q[1] >> 16, q[2] >> 16}), key_in_brick(q)};
  };
  for (std::size_t i = 1; i < points.size(); ++i)
    if (!(key(points[i - 1].q) < key(points[i].q))) return false;
  return true;
}

}  // namespace

TEST_CASE("order: same bytes for any order, split, slices, buckets and threads", "[property]") {
  auto points = sphere_points(30000, 150.0, {10.0, -20.0, 5.0});
  const ChainResult want = run_chain(points);
  REQUIRE(in_order(want.points));
  REQUIRE(want.order["duplicates"].get<std::uint64_t>() > 1000);
  CHECK(want.points.size() + want.order["duplicates"].get<std::uint64_t>() == points.size());

  ChainSetup setup;
  SECTION("shuffled, five files, small tasks") {
    shuffle(points, 7);
    setup.files = 5;
    setup.slice_points = 777;
    setup.task_points = 2000;
  }
  SECTION("one task, tasks backwards") {
    setup.slice_points = points.size();
    setup.task_points = points.size();
    setup.backwards = true;
  }
  SECTION("a small share of the cap each: many buckets and runs") {
    std::reverse(points.begin(), points.end());
    setup.threads = 600;
  }
  const ChainResult got = run_chain(points, setup);
  CHECK(same_bytes(got.points, want.points));
  CHECK(got.bricks == want.bricks);
  CHECK(got.plan.lattice == want.plan.lattice);
  CHECK(got.order == want.order);
}

TEST_CASE("order: points survive exactly", "[unit]") {
  std::vector<TestPoint> points(3);
  points[0] = {{0.5, 0.25, 0.125}, {0, 0, 1}, 0xff112233u};
  points[1] = {{100.5, 0.25, 0.125}, {0, 0, 0}, 0};
  points[2] = {{-3.0, 7.0, 2.0}, {0, 2, 0}, 0xff000001u};
  const ChainResult r = run_chain(points);
  REQUIRE(r.points.size() == 3);
  for (const TestPoint& p : points) {
    bool found = false;
    for (const PointRecord& q : r.points) {
      if (world_of(r.plan, q) != p.p) continue;
      found = true;
      CHECK(q.rgba == p.rgba);
      CHECK(q.normal == encode_normal(p.n[0], p.n[1], p.n[2]));
      CHECK(q.sensor == kNoSensor);
    }
    CHECK(found);
  }
  CHECK(r.plan.has_colour);
  CHECK(r.plan.normal_fraction == Approx(2.0 / 3.0));
}

TEST_CASE("order: equal positions are averaged", "[unit]") {
  std::vector<TestPoint> points = {{{1, 1, 1}, {1, 0, 0}, 0xff000010u}, {{1, 1, 1}, {0, 1, 0}, 0xff000020u},
                                   {{1, 1, 1}, {0, 0, 0}, 0},           {{2, 1, 1}, {1, 0, 0}, 0},
                                   {{2, 1, 1}, {-1, 0, 0}, 0},          {{5, 1, 9}, {0, 0, 1}, 0}};
  const ChainResult r = run_chain(points);
  REQUIRE(r.points.size() == 3);
  CHECK(r.order["duplicates"] == 3);
  CHECK(r.points[0].rgba == 0xff000018u);
  const Float3 n = decode_normal(r.points[0].normal);
  CHECK(n[0] == Approx(n[1]).margin(1e-4));
  CHECK(n[2] == Approx(0.0f).margin(1e-4));
  CHECK(r.points[1].normal == kNoNormal);  // opposed normals cancel
}

TEST_CASE("order: a hot brick is thinned to the limit, whatever the order", "[property]") {
  Random random(5);
  std::vector<TestPoint> points;
  for (int i = 0; i < 40000; ++i)  // dense corner
    points.push_back({{random.in(0, 4), random.in(0, 4), random.in(0, 1)}, {0, 0, 1}, 0});
  for (int i = 0; i < 500; ++i)  // sparse rest, one brick
    points.push_back({{random.in(4, 60), random.in(4, 60), random.in(0, 60)}, {0, 0, 1}, 0});
  for (int i = 0; i < 500; ++i)  // another brick
    points.push_back({{random.in(70, 100), random.in(4, 60), random.in(0, 60)}, {0, 0, 1}, 0});
  ChainSetup setup;
  setup.options.max_brick_points = 5000;
  const ChainResult want = run_chain(points, setup);
  CHECK(want.order["hot_bricks"] == 1);
  const auto kept = want.order["points"].get<std::uint64_t>();
  CHECK(kept <= 5000 + 500);
  CHECK(kept >= 4900 + 500);
  CHECK(kept + want.order["thinned"].get<std::uint64_t>() + want.order["duplicates"].get<std::uint64_t>() ==
        points.size());
  std::size_t sparse = 0;  // sparse parts stay whole
  for (const PointRecord& p : want.points) {
    const Double3 w = world_of(want.plan, p);
    sparse += (w[0] >= 4.001 || w[1] >= 4.001 || w[2] >= 1.001) ? 1 : 0;
  }
  CHECK(sparse >= 995);
  shuffle(points, 3);
  setup.files = 3;
  CHECK(same_bytes(run_chain(points, setup).points, want.points));
}

TEST_CASE("hot brick: the size of its chunks changes nothing", "[property]") {
  Random random(9);
  std::vector<PointRecord> points(20000);
  for (PointRecord& p : points) {
    p.q = {static_cast<std::int32_t>(random.bits() % 3000), static_cast<std::int32_t>(random.bits() % 30),
           static_cast<std::int32_t>(random.bits() % 30)};
    p.normal = encode_normal(1, static_cast<float>(random.unit()), 0);
  }
  HotBrick whole(3000, points.size() + 1);
  whole.count(points);
  whole.add(points);
  const auto want = whole.take();
  REQUIRE(want.size() <= 3000);
  HotBrick parts(3000, 500);
  for (std::size_t i = 0; i < points.size(); i += 100) parts.count({points.data() + i, 100});
  for (std::size_t i = points.size(); i > 0; i -= 100) parts.add({points.data() + i - 100, 100});
  CHECK(same_bytes(parts.take(), want));
  CHECK(parts.thinned() == whole.thinned());
  CHECK(parts.merged() == whole.merged());
  CHECK(want.size() + whole.thinned() + whole.merged() == points.size());
}

TEST_CASE("order: a large brick sorts as a small one", "[unit]") {
  Random random(2);
  std::vector<PointRecord> points(70001);
  for (PointRecord& p : points)
    p.q = {static_cast<std::int32_t>(random.bits() & 0xffff),
           static_cast<std::int32_t>(random.bits() & 0xffff),
           static_cast<std::int32_t>(random.bits() & 0xffff)};
  BrickSorter sorter;
  const auto sorted = sorter.sort(points);
  const std::vector<PointRecord> all(sorted.begin(), sorted.end());
  CHECK(in_order(all));
  CHECK(all.size() == points.size());
}

TEST_CASE("order: fewer than three different points are refused", "[unit]") {
  std::vector<TestPoint> points(50, TestPoint{{1, 2, 3}, {0, 0, 1}, 0});
  points.push_back({{9, 9, 9}, {0, 0, 1}, 0});
  CHECK_THROWS_AS(run_chain(points), EmptyError);
}

}  // namespace order_test
