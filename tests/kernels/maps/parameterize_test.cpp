#include "kernels/maps/parameterize.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/maps/disk_topology.h"
#include "octree/error.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/irregular_mesh.h"

namespace parameterize_test {

namespace {

using namespace tessera;

TriangleSpan span_of(const MeshBlock& block) {
  return {block.position, block.faces};
}

std::string refusal(const MeshBlock& block, const ParameterizeOptions& options = {}) {
  try {
    static_cast<void>(parameterize(span_of(block), options));
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

MeshBlock cap() {
  const MeshBlock sphere = test::sphere_block(5);
  MeshBlock piece = test::piece_of(sphere, [&](std::uint32_t v) { return sphere.position[v][2] > 0.3; });
  return test::make_block(piece.position, piece.faces);
}

}  // namespace

TEST_CASE("parameterize: a flat mesh maps onto itself", "[unit]") {
  MeshBlock block = test::grid_block(20, 14, [](double, double) { return 0.0; });
  for (std::size_t v = 0; v < block.position.size(); ++v) {  // irregular inside
    Double3& p = block.position[v];
    if (p[0] > 0 && p[0] < 20 && p[1] > 0 && p[1] < 14) p[0] += 0.2 * std::sin(double(v));
  }
  SECTION("least squares conformal: a similarity") {
    const Parameterization map = parameterize(span_of(block), {});
    CHECK(map.report.distortion.largest_angle_deg < 1e-5);
    CHECK(map.report.distortion.mean_quasi_conformal == Approx(1.0));
    CHECK(map.report.distortion.largest_area_ratio == Approx(1.0));
    CHECK(map.report.distortion.flipped == 0);
  }
  SECTION("conformal on the square: the affine map") {
    ParameterizeOptions options;
    options.method = ParameterMethod::kConformal;
    options.border = ParameterBorder::kSquare;
    MeshBlock square = test::grid_block(12, 12, [](double, double) { return 0.0; });
    const Parameterization map = parameterize(span_of(square), options);
    for (std::size_t v = 0; v < square.position.size(); ++v) {
      CHECK(std::fabs(map.uv[v][0] - square.position[v][0] / 12) < 1e-9);
      CHECK(std::fabs(map.uv[v][1] - square.position[v][1] / 12) < 1e-9);
    }
  }
}

TEST_CASE("parameterize: a cap of a sphere is mapped with little change of angles", "[unit]") {
  const MeshBlock block = cap();
  const Parameterization free_border = parameterize(span_of(block), {});
  CHECK(free_border.report.distortion.flipped == 0);
  CHECK(free_border.report.distortion.collapsed == 0);
  CHECK(free_border.report.distortion.mean_angle_deg < 1.0);
  CHECK(free_border.report.solve.residual < 1e-8);
  ParameterizeOptions options;
  options.method = ParameterMethod::kConformal;
  const Parameterization disk = parameterize(span_of(block), options);
  CHECK(disk.report.distortion.flipped == 0);
  CHECK(disk.report.distortion.mean_angle_deg < 3.0);
  const SurfaceTopology topology = surface_topology(span_of(block));
  for (const std::uint32_t v : topology.loops[0])
    CHECK(std::hypot(disk.uv[v][0] - 0.5, disk.uv[v][1] - 0.5) == Approx(0.5));
  for (const Parameterization* map : {&free_border, &disk})
    for (const Double2& p : map->uv) CHECK((p[0] >= 0 && p[0] <= 1 && p[1] >= 0 && p[1] <= 1));
}

TEST_CASE("parameterize: clamped weights keep every triangle upright on a bad mesh", "[unit]") {
  // Slivers across the grain: cotangents turn negative.
  MeshBlock block = test::grid_block(
      24, 24, [](double i, double j) { return 4.0 * std::sin(0.4 * i) * std::cos(0.5 * j); });
  for (Double3& p : block.position) p[1] = 0.08 * p[1] + 0.3 * p[0];
  ParameterizeOptions options;
  options.method = ParameterMethod::kConformal;
  const Parameterization plain = parameterize(span_of(block), options);
  CHECK(plain.report.negative_weights > 0);
  options.clamp_weights = true;
  CHECK(parameterize(span_of(block), options).report.distortion.flipped == 0);
}

TEST_CASE("parameterize: what is no disk is refused and named", "[unit]") {
  CHECK(refusal(test::sphere_block(2)).find("Euler characteristic 2, 0 borders, 1 piece") !=
        std::string::npos);
  const MeshBlock grid = test::grid_block(9, 9, [](double, double) { return 0.0; });
  SECTION("a ring has two borders") {
    const MeshBlock ring = test::piece_of(grid, [&](std::uint32_t v) {
      return std::hypot(grid.position[v][0] - 4.5, grid.position[v][1] - 4.5) > 2.0;
    });
    CHECK(refusal(ring).find("Euler characteristic 0, 2 borders, 1 piece") != std::string::npos);
  }
  SECTION("two pieces") {
    const MeshBlock two = test::piece_of(
        grid, [&](std::uint32_t v) { return grid.position[v][0] < 3 || grid.position[v][0] > 6; });
    CHECK(refusal(two).find("Euler characteristic 2, 2 borders, 2 pieces") != std::string::npos);
  }
  SECTION("three faces at an edge") {
    const MeshBlock fan = test::make_block({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}},
                                           {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}});
    CHECK(refusal(fan).find("1 edge with more than two faces") != std::string::npos);
  }
  SECTION("a face without an area") {
    MeshBlock flat = grid;
    flat.position[33] = flat.position[34];
    CHECK(refusal(flat).find("no area") != std::string::npos);
  }
  SECTION("not a number") {
    MeshBlock bad = grid;
    bad.position[40][2] = std::nan("");
    CHECK_FALSE(refusal(bad).empty());
  }
  SECTION("nothing") {
    CHECK_FALSE(refusal(MeshBlock{}).empty());
  }
}

TEST_CASE("parameterize: unused vertices do no harm, one triangle is a disk", "[unit]") {
  MeshBlock block = test::grid_block(6, 6, [](double, double) { return 0.0; });
  block.position.push_back({100, 100, 100});
  CHECK(parameterize(span_of(block), {}).report.distortion.flipped == 0);
  const MeshBlock one = test::make_block({{0, 0, 0}, {2, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  for (const ParameterMethod method :
       {ParameterMethod::kConformal, ParameterMethod::kLeastSquaresConformal}) {
    ParameterizeOptions options;
    options.method = method;
    CHECK(parameterize(span_of(one), options).report.distortion.flipped == 0);
  }
}

TEST_CASE("parameterize: too little memory is said before the factor is tried", "[unit]") {
  ParameterizeOptions options;
  options.memory_bytes = 50000;
  CHECK_THROWS_AS(parameterize(span_of(cap()), options), ResourceError);
}

TEST_CASE("parameterize: where the factor does not fit, multigrid finds the same map", "[unit]") {
  const MeshBlock sheet =
      test::grid_block(200, 200, [](double i, double j) { return 0.002 * i * j + 3.0 / (1.0 + i); });
  ParameterizeOptions options;
  SECTION("fixed border") {
    options.method = ParameterMethod::kConformal;
  }
  SECTION("free border") {
    options.method = ParameterMethod::kLeastSquaresConformal;
  }
  const Parameterization direct = parameterize(span_of(sheet), options);
  CHECK(direct.report.solve.iterations == 0);
  options.memory_bytes = parameterize_bytes(sheet.position.size(), options.method);
  const Parameterization iterated = parameterize(span_of(sheet), options);
  CHECK_THAT(iterated.report.choice, Catch::Contains("multigrid"));
  CHECK(iterated.report.solve.iterations > 0);
  CHECK(iterated.report.solve.residual < 2e-8);
  double largest = 0.0;
  for (std::size_t v = 0; v < direct.uv.size(); ++v)
    for (std::size_t k = 0; k < 2; ++k)
      largest = std::max(largest, std::fabs(direct.uv[v][k] - iterated.uv[v][k]));
  CHECK(largest < 2e-6);
  const ParameterDistortion &a = direct.report.distortion, &b = iterated.report.distortion;
  CHECK(b.flipped == a.flipped);
  CHECK(b.mean_angle_deg == Approx(a.mean_angle_deg).epsilon(1e-3));
  CHECK(b.largest_angle_deg == Approx(a.largest_angle_deg).epsilon(1e-3));
  options.memory_bytes -= 1;
  CHECK_THROWS_AS(parameterize(span_of(sheet), options), ResourceError);
}

TEST_CASE("parameterize: a free border by multigrid on irregular and flat meshes", "[unit]") {
  const auto by_multigrid = [](const TriangleSpan& mesh) {
    ParameterizeOptions options;
    options.memory_bytes = parameterize_bytes(mesh.positions.size(), options.method);
    return parameterize(mesh, options);
  };
  SECTION("slivers and graded density: as the factor") {
    const test::IrregularMesh mesh = test::irregular_mesh({.side = 120, .stretch = 3.0});
    const TriangleSpan span{mesh.positions, mesh.faces};
    const Parameterization direct = parameterize(span, {}), iterated = by_multigrid(span);
    CHECK(iterated.report.solve.iterations > 0);
    CHECK(iterated.report.solve.iterations < 150);
    CHECK(iterated.report.distortion.mean_angle_deg ==
          Approx(direct.report.distortion.mean_angle_deg).epsilon(1e-3));
    CHECK(iterated.report.distortion.flipped == direct.report.distortion.flipped);
  }
  SECTION("stretched: levels shrink slowly, and still fit what was told") {
    const test::IrregularMesh mesh = test::irregular_mesh({.side = 120, .stretch = 100.0, .height = 0.0});
    const Parameterization map = by_multigrid({mesh.positions, mesh.faces});
    CHECK(map.report.solve.iterations > 0);
    CHECK(map.report.factor.bytes < 200 * mesh.positions.size() + 2'000'000);
    CHECK(map.report.distortion.largest_angle_deg < 1.0);
  }
  SECTION("flat: a similarity") {
    const MeshBlock block = test::grid_block(120, 100, [](double, double) { return 0.0; });
    const Parameterization map = by_multigrid(span_of(block));
    CHECK(map.report.solve.iterations > 0);
    CHECK(map.report.distortion.largest_angle_deg < 1e-2);
    CHECK(map.report.distortion.flipped == 0);
  }
  SECTION("unused vertices") {
    MeshBlock block = test::grid_block(110, 110, [](double i, double j) { return 0.01 * i * j; });
    const Parameterization before = by_multigrid(span_of(block));
    block.position.push_back({100, 100, 100});
    const Parameterization map = by_multigrid(span_of(block));
    CHECK(map.report.solve.iterations > 0);
    CHECK(map.report.distortion.mean_angle_deg == Approx(before.report.distortion.mean_angle_deg));
    CHECK(map.uv.back() == Double2{0, 0});
  }
}

}  // namespace parameterize_test
