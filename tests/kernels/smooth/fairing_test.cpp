#include "kernels/smooth/curvature_flow.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "kernels/decimate/decimate.h"
#include "octree/error.h"
#include "tests/helpers/block_meshes.h"

namespace {

using namespace tessera;

/// Free where all coordinates are more than `rim` inside the grid of n squares.
std::vector<std::uint8_t> inner_vertices(const MeshBlock& block, int n, int rim) {
  std::vector<std::uint8_t> region;
  for (const Double3& p : block.position)
    region.push_back(p[0] > rim - 0.5 && p[0] < n - rim + 0.5 && p[1] > rim - 0.5 && p[1] < n - rim + 0.5);
  return region;
}

/// Largest error after the inside of a unit square was faired against the rings of `height`. Heights are
/// scaled down: the operator sees a plane.
double worst_error(int n, int order, const std::function<double(double, double)>& height) {
  constexpr double kScale = 1e-4;
  MeshBlock block = test::grid_block(n, n, [&](double i, double j) { return kScale * height(i / n, j / n); });
  const std::vector<std::uint8_t> region = inner_vertices(block, n, order);
  for (Double3& p : block.position) p = {p[0] / n, p[1] / n, p[2]};
  const std::vector<Double3> right = block.position;
  for (std::size_t v = 0; v < region.size(); ++v)
    if (region[v] != 0) block.position[v][2] = 0.0;
  const FairingReport report = fair_region(block.position, block.faces, region, {.order = order});
  REQUIRE(report.done());
  double worst = 0.0;
  for (std::size_t v = 0; v < region.size(); ++v)
    worst = std::max(worst, std::fabs(block.position[v][2] - right[v][2]) / kScale);
  return worst;
}

}  // namespace

TEST_CASE("fairing: the order-k surface reproduces polynomials that Delta^k maps to zero", "[unit]") {
  // Right-angled grid: the discrete Laplacian is the five-point stencil, exact for these.
  const auto saddle = [](double x, double y) { return 1.0 + x * x - y * y + 2.0 * x * y; };
  const auto biharmonic = [](double x, double y) { return x * x + 2.0 * y * y + x * x * x; };
  const auto triharmonic = [](double x, double y) { return x * x * x * x + x * y * y * y; };
  CHECK(worst_error(16, 1, saddle) < 1e-5);
  CHECK(worst_error(16, 2, biharmonic) < 1e-5);
  CHECK(worst_error(16, 3, triharmonic) < 1e-4);
  CHECK(worst_error(16, 1, biharmonic) > 0.05);
  CHECK(worst_error(16, 2, triharmonic) > 1e-3);
}

TEST_CASE("fairing: a dented sphere heals, the better the higher the order", "[unit]") {
  MeshBlock sphere = test::sphere_block(5);
  const std::vector<Double3> right = sphere.position;
  std::vector<std::uint8_t> region;
  for (Double3& p : sphere.position) {
    region.push_back(p[2] > 0.8);
    if (p[2] > 0.8) p[2] = 0.8;
  }
  std::vector<double> worst;
  for (const int order : {1, 2, 3}) {
    std::vector<Double3> position = sphere.position;
    const FairingReport report = fair_region(position, sphere.faces, region, {.order = order, .rounds = 3});
    REQUIRE(report.done());
    CHECK(report.solve.residual < 1e-8);
    double error = 0.0;
    for (std::size_t v = 0; v < region.size(); ++v) {
      const Double3& p = position[v];
      if (region[v] == 0) CHECK(p == right[v]);
      error = std::max(error, std::fabs(std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - 1.0));
    }
    worst.push_back(error);
  }
  CHECK(worst[1] < 0.5 * worst[0]);
  CHECK(worst[2] < worst[1]);
  CHECK(worst[1] < 0.05);
}

TEST_CASE("fairing: a region without boundary is reported and left alone", "[unit]") {
  MeshBlock sphere = test::sphere_block(2);
  const std::vector<Double3> before = sphere.position;
  const std::vector<std::uint8_t> all(before.size(), 1);
  const FairingReport report = fair_region(sphere.position, sphere.faces, all, {});
  CHECK_FALSE(report.done());
  CHECK(report.solve.status == SolveStatus::kSingular);
  CHECK(sphere.position == before);
  CHECK_THROWS_AS(fair_region(sphere.position, sphere.faces, std::vector<std::uint8_t>(before.size(), 0), {}),
                  UsageError);
  CHECK_THROWS_AS(fair_region(sphere.position, sphere.faces, all, {.order = 4}), UsageError);
}

