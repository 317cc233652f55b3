#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <vector>

#include "stream/check/mesh_check.h"
#include "stream/check/mesh_crossings.h"
#include "stream/files/json.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/memory_growth.h"
#include "tests/helpers/memory_mesh.h"
#include "tests/helpers/random.h"

namespace tessera::mesh_crossings_test {
namespace {

using test::MemoryMesh;

MeshCrossings crossings(MemoryMesh mesh, std::uint64_t memory_bytes = 64u << 20, int threads = 1,
                        std::vector<std::uint64_t>* faces = nullptr) {
  VertexStore positions({}, true, 1u << 20);
  positions.append(mesh.points());
  MeshCrossingOptions options;
  options.memory_bytes = memory_bytes;
  options.threads = threads;
  if (faces)
    options.faces = [&](std::span<const std::uint64_t> some) {
      faces->insert(faces->end(), some.begin(), some.end());
    };
  return find_crossings(mesh, positions, options);
}

bool same(const MeshCrossings& a, const MeshCrossings& b) {
  return to_json(a) == to_json(b);
}

/// Spheres whose surfaces cross, strewn in a cube; whole multiples of 2^-20, so that they can be moved exactly.
MemoryMesh spheres(std::size_t count, int level, std::uint64_t seed) {
  test::Random random(seed);
  const test::Icosphere sphere = test::icosphere(level);
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  for (std::size_t s = 0; s < count; ++s) {
    const Double3 middle = {static_cast<double>(random.below(1u << 20)) * 0x1p-18,
                            static_cast<double>(random.below(1u << 20)) * 0x1p-18,
                            static_cast<double>(random.below(1u << 20)) * 0x1p-20};
    const std::uint64_t first = points.size();
    for (const Double3& p : sphere.positions) {
      points.push_back(p + middle);
      for (double& x : points.back()) x = std::round(x * 0x1p20) * 0x1p-20;
    }
    for (const auto& f : sphere.faces) faces.push_back({first + f[0], first + f[1], first + f[2]});
  }
  return {points, faces};
}

TEST_CASE("crossings: a torus has none", "[unit]") {
  const MeshCrossings c = crossings(test::torus(60, 30));
  CHECK(c.pairs() == 0);
  CHECK(c.faces == 0);
  CHECK(c.left_out == 0);
  CHECK(c.defects().empty());
}

TEST_CASE("crossings: each kind is counted and listed with its place", "[unit]") {
  // One face in the plane z = 0; one through it, one on it, one that stands on it; one apart.
  const MeshCrossings c = crossings({{{0, 0, 0},
                                      {4, 0, 0},
                                      {0, 4, 0},
                                      {1, 1, -1},
                                      {1, 1, 1},
                                      {1, 2, 0},
                                      {3, 3, 0},
                                      {2, 1, 0},
                                      {9, 3, 0},
                                      {2, 0.5, 0},
                                      {2, 0.5, 1},
                                      {2, 0.75, 1},
                                      {0, 0, 5},
                                      {1, 0, 5},
                                      {0, 1, 5}},
                                     {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}, {9, 10, 11}, {12, 13, 14}}});
  CHECK(c.crossing == 1);
  CHECK(c.overlapping == 1);
  CHECK(c.touching == 1);
  CHECK(c.faces == 4);
  REQUIRE(c.listed.size() == 3);
  CHECK(c.listed[0] == FaceCrossing{FaceContact::kCross, {1, 1.5, 0}, {0, 1}});
  CHECK(c.listed[1].faces == std::array<std::uint64_t, 2>{0, 2});
  CHECK(c.listed[1].contact == FaceContact::kOverlap);
  CHECK(c.listed[2].faces == std::array<std::uint64_t, 2>{0, 3});
  CHECK(c.listed[2].place == Double3{2, 0.625, 0});
  CHECK(c.defects() == std::vector<std::string>{"1 pair of faces crosses", "1 pair of faces overlaps",
                                                "1 pair of faces touches beyond what it shares"});
}

TEST_CASE("crossings: vertices of one place and two numbers touch, merged ones do not", "[unit]") {
  const MemoryMesh seam({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}},
                        {{0, 1, 2}, {3, 5, 4}});
  CHECK(crossings(seam).touching == 1);
  MeshCheckOptions options;
  options.crossings = true;
  MemoryMesh again = seam;
  CHECK(check_mesh(again, options).crossings->touching == 1);
  options.weld = true;
  CHECK(check_mesh(again, options).crossings->pairs() == 0);
}

