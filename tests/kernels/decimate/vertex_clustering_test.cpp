#include "kernels/decimate/vertex_clustering.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <limits>

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

constexpr std::array<std::uint32_t, 3> kGrey = {0xff404040u, 0xff404040u, 0xff404040u};

}  // namespace

TEST_CASE("vertex clustering: a plane stays a plane, every face up, and none twice", "[unit]") {
  VertexClustering clustering(0.101, 10'000);
  each_face(
      200, [](double, double) { return 0.25; },
      [&](const auto& corners) { REQUIRE(clustering.add(corners, kGrey)); });
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
  each_face(200, roof, [&](const auto& corners) { REQUIRE(clustering.add(corners, kGrey)); });
  const ClusteredMesh mesh = clustering.finish();
  double highest = 0.0;
  for (const Double3& p : mesh.position) {
    highest = std::max(highest, p[2]);
    CHECK(std::abs(p[2] - roof(p[0], p[1])) < 0.01);
  }
  CHECK(highest == Approx(0.5).margin(1e-3));
}

TEST_CASE("vertex clustering: too many faces are refused, the size found for them is not", "[unit]") {
  const auto wave = [](double x, double y) { return 0.1 * std::sin(9.0 * x) * std::cos(7.0 * y); };
  VertexClustering fine(0.004, 1'000);
  bool fits = true;
  each_face(300, wave, [&](const auto& corners) { fits = fits && fine.add(corners, kGrey); });
  CHECK_FALSE(fits);

  ClusterSize size(450);
  each_face(300, wave, [&](const auto& corners) {
    for (const Double3& p : corners) size.add(p);
  });
  CHECK(size.is_settled());
  VertexClustering found(size.cell(), 1'000);
  each_face(300, wave, [&](const auto& corners) { CHECK(found.add(corners, kGrey)); });
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
  CHECK(clustering.add({Double3{nan, 0, 0}, Double3{2, 0, 0}, Double3{0, 2, 0}}, kGrey));
  CHECK(clustering.add({Double3{0, 0, 0}, Double3{0, 0, 0}, Double3{0, 0, 0}}, kGrey));
  CHECK(clustering.finish().faces.empty());
}

}  // namespace vertex_clustering_test
