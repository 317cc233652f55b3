#include "kernels/smooth/curvature_flow.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "kernels/decimate/decimate.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "tests/helpers/block_meshes.h"

namespace curvature_flow_test {

using namespace tessera;

TEST_CASE("flow: curvature flow shrinks a sphere as the differential equation says", "[unit]") {
  // dr/dt = -2/r: an implicit step of size t takes the radius r to r / (1 + 2 t / r^2).
  MeshBlock sphere = test::sphere_block(5);
  const double t = 0.02;
  const FlowReport report =
      curvature_flow(sphere.position, sphere.faces, std::vector<std::uint8_t>(sphere.position.size(), 0),
                     {.step = t, .steps = 3});
  REQUIRE(report.done());
  double r = 1.0;
  for (int step = 0; step < 3; ++step) r /= 1.0 + 2.0 * t / (r * r);
  double mean = 0.0;
  for (const Double3& p : sphere.position) mean += norm(p) / static_cast<double>(sphere.position.size());
  CHECK(mean == Approx(r).epsilon(0.002));
}

TEST_CASE("flow: curvature flow by multigrid is the flow of the direct solver", "[unit]") {
  MeshBlock direct = test::sphere_block(5);
  test::add_noise(direct, 0.01, 7);
  std::vector<Double3> iterated = direct.position, again = direct.position;
  const std::vector<std::uint8_t> none(direct.position.size(), 0);
  FlowOptions options;
  options.step = 2e-3;
  options.steps = 3;
  REQUIRE(curvature_flow(direct.position, direct.faces, none, options).done());
  options.direct = false;
  REQUIRE(curvature_flow(iterated, direct.faces, none, options).done());
  REQUIRE(curvature_flow(again, direct.faces, none, options).done());
  CHECK(iterated == again);
  double largest = 0.0;
  for (std::size_t v = 0; v < iterated.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a)
      largest = std::max(largest, std::fabs(iterated[v][a] - direct.position[v][a]));
  CHECK(largest < 1e-7);
}

namespace {

Double3 normal(const MeshBlock& block, const std::vector<Double3>& position, std::size_t face) {
  const auto& f = block.faces[face];
  return triangle_normal(position[f[0]], position[f[1]], position[f[2]]);
}

/// Edges whose two faces open more than 90 degrees.
std::size_t folded_edges(const MeshBlock& block, const std::vector<Double3>& position) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> other;
  std::size_t folded = 0;
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t u = block.faces[f][k], v = block.faces[f][(k + 1) % 3];
      const auto [it, fresh] = other.try_emplace({std::min(u, v), std::max(u, v)}, f);
      if (!fresh) folded += dot(normal(block, position, f), normal(block, position, it->second)) < 0.0;
    }
  return folded;
}

/// A mesh as decimation leaves it: short edges where it bends, long and obtuse triangles elsewhere.
MeshBlock decimated(MeshBlock block, double tolerance) {
  const MeshBlock whole = block;
  const std::size_t before = block.faces.size();
  decimate(block, whole, {.tolerance = tolerance});
  REQUIRE(5 * block.faces.size() < before);
  return block;
}

std::vector<std::uint8_t> border_vertices(const MeshBlock& block) {
  std::vector<std::uint8_t> fixed(block.position.size(), 0);
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k)
      if ((block.face_flags[f] >> k & 1) != 0)
        fixed[block.faces[f][k]] = fixed[block.faces[f][(k + 1) % 3]] = 1;
  return fixed;
}

}  // namespace

TEST_CASE("flow: where the factor does not fit, multigrid finds the same surface, and too little is said",
          "[unit]") {
  MeshBlock direct = test::grid_block(200, 200, [](double i, double j) {
    return 0.02 * i * j + ((static_cast<int>(i * 7 + j * 3) % 5) * 0.1);
  });
  std::vector<Double3> iterated = direct.position, refused = direct.position;
  const std::vector<Double3> before = direct.position;
  const std::vector<std::uint8_t> fixed = border_vertices(direct);
  FlowOptions options;
  options.step = 4.0;
  const FlowReport a = curvature_flow(direct.position, direct.faces, fixed, options);
  REQUIRE(a.done());
  CHECK(a.solve.iterations == 0);
  options.memory_bytes = 14'000'000;  // between what multigrid and what a factor of this system need
  const FlowReport b = curvature_flow(iterated, direct.faces, fixed, options);
  INFO(b.choice << "; direct predicted " << a.factor.peak_bytes << "; " << b.factor.message);
  REQUIRE(b.done());
  CHECK(b.solve.iterations > 0);
  double largest = 0.0;
  for (std::size_t v = 0; v < before.size(); ++v)
    largest = std::max(largest, std::fabs(direct.position[v][2] - iterated[v][2]));
  CHECK(largest < 1e-5 * 800);  // the surface is 800 high
  options.memory_bytes = 10000;
  const FlowReport c = curvature_flow(refused, direct.faces, fixed, options);
  CHECK(c.factor.status == SolveStatus::kTooLarge);
  CHECK_FALSE(c.factor.message.empty());
  CHECK(refused == before);
}

