#include "kernels/decimate/vertex_clustering.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <limits>
#include <vector>

namespace vertex_clustering_test {

using namespace tessera;

namespace {

/// z = height(x, y) over [0, 1]^2, side x side x 2 faces.
template <class Height, class Use>
void each_face(int side, const Height& height, const Use& use) {
  const auto at = [&](int i, int j) {
    const double x = static_cast<double>(i) / side, y = static_cast<double>(j) / side;
    return Double3{x, y, height(x, y)};
  };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      use(std::array{at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      use(std::array{at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
}

constexpr std::uint32_t kGrey = 0xff404040u;

/// A face with vertices of its own.
void add(VertexClustering& clustering, const std::array<Double3, 3>& corners, bool with_shape = true) {
  std::array<std::uint32_t, 3> cells{};
  for (std::size_t k = 0; k < 3; ++k) cells[k] = clustering.add_vertex(corners[k], kGrey);
  clustering.add_face(cells);
  if (with_shape) clustering.add_shape(corners, cells);
}

}  // namespace

TEST_CASE("vertex clustering: a plane stays a plane, every face up, and none twice", "[unit]") {
  VertexClustering clustering(0.101, 10'000);
  each_face(
      200, [](double, double) { return 0.25; }, [&](const auto& corners) { add(clustering, corners); });
  REQUIRE(clustering.fits());
  const ClusteredMesh mesh = clustering.finish();
  CHECK(mesh.position.size() == 100);  // 10 x 10 cells
  CHECK(mesh.faces.size() == 162);     // 9 x 9 squares
  double area = 0.0;
  for (const auto& f : mesh.faces) {
    const Double3 n =
        cross(mesh.position[f[1]] - mesh.position[f[0]], mesh.position[f[2]] - mesh.position[f[0]]);
    CHECK(n[2] > 0.0);
    area += 0.5 * n[2];
  }
  CHECK(area > 0.75);
  for (std::size_t i = 0; i < mesh.position.size(); ++i) {
    CHECK(std::abs(mesh.position[i][2] - 0.25) < 1e-9);
    CHECK(mesh.rgba[i] == 0xff404040u);
  }
}

TEST_CASE("vertex clustering: a crease is kept where cells hold both of its sides", "[unit]") {
  VertexClustering clustering(0.101, 10'000);
  const auto roof = [](double x, double) { return 0.5 - std::abs(x - 0.55); };
  each_face(200, roof, [&](const auto& corners) { add(clustering, corners); });
  REQUIRE(clustering.fits());
  const ClusteredMesh mesh = clustering.finish();
  double highest = 0.0;
  for (const Double3& p : mesh.position) {
    highest = std::max(highest, p[2]);
    CHECK(std::abs(p[2] - roof(p[0], p[1])) < 0.01);
  }
  CHECK(highest == Approx(0.5).margin(1e-3));
}

TEST_CASE("vertex clustering: some of the faces shape cells as all of them do, and none leaves their mean",
          "[unit]") {
  const auto roof = [](double x, double) { return 0.5 - std::abs(x - 0.55); };
  VertexClustering all(0.101, 10'000), some(0.101, 10'000), none(0.101, 10'000);
  int face = 0;
  each_face(200, roof, [&](const auto& corners) {
    add(all, corners);
    add(some, corners, face++ % 7 == 0);
    add(none, corners, false);
  });
  const ClusteredMesh want = all.finish(), sampled = some.finish(), means = none.finish();
  CHECK(sampled.faces == want.faces);
  CHECK(means.faces == want.faces);
  double farthest = 0.0, highest = 0.0;
  for (std::size_t i = 0; i < want.position.size(); ++i) {
    farthest = std::max(farthest, norm(sampled.position[i] - want.position[i]));
    highest = std::max(highest, means.position[i][2]);
    CHECK(sampled.rgba[i] == want.rgba[i]);
  }
  CHECK(farthest < 0.002);  // a fiftieth of a cell
  CHECK(highest < 0.49);    // what nothing shapes has no ridge
}

TEST_CASE("vertex clustering: the cell of a vertex is found again, among more cells than are at hand",
          "[unit]") {
  VertexClustering clustering(0.01, 40'000);
  std::vector<std::uint32_t> cells;
  for (int i = 0; i < 10'000; ++i)
    cells.push_back(clustering.add_vertex({0.01 * (i % 100), 0.01 * (i / 100), 0.004}));
  CHECK(clustering.fits());
  for (int i = 0; i < 10'000; ++i)
    CHECK(clustering.cell_of({0.01 * (i % 100), 0.01 * (i / 100), 0.004}) ==
          cells[static_cast<std::size_t>(i)]);
  CHECK(clustering.cell_of({7.0, 7.0, 7.0}) == VertexClustering::kNoCell);
}

TEST_CASE("vertex clustering: too many faces are refused, the size found for them is not", "[unit]") {
  const auto wave = [](double x, double y) { return 0.1 * std::sin(9.0 * x) * std::cos(7.0 * y); };
  VertexClustering fine(0.004, 1'000);
  each_face(300, wave, [&](const auto& corners) { add(fine, corners); });
  CHECK_FALSE(fine.fits());

  ClusterSize size(450);
  each_face(300, wave, [&](const auto& corners) {
    for (const Double3& p : corners) size.add(p);
  });
  CHECK(size.is_settled());
  VertexClustering found(size.cell(), 1'000);
  each_face(300, wave, [&](const auto& corners) { add(found, corners); });
  CHECK(found.fits());
  CHECK(found.finish().faces.size() > 400);  // and it is not needlessly coarse
}

TEST_CASE("vertex clustering: a size that begins too coarse is told, and found from a finer one", "[unit]") {
  const auto points = [](ClusterSize& size) {
    size.add({0, 0, 0});
    size.add({1, 1, 0});
    for (int i = 0; i < 10'000; ++i) size.add({0.01 * (i % 100), 0.01 * (i / 100), 0});
  };
  ClusterSize coarse(900);
  points(coarse);
  CHECK_FALSE(coarse.is_settled());
  ClusterSize fine(900, coarse.cell() / 1024.0);
  points(fine);
  CHECK(fine.is_settled());
  CHECK(fine.cell() > 0.03);
  CHECK(fine.cell() < 0.05);
}

TEST_CASE("vertex clustering: what is not finite, of one point or of any size does no harm", "[unit]") {
  ClusterSize size(10);
  CHECK(size.cell() == 0.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  size.add({nan, 0, 0});
  size.add({1, 1, 1});
  size.add({1, 1, 1});
  CHECK(size.cell() == 0.0);
  size.add({1, 1, 1 + 1e-9});
  CHECK(size.cell() > 0.0);
  size.add({1e30, -1e30, 0});
  size.add({-1e30, 1e30, 7});
  CHECK(size.cell() > 1e23);  // both ends within the range of keys
  const ClusterLattice grid(size.cell());
  CHECK(grid.key({1e30, 0, 0}) != grid.key({-1e30, 0, 0}));

  VertexClustering clustering(1.0, 10);
  add(clustering, {Double3{nan, 0, 0}, Double3{2, 0, 0}, Double3{0, 2, 0}});
  add(clustering, {Double3{0, 0, 0}, Double3{0, 0, 0}, Double3{0, 0, 0}});
  CHECK(clustering.add_vertex({nan, 0, 0}) == VertexClustering::kNoCell);
  CHECK(clustering.cell_of({nan, 0, 0}) == VertexClustering::kNoCell);
  CHECK(clustering.fits());
  CHECK(clustering.finish().faces.empty());
}

}  // namespace vertex_clustering_test
