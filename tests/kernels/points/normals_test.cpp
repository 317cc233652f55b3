#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/points/normals.h"
#include "octree/morton.h"
#include "octree/small_matrix.h"
#include "octree/vector.h"

namespace normals_test {

using namespace tessera;

namespace {

/// Points of a sphere around the centre of `cells`^3, canonical order, in a block at `origin` that holds them all.
PointBlock sphere_block(int cells, float radius, int count, const Int3& origin, const Float3& centre) {
  std::vector<Int3> q;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / count;
    const double r = std::sqrt(1.0 - z * z);
    const double a = 2.399963229728653 * i;
    const double p[3] = {r * std::cos(a), r * std::sin(a), z};
    Int3 at;
    for (std::size_t k = 0; k < 3; ++k)
      at[k] =
          static_cast<std::int32_t>(std::floor((double{centre[k]} + double{radius} * p[k]) * kQuantaPerCell));
    q.push_back(at);
  }
  const auto code = [](const Int3& v) {
    return morton_encode(static_cast<std::uint32_t>(v[0]), static_cast<std::uint32_t>(v[1]),
                         static_cast<std::uint32_t>(v[2]));
  };
  std::sort(q.begin(), q.end(), [&](const Int3& a, const Int3& b) { return code(a) < code(b); });
  PointBlock block;
  block.origin = origin;
  block.cells = {cells, cells, cells};
  for (const Int3& p : q) {
    bool near = true;
    float c[3];
    for (std::size_t k = 0; k < 3; ++k) {
      c[k] = static_cast<float>(p[k] - origin[k] * kQuantaPerCell) / kQuantaPerCell;
      near = near && c[k] >= -4.0f && c[k] < static_cast<float>(cells) + 4.0f;
    }
    if (!near) continue;
    block.x.push_back(c[0]), block.y.push_back(c[1]), block.z.push_back(c[2]);
    block.nx.push_back(0), block.ny.push_back(0), block.nz.push_back(0);
  }
  return block;
}

}  // namespace

TEST_CASE("normals: eigenvectors of a known matrix", "[unit]") {
  Double3 values;
  std::array<Double3, 3> v;
  symmetric_eigen3({2, 1, 0, 2, 0, 5}, values, v);
  CHECK(values[0] == Approx(1.0));
  CHECK(values[1] == Approx(3.0));
  CHECK(values[2] == Approx(5.0));
  CHECK(std::fabs(v[0][0]) == Approx(std::sqrt(0.5)));
  CHECK(v[0][0] * v[0][1] == Approx(-0.5));
}

TEST_CASE("normals: a sphere's normals are radial, whatever the block", "[property]") {
  const Float3 centre = {64.3f, 64.1f, 63.7f};
  const PointBlock large = sphere_block(128, 40.0f, 30000, {0, 0, 0}, centre);
  const auto shapes = estimate_shapes(large, {});
  REQUIRE(shapes.size() == large.size());
  double worst = 0.0;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const Double3 d = {large.x[i] - centre[0], large.y[i] - centre[1], large.z[i] - centre[2]};
    const double r = norm(d);
    const auto& n = shapes[i].normal;
    const double c = std::fabs(dot(d, wide(n))) / r;
    worst = std::max(worst, 1.0 - c);
  }
  CHECK(worst < 1e-3);

  const PointBlock small = sphere_block(64, 40.0f, 30000, {64, 64, 64}, centre);
  const auto again = estimate_shapes(small, {});
  std::size_t s = 0;
  std::size_t compared = 0;
  for (std::size_t i = 0; i < large.size(); ++i) {
    if (large.x[i] < 64 || large.y[i] < 64 || large.z[i] < 64) continue;
    REQUIRE(s < again.size());
    CHECK(shapes[i].normal == again[s].normal);
    CHECK(shapes[i].residual == again[s].residual);
    CHECK(shapes[i].neighbours == again[s].neighbours);
    ++s, ++compared;
  }
  CHECK(compared > 1000);
  CHECK(s == again.size());
}

TEST_CASE("normals: points of one line have none, two lines have", "[unit]") {
  const bool two = GENERATE(false, true);
  PointBlock block;
  block.cells = {8, 8, 8};
  for (int i = 0; i < 160; ++i) {
    const float along = 0.025f + 0.05f * static_cast<float>(two ? i / 2 * 2 : i);
    block.x.push_back(along), block.y.push_back(two && i % 2 == 1 ? 4.5f : 4.0f), block.z.push_back(4.0f);
    block.nx.push_back(0), block.ny.push_back(0), block.nz.push_back(0);
  }
  std::vector<std::size_t> order(block.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto code = [&](std::size_t i) {
    const auto q = [](float v) { return static_cast<std::uint32_t>(v * kQuantaPerCell); };
    return morton_encode(q(block.x[i]), q(block.y[i]), q(block.z[i]));
  };
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return code(a) < code(b); });
  PointBlock sorted = block;
  for (std::size_t i = 0; i < order.size(); ++i)
    sorted.x[i] = block.x[order[i]], sorted.y[i] = block.y[order[i]];
  const std::vector<PointShape> shapes = estimate_shapes(sorted, {});
  REQUIRE(shapes.size() == sorted.size());
  for (const PointShape& shape : shapes) {
    CHECK(std::fabs(shape.normal[2]) == Approx(two ? 1.0 : 0.0).margin(1e-3));
    CHECK((shape.normal[0] == 0.0f && shape.normal[1] == 0.0f && shape.normal[2] == 0.0f) == !two);
  }
}

}  // namespace normals_test