TEST_CASE("fairing: too little memory for the factor is predicted and said", "[unit]") {
  MeshBlock block = test::grid_block(60, 60, [](double, double) { return 0.0; });
  const std::vector<Double3> before = block.position;
  const FairingReport report =
      fair_region(block.position, block.faces, inner_vertices(block, 60, 2), {.memory_bytes = 10000});
  CHECK(report.factor.status == SolveStatus::kTooLarge);
  CHECK_FALSE(report.factor.message.empty());
  CHECK(block.position == before);
}

TEST_CASE("fairing: curvature flow shrinks a sphere as the differential equation says", "[unit]") {
  // dr/dt = -2/r: an implicit step of size t takes the radius r to r / (1 + 2 t / r^2).
  MeshBlock sphere = test::sphere_block(5);
  const double t = 0.02;
  const FairingReport report =
      curvature_flow(sphere.position, sphere.faces, std::vector<std::uint8_t>(sphere.position.size(), 0),
                     {.step = t, .steps = 3});
  REQUIRE(report.done());
  double r = 1.0;
  for (int step = 0; step < 3; ++step) r /= 1.0 + 2.0 * t / (r * r);
  double mean = 0.0;
  for (const Double3& p : sphere.position)
    mean += std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / static_cast<double>(sphere.position.size());
  CHECK(mean == Approx(r).epsilon(0.002));
}

TEST_CASE("fairing: where the factor does not fit, multigrid finds the same surface", "[unit]") {
  const auto dent = [](double i, double j) {
    return 0.02 * i * j + ((static_cast<int>(i * 7 + j * 3) % 5) * 0.1);
  };
  MeshBlock direct = test::grid_block(200, 200, dent), iterated = direct;
  const int order = GENERATE(1, 2);
  const auto region = inner_vertices(direct, 200, order);
  const FairingReport a = fair_region(direct.position, direct.faces, region, {.order = order});
  REQUIRE(a.done());
  CHECK(a.solve.iterations == 0);
  // Between what multigrid and what a factor of this system need.
  const std::uint64_t cap = order == 1 ? 14'000'000 : 40'000'000;
  const FairingReport b =
      fair_region(iterated.position, iterated.faces, region, {.order = order, .memory_bytes = cap});
  INFO(b.choice << "; direct predicted " << a.factor.peak_bytes << "; " << b.factor.message);
  REQUIRE(b.done());
  CHECK(b.solve.iterations > 0);
  double largest = 0.0;
  for (std::size_t v = 0; v < direct.position.size(); ++v)
    largest = std::max(largest, std::fabs(direct.position[v][2] - iterated.position[v][2]));
  CHECK(largest < 1e-5 * 800);  // the surface is 800 high
}

TEST_CASE("fairing: curvature flow by multigrid is the flow of the direct solver", "[unit]") {
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
  Double3 u, v;
  for (std::size_t a = 0; a < 3; ++a) {
    u[a] = position[f[1]][a] - position[f[0]][a];
    v[a] = position[f[2]][a] - position[f[0]][a];
  }
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

double along(const Double3& a, const Double3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Edges whose two faces open more than 90 degrees.
std::size_t folded_edges(const MeshBlock& block, const std::vector<Double3>& position) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> other;
  std::size_t folded = 0;
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t u = block.faces[f][k], v = block.faces[f][(k + 1) % 3];
      const auto [it, fresh] = other.try_emplace({std::min(u, v), std::max(u, v)}, f);
      if (!fresh) folded += along(normal(block, position, f), normal(block, position, it->second)) < 0.0;
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

TEST_CASE("fairing: a wave between fixed borders decays as surface diffusion says", "[unit]") {
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

TEST_CASE("fairing: a flow folds no face of a decimated sheet or sphere, however long its steps",
          "[property]") {
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

TEST_CASE("fairing: faces that cannot but fold move as one, a mesh of many is refused and left alone",
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