TEST_CASE("crossings: faces without area or with unknown corners take no part and are counted", "[unit]") {
  const double nan = std::nan("");
  const MeshCrossings c =
      crossings({{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, -1}, {1, 1, 0}, {1, 1, 1}, {nan, 0, 0}},
                 {{0, 1, 2}, {3, 4, 5}, {0, 1, 6}, {0, 0, 1}, {0, 1, 99}}});
  CHECK(c.pairs() == 0);
  CHECK(c.left_out == 4);
}

TEST_CASE("crossings: the cap, the threads and the cells change nothing", "[property]") {
  const MemoryMesh mesh = spheres(60, 3, 1);  // 76,800 faces
  std::vector<std::uint64_t> faces, same_faces;
  const MeshCrossings all = crossings(mesh, 1u << 30, 1, &faces);
  REQUIRE(all.crossing > 5000);
  CHECK(all.listed.size() == kListedCrossings);
  CHECK(faces.size() == all.faces);
  CHECK(std::is_sorted(faces.begin(), faces.end()));
  CHECK(std::adjacent_find(faces.begin(), faces.end()) == faces.end());
  for (const std::uint64_t kilobytes : {600u, 3000u, 20000u})
    for (const int threads : {1, 3}) {
      same_faces.clear();
      CHECK(same(crossings(mesh, kilobytes << 10, threads, &same_faces), all));
      CHECK(same_faces == faces);
    }
}

TEST_CASE("crossings: a search holds no more than it may, however many faces there are", "[memory]") {
  constexpr std::uint64_t kSide = 1000, kMemory = std::uint64_t{8} << 20, kSlack = std::uint64_t{4} << 20;
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  for (std::uint64_t y = 0; y <= kSide; ++y)
    for (std::uint64_t x = 0; x <= kSide; ++x) {
      points.push_back(
          {static_cast<double>(x), static_cast<double>(y), std::sin(0.01 * static_cast<double>(x))});
      if (x == kSide || y == kSide) continue;
      const std::uint64_t a = y * (kSide + 1) + x, b = a + kSide + 1;
      faces.push_back({a, a + 1, b + 1});
      faces.push_back({a, b + 1, b});
    }
  MemoryMesh mesh(points, faces);
  VertexStore positions({}, true, 1u << 20);
  positions.append(mesh.points());
  MeshCrossingOptions options;
  options.memory_bytes = kMemory;
  const std::uint64_t grown = test::growth_of([&] { find_crossings(mesh, positions, options); });
  INFO(grown << " bytes for " << faces.size() << " faces");
  CHECK(grown <= kMemory + kSlack);
}

TEST_CASE("crossings: survey coordinates and the order of faces change no number", "[property]") {
  const MemoryMesh mesh = spheres(12, 3, 2);
  const MeshCrossings all = crossings(mesh, 2u << 20);
  REQUIRE(all.crossing > 500);
  std::vector<Double3> far = mesh.points();
  const Double3 shift = {500000.0, 5400000.0, 300.0};
  for (Double3& p : far) p = p + shift;
  const MeshCrossings moved = crossings({far, mesh.faces()}, 2u << 20);
  CHECK(moved.crossing == all.crossing);
  CHECK(moved.touching == all.touching);
  CHECK(moved.faces == all.faces);
  for (std::size_t i = 0; i < all.listed.size(); ++i) CHECK(moved.listed[i].faces == all.listed[i].faces);

  std::vector<std::size_t> order(mesh.faces().size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  test::Random random(7);
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
  std::vector<MeshFace> shuffled;
  for (const std::size_t f : order) {
    shuffled.push_back(mesh.faces()[f]);
    std::rotate(shuffled.back().begin(), shuffled.back().begin() + 1, shuffled.back().end());
  }
  MeshCrossings permuted = crossings({mesh.points(), shuffled}, 2u << 20);
  CHECK(permuted.crossing == all.crossing);
  CHECK(permuted.faces == all.faces);
  REQUIRE(permuted.listed.size() == all.listed.size());
  for (std::size_t i = 0; i < all.listed.size(); ++i) {
    std::array<std::uint64_t, 2> faces = {order[permuted.listed[i].faces[0]],
                                          order[permuted.listed[i].faces[1]]};
    std::sort(faces.begin(), faces.end());
    CHECK(permuted.listed[i].place == all.listed[i].place);
    CHECK(faces == all.listed[i].faces);
  }
}

TEST_CASE("crossings: more faces in one place than the cap can hold are refused", "[unit]") {
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  for (std::uint64_t f = 0; f < 1200; ++f) {
    points.insert(points.end(), {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
    faces.push_back({3 * f, 3 * f + 1, 3 * f + 2});
  }
  CHECK(crossings({points, faces}).overlapping == 1200 * 1199 / 2);
  CHECK_THROWS_WITH(crossings({points, faces}, 300u << 10), Catch::Contains("raise --memory to"));
}

}  // namespace
}  // namespace tessera::mesh_crossings_test