TEST_CASE("flow: a wave between fixed borders decays as surface diffusion says", "[unit]") {
  // The border does not bend: sin(pi x) sin(pi y) is a mode of the plate. Right-angled grid: the five-point stencil.
  const int n = 32;
  const double pi = std::acos(-1.0), amplitude = 1e-4;
  MeshBlock block = test::grid_block(
      n, n, [&](double i, double j) { return amplitude * std::sin(pi * i / n) * std::sin(pi * j / n); });
  for (Double3& p : block.position) {  // far away, as survey coordinates are
    p[0] += 4e6;
    p[1] += 5e6;
  }
  const std::vector<Double3> before = block.position;
  const bool direct = GENERATE(true, false);
  FlowOptions options;
  options.order = GENERATE(1, 2);
  const double eigenvalue = 4.0 - 4.0 * std::cos(pi / n), power = std::pow(eigenvalue, options.order);
  options.step = 3.0 / power;
  options.direct = direct;
  const FlowReport report = curvature_flow(block.position, block.faces, border_vertices(block), options);
  REQUIRE(report.done());
  CHECK(report.systems == 1);
  double worst = 0.0;
  for (std::size_t v = 0; v < before.size(); ++v) {
    worst = std::max(worst, std::fabs(block.position[v][2] - before[v][2] / 4.0));
    CHECK(std::fabs(block.position[v][0] - before[v][0]) < 1e-6);
  }
  CHECK(worst < 1e-4 * amplitude);
}

TEST_CASE("flow: a flow folds no face of a decimated sheet or sphere, however long its steps", "[property]") {
  const bool closed = GENERATE(false, true);
  MeshBlock block;
  if (closed) {
    MeshBlock sphere = test::sphere_block(6);
    for (Double3& p : sphere.position) {
      const double w = 1.0 + 0.15 * std::sin(5.0 * p[0]) * std::cos(6.0 * p[1] + p[2]);
      for (double& x : p) x *= w;
    }
    block = decimated(sphere, 0.01);
  } else {
    block = decimated(test::grid_block(120, 120,
                                       [](double i, double j) {
                                         return 6.0 * std::sin(0.15 * i) * std::cos(0.11 * j) + 0.05 * i;
                                       }),
                      0.3);
  }
  const std::vector<std::uint8_t> fixed = border_vertices(block);
  const std::size_t folded = folded_edges(block, block.position);
  FlowOptions options;
  options.order = GENERATE(1, 2);
  options.direct = false;
  const double length = closed ? GENERATE(0.05, 0.3) : GENERATE(3.0, 30.0, 1000.0);
  options.step = std::pow(length, 2 * options.order);
  options.steps = 2;
  std::vector<Double3> position = block.position;
  const FlowReport report = curvature_flow(position, block.faces, fixed, options);
  INFO(block.faces.size() << " faces, order " << options.order << ", length " << length << ": "
                          << report.systems << " systems, " << report.folding_faces << " fold; "
                          << report.solve.message);
  REQUIRE(report.done());
  CHECK(folded_edges(block, position) <= folded);
  if (closed) return;
  // The sheet is a graph over the plane and stays one.
  std::size_t down = 0, was_down = 0;
  double moved = 0.0, aside = 0.0;
  for (std::size_t f = 0; f < block.faces.size(); ++f) {
    down += normal(block, position, f)[2] <= 0.0;
    was_down += normal(block, block.position, f)[2] <= 0.0;
  }
  for (std::size_t v = 0; v < position.size(); ++v) {
    moved = std::max(moved, std::fabs(position[v][2] - block.position[v][2]));
    for (std::size_t a = 0; a < 2; ++a)
      aside = std::max(aside, std::fabs(position[v][a] - block.position[v][a]));
    if (fixed[v] != 0) CHECK(position[v] == block.position[v]);
  }
  CHECK(was_down == 0);
  CHECK(down == 0);
  if (length > 3.0) CHECK(moved > 1.0);
}

TEST_CASE("flow: faces that cannot but fold move as one, a mesh of many is refused and left alone",
          "[unit]") {
  // The mean of the neighbours lies outside a chevron, where the vertex in the middle cannot see all of its border.
  const std::vector<Double3> chevron = {{0, 1, 0.1},    {0, 0, 0},      {9, -8, 0},
                                        {9.2, -7.8, 0}, {9.4, -7.6, 0}, {9.6, -7.4, 0},
                                        {9.8, -7.2, 0}, {0, 4, 0},      {-9, -7, 0}};
  const auto n = static_cast<std::uint32_t>(chevron.size());
  const std::uint32_t copies = GENERATE(1u, 10u);
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint8_t> fixed;
  for (std::uint32_t c = 0; c < copies; ++c)
    for (std::uint32_t k = 0; k < n; ++k) {
      position.push_back({chevron[k][0] + 30.0 * c, chevron[k][1], chevron[k][2]});
      fixed.push_back(k != 0);
      if (k > 0) faces.push_back({n * c, n * c + k, n * c + (k + 1 == n ? 1 : k + 1)});
    }
  const std::vector<Double3> before = position;
  FlowOptions options;
  options.step = 100.0;
  options.weights = LaplacianWeights::kUniform;
  const FlowReport report = curvature_flow(position, faces, fixed, options);
  CHECK(position == before);
  if (copies == 1) {
    CHECK(report.done());
    CHECK(report.faces_as_one > 0);
    CHECK(report.systems == 1);
  } else {
    CHECK_FALSE(report.done());
    CHECK(report.folding_faces > 0);
    CHECK(report.systems > 5);
  }
  options.step = 0.01;
  REQUIRE(curvature_flow(position, faces, fixed, options).done());
  CHECK(position != before);
}

}  // namespace curvature_flow_test
