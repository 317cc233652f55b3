#include "kernels/smooth/smooth.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <map>

#include "octree/error.h"
#include "octree/vector.h"
#include "solvers/linear_solver.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/cholmod_solver.h"

namespace smooth_test {

namespace {

using namespace tessera;

double distance(const Double3& a, const Double3& b) {
  return norm(a - b);
}

SmoothRound only_round(SmoothOptions options) {
  const auto rounds = smooth_rounds(options);
  REQUIRE(rounds.size() == 1);
  return rounds[0];
}

std::size_t vertex_at(const MeshBlock& block, double x, double y) {
  for (std::size_t v = 0; v < block.position.size(); ++v)
    if (block.position[v][0] == x && block.position[v][1] == y) return v;
  FAIL("no such vertex");
  return 0;
}

double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v * v;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

}  // namespace

TEST_CASE("smooth: a wave on a grid decays as the symbol of the Laplacian says", "[unit]") {
  // Right-angled triangles: the diagonal weighs nothing and A has eigenvalue 1 - (cos p + cos q) / 2.
  const double p = 0.7, q = 1.1, amplitude = 1e-4;
  const auto wave = [&](double i, double j) { return amplitude * std::cos(p * i) * std::cos(q * j); };
  const MeshBlock block = test::grid_block(72, 72, wave);
  const double mu = 1.0 - 0.5 * (std::cos(p) + std::cos(q));
  SmoothOptions options;
  options.feature_angle_deg = 0;
  double expected = 0.0, accuracy = 1e-4;
  SECTION("explicit") {
    options.method = "laplacian";
    options.steps = 6;
    options.lambda = 0.4;
    expected = std::pow(1 - 0.4 * mu, 6);
  }
  SECTION("explicit, squared") {
    options.method = "bilaplacian";
    options.steps = 4;
    options.lambda = 0.2;
    expected = std::pow(1 - 0.2 * mu * mu, 4);
  }
  SECTION("Taubin") {
    options.method = "taubin";
    options.steps = 5;
    const double second = 1 / (0.1 - 1 / 0.5);
    expected = std::pow((1 - 0.5 * mu) * (1 - second * mu), 5);
  }
  SECTION("implicit") {
    options.lambda = 4;
    expected = 1 / (1 + 4 * mu);
    accuracy = 1e-3;
  }
  SECTION("implicit, thin plate") {
    options.lambda = 4;
    options.order = 2;
    expected = 1 / (1 + 4 * mu * mu);
    accuracy = 1e-3;
  }
  const SmoothedBlock out = smooth_block(block, only_round(options));
  const std::size_t v = vertex_at(block, 36, 36);
  REQUIRE(std::fabs(block.position[v][2]) > 0.1 * amplitude);
  CHECK(std::fabs(out.position[v][2] / block.position[v][2] - expected) < accuracy);
}

TEST_CASE("smooth: harmonics of the sphere shrink in the order of their frequencies", "[unit]") {
  const MeshBlock sphere = test::sphere_block(5);
  const SurfaceRows rows = make_surface_rows(sphere, FaceCorners(sphere), {});
  std::vector<double> area(sphere.position.size(), 0.0);
  for (const auto& f : sphere.faces) {
    const Double3 &p = sphere.position[f[0]], &q = sphere.position[f[1]], &r = sphere.position[f[2]];
    const Double3 a = q - p, b = r - p;
    const double doubled = norm(cross(a, b));
    for (const std::uint32_t v : f) area[v] += doubled / 6;
  }
  // Rayleigh quotients of x (a harmonic of degree 1, eigenvalue 2) and x y (degree 2, eigenvalue 6). A row
  // sums both cotangents of an edge, twice the stiffness.
  double first = 0.0, second = 0.0, first_mass = 0.0, second_mass = 0.0;
  for (std::size_t v = 0; v < sphere.position.size(); ++v) {
    double ax = 0.0, axy = 0.0;
    const Double3& p = sphere.position[v];
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e) {
      const Double3& q = sphere.position[rows.neighbour[e]];
      const double w = static_cast<double>(rows.weight[e]);
      ax += w * (p[0] - q[0]);
      axy += w * (p[0] * p[1] - q[0] * q[1]);
    }
    first += 0.5 * p[0] * ax;
    second += 0.5 * p[0] * p[1] * axy;
    first_mass += area[v] * p[0] * p[0];
    second_mass += area[v] * p[0] * p[0] * p[1] * p[1];
  }
  CHECK(first / first_mass == Approx(2.0).epsilon(0.005));
  CHECK(second / second_mass == Approx(6.0).epsilon(0.005));
  SmoothOptions options;
  options.feature_angle_deg = 0;
  const SmoothedBlock out = smooth_block(sphere, only_round(options));
  for (std::size_t v = 0; v < out.position.size(); ++v) {
    CHECK(norm(out.position[v]) < 1.0);
    if (norm(out.position[v]) < 0.97) FAIL("shrinks more than ten rings can");
  }
}

TEST_CASE("smooth: a plane stays a plane, constants stay exactly", "[unit]") {
  MeshBlock block = test::grid_block(20, 20, [](double i, double j) { return 3.0 + 0.25 * i - 0.5 * j; });
  for (Double3& p : block.position) {  // far away, as survey coordinates are
    p[0] += 4e6;
    p[1] += 5e6;
  }
  SmoothOptions options;
  options.method = GENERATE("implicit", "laplacian", "bilaplacian", "taubin", "bilateral");
  const SmoothedBlock out = smooth_block(block, only_round(options));
  for (std::size_t v = 0; v < out.position.size(); ++v) {
    const Double3& p = out.position[v];
    CHECK(std::fabs(p[2] - (3.0 + 0.25 * (p[0] - 4e6) - 0.5 * (p[1] - 5e6))) < 1e-7);
    CHECK(distance(p, block.position[v]) < 1e-6);
  }
}

TEST_CASE("smooth: a vertex has the same bits in every block with enough rings around it", "[property]") {
  MeshBlock whole = test::sphere_block(5);
  for (Double3& p : whole.position)
    if (p[0] < 0) p[0] *= 0.3;  // a crease from pole to pole
  test::add_noise(whole, 0.004, 3);
  SmoothOptions options;
  options.feature_angle_deg = 25;
  options.lambda = 0.0;
  SECTION("implicit") {
    options.degree = 5;
  }
  SECTION("implicit, thin plate") {
    options.degree = 3;
    options.order = 2;
  }
  SECTION("Taubin") {
    options.method = "taubin";
    options.steps = 3;
    options.weights = "uniform";
  }
  SECTION("bilateral") {
    options.method = "bilateral";
    options.normal_rounds = 4;
    options.vertex_rounds = 3;
  }
  const SmoothRound round = only_round(options);
  const SmoothedBlock all = smooth_block(whole, round);
  CHECK(all.counts.vertices == whole.position.size());
  if (!round.by_normals) CHECK(all.counts.line > 0);
  for (const double cut : {-0.3, 0.0, 0.35}) {
    const MeshBlock piece =
        test::piece_of(whole, [&](std::uint32_t v) { return whole.position[v][2] < cut; });
    const SmoothedBlock part = smooth_block(piece, round);
    CHECK(part.counts.vertices > 100);
    CHECK(part.counts.vertices < piece.position.size());
    std::size_t at = 0, different = 0, complete = 0;
    for (std::size_t v = 0; v < piece.position.size(); ++v) {
      while (whole.key[at] != piece.key[v]) ++at;
      if (part.complete[v] == 0) continue;
      ++complete;
      different += part.position[v] != all.position[at];
    }
    CHECK(complete == part.counts.vertices);
    CHECK(different == 0);
  }
}

TEST_CASE("smooth: two rings too few change bits: the count of rings is no luxury", "[property]") {
  MeshBlock whole = test::grid_block(40, 40, [](double, double) { return 0.0; });
  test::add_noise(whole, 0.2, 5);
  SmoothOptions options;
  options.feature_angle_deg = 0;
  options.degree = 4;
  const SmoothRound round = only_round(options);
  const SmoothedBlock all = smooth_block(whole, round);
  const MeshBlock piece = test::piece_of(whole, [&](std::uint32_t v) { return whole.key[v] / 10 % 41 < 20; });
  const SmoothedBlock part = smooth_block(piece, round);
  const FaceCorners corners(piece);
  const SurfaceRows rows = make_surface_rows(piece, corners, round.rows);
  const auto fewer = complete_rings(piece, corners, rows, round_rings(round) - 2);
  // Values of one round less exist there, but not the right ones.
  const std::vector<Displacement> moved = filter_surface(rows, piece.position, round.filter).moved;
  std::size_t at = 0, wrong = 0, ring = 0;
  for (std::size_t v = 0; v < piece.position.size(); ++v) {
    while (whole.key[at] != piece.key[v]) ++at;
    if (fewer[v] == 0 || part.complete[v] == 1) continue;
    ++ring;
    wrong += piece.position[v][0] + static_cast<double>(moved[v].xyz[0]) != all.position[at][0];
  }
  CHECK(ring > 20);
  CHECK(wrong > ring / 3);
}

TEST_CASE("smooth: creases of a cube stay lines, its corners stay", "[unit]") {
  const int n = 24;
  const MeshBlock clean = test::cube_block(n);
  MeshBlock noisy = clean;
  test::add_noise(noisy, 0.15 / n, 11);
  const SurfaceRows rows = make_surface_rows(noisy, FaceCorners(noisy), {LaplaceWeights::kCotangent, 60.0});
  std::size_t corners = 0, lines = 0;
  for (const VertexRole role : rows.role) {
    corners += role == VertexRole::kFixed;
    lines += role == VertexRole::kLine;
  }
  CHECK(corners == 8);
  CHECK(lines == 12 * (n - 1));
  SmoothOptions options;
  options.method = GENERATE("implicit", "denoise");
  options.lambda = 5;
  options.feature_angle_deg = 60;
  MeshBlock now = noisy;
  for (const SmoothRound& round : smooth_rounds(options)) now.position = smooth_block(now, round).position;
  std::vector<double> before, after;
  for (std::size_t v = 0; v < clean.position.size(); ++v) {
    int sides = 0;
    double off_before = 0.0, off_after = 0.0;
    for (std::size_t a = 0; a < 3; ++a) {
      const double c = clean.position[v][a];
      if (c != 0.0 && c != 1.0) continue;
      ++sides;
      off_before = std::hypot(off_before, noisy.position[v][a] - c);
      off_after = std::hypot(off_after, now.position[v][a] - c);
    }
    if (sides == 3 && options.method == "implicit") CHECK(now.position[v] == noisy.position[v]);
    if (sides != 2) continue;
    before.push_back(off_before);
    after.push_back(off_after);
  }
  CHECK(before.size() == 12 * (n - 1));
  CHECK(rms(after) < 0.6 * rms(before));
}

TEST_CASE("smooth: without creases a cube's edges are rounded off", "[unit]") {
  const int n = 16;
  const MeshBlock cube = test::cube_block(n);
  SmoothOptions options;
  options.feature_angle_deg = 0;
  const SmoothedBlock round_off = smooth_block(cube, only_round(options));
  options.feature_angle_deg = 60;
  const SmoothedBlock kept = smooth_block(cube, only_round(options));
  double moved = 0.0, moved_kept = 0.0;
  for (std::size_t v = 0; v < cube.position.size(); ++v) {
    moved = std::max(moved, distance(round_off.position[v], cube.position[v]));
    moved_kept = std::max(moved_kept, distance(kept.position[v], cube.position[v]));
  }
  CHECK(moved > 0.5 / n);
  CHECK(moved_kept < 1e-6);
}

TEST_CASE("smooth: bilateral filtering of a noisy cube finds its sides again", "[unit]") {
  const int n = 30;
  const MeshBlock clean = test::cube_block(n);
  MeshBlock noisy = clean;
  test::add_noise(noisy, 0.25 / n, 17);
  SmoothOptions options;
  options.method = "bilateral";
  const SmoothedBlock out = smooth_block(noisy, only_round(options));
  std::vector<double> before, after;
  for (std::size_t v = 0; v < clean.position.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a) {
      const double c = clean.position[v][a];
      if (c != 0.0 && c != 1.0) continue;
      before.push_back(noisy.position[v][a] - c);
      after.push_back(out.position[v][a] - c);
    }
  CHECK(rms(after) < 0.3 * rms(before));
}

TEST_CASE("smooth: nothing moves farther than the tolerance", "[property]") {
  MeshBlock block = test::sphere_block(4);
  test::add_noise(block, 0.05, 23);
  const SmoothedBlock out = smooth_block(block, only_round(SmoothOptions{}));
  const double tolerance = GENERATE(0.02, 1e-4, 1e-9);
  const bool floats = GENERATE(false, true);
  std::size_t clamped = 0;
  for (std::size_t v = 0; v < out.position.size(); ++v) {
    Double3 from = block.position[v];
    if (floats)
      for (double& x : from) x = static_cast<double>(static_cast<float>(x));
    const Double3 p = limit_move(from, out.position[v], tolerance, floats);
    const double x = p[0] - from[0], y = p[1] - from[1], z = p[2] - from[2];
    CHECK(std::sqrt(x * x + y * y + z * z) <= tolerance);
    clamped += distance(p, out.position[v]) > 1e-6;
    if (floats) CHECK(p[0] == static_cast<double>(static_cast<float>(p[0])));
  }
  CHECK(clamped > 10);
  const Double3 near = {1, 1, 1.0000001};
  CHECK(limit_move({1, 1, 1}, near, 1e-3, false) == near);
  CHECK(limit_move({1, 1, 1}, near, 0.0, false) == near);
}

TEST_CASE("smooth: borders are smoothed along themselves, their corners stay", "[unit]") {
  MeshBlock block = test::grid_block(30, 30, [](double, double) { return 0.0; });
  test::add_noise(block, 0.15, 29);
  const SmoothedBlock out = smooth_block(block, only_round(SmoothOptions{}));
  CHECK(out.counts.fixed == 4);
  CHECK(out.counts.line == 4 * 29);
  std::vector<double> before, after;
  for (std::size_t v = 1; v < 30; ++v) {  // the border y = 0
    before.push_back(block.position[v][1]);
    after.push_back(out.position[v][1]);
  }
  CHECK(rms(after) < 0.6 * rms(before));
}

TEST_CASE("smooth: degenerate input", "[unit]") {
  SECTION("faces without an area") {
    MeshBlock block = test::grid_block(12, 12, [](double, double) { return 0.0; });
    for (std::size_t v : {80u, 81u, 82u}) block.position[v] = block.position[79];
    for (const char* method : {"implicit", "taubin", "bilateral"}) {
      SmoothOptions options;
      options.method = method;
      const SmoothedBlock out = smooth_block(block, only_round(options));
      CHECK(out.counts.degenerate_faces > 0);
      for (const Double3& p : out.position)
        CHECK((std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])));
    }
  }
  SECTION("all vertices in one point") {
    MeshBlock block = test::sphere_block(2);
    for (Double3& p : block.position) p = {1, 2, 3};
    const SmoothedBlock out = smooth_block(block, only_round(SmoothOptions{}));
    for (const Double3& p : out.position) CHECK(p == Double3{1, 2, 3});
  }
  SECTION("three faces at an edge: its vertices stay") {
    const MeshBlock block = test::make_block({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}},
                                             {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}});
    const SmoothedBlock out = smooth_block(block, only_round(SmoothOptions{}));
    CHECK(out.position[0] == block.position[0]);
    CHECK(out.position[1] == block.position[1]);
  }
  SECTION("a coordinate that is not a number") {
    MeshBlock block = test::sphere_block(2);
    block.position[5][1] = std::numeric_limits<double>::quiet_NaN();
    CHECK_THROWS_AS(smooth_block(block, only_round(SmoothOptions{})), InputError);
  }
  SECTION("nothing at all") {
    const SmoothedBlock out = smooth_block(MeshBlock{}, only_round(SmoothOptions{}));
    CHECK(out.position.empty());
  }
}

TEST_CASE("smooth: options that make no sense are refused by name", "[unit]") {
  const auto refused = [](const std::function<void(SmoothOptions&)>& change, const std::string& name) {
    SmoothOptions options;
    change(options);
    try {
      static_cast<void>(smooth_rounds(options));
    } catch (const UsageError& e) {
      return std::string(e.what()).find(name) != std::string::npos;
    }
    return false;
  };
  CHECK(refused([](SmoothOptions& o) { o.method = "magic"; }, "method magic: not one of"));
  CHECK(refused([](SmoothOptions& o) { o.weights = "heavy"; }, "weights heavy: not one of"));
  CHECK(refused([](SmoothOptions& o) { o.steps = 0; }, "steps 0: must be 1 to 1000"));
  CHECK(refused([](SmoothOptions& o) { o.tolerance = -1; }, "tolerance must not be negative"));
  CHECK(refused([](SmoothOptions& o) { o.lambda = std::nan(""); }, "lambda must not be negative"));
  CHECK(refused([](SmoothOptions& o) { o.lambda = 1e10; }, "lambda must be at most 1e9"));
  CHECK(refused([](SmoothOptions& o) { o.method = "laplacian", o.lambda = 1.5; },
                "lambda must be at most 1 for laplacian"));
  SmoothOptions long_one;
  long_one.method = "taubin";
  long_one.steps = 50;
  std::size_t steps = 0;
  for (const SmoothRound& round : smooth_rounds(long_one))
    steps += static_cast<std::size_t>(round.filter.degree);
  CHECK(steps == 50);
}

namespace {

/// RMS difference between the filter and a Cholesky solution of its system, as a share of the RMS displacement.
double error_against_direct(int level, double noise, double lambda, int order) {
  MeshBlock block = test::sphere_block(level);
  test::add_noise(block, noise, 31);
  SmoothOptions options;
  options.feature_angle_deg = 0;
  options.lambda = lambda;
  options.order = order;
  const SmoothRound round = only_round(options);
  const SmoothedBlock out = smooth_block(block, round);
  // (D + lambda (D - W) D^-1 ... (D - W)) x = D b: symmetric, positive definite.
  const SurfaceRows rows = make_surface_rows(block, FaceCorners(block), round.rows);
  const std::size_t n = block.position.size();
  SparseMatrix stiffness;
  stiffness.rows = stiffness.columns = static_cast<std::int32_t>(n);
  stiffness.start.push_back(0);
  std::vector<double> degree(n), inverse(n);
  for (std::size_t v = 0; v < n; ++v) {
    std::map<std::int32_t, double> row;
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e) {
      row[static_cast<std::int32_t>(rows.neighbour[e])] = -static_cast<double>(rows.weight[e]);
      degree[v] += static_cast<double>(rows.weight[e]);
    }
    row[static_cast<std::int32_t>(v)] = degree[v];
    inverse[v] = 1.0 / degree[v];
    for (const auto& [column, value] : row) {
      stiffness.column.push_back(column);
      stiffness.value.push_back(value);
    }
    stiffness.start.push_back(static_cast<std::int32_t>(stiffness.column.size()));
  }
  const SparseMatrix power =
      options.order == 2 ? product(product(stiffness, diagonal_matrix(inverse)), stiffness) : stiffness;
  const SparseMatrix system = sum(1.0, diagonal_matrix(degree), options.lambda, power);
  std::vector<double> b(3 * n), x(3 * n);
  for (std::size_t v = 0; v < n; ++v)
    for (std::size_t a = 0; a < 3; ++a) b[3 * v + a] = degree[v] * block.position[v][a];
  const auto solver = test::make_cholmod_solver();
  REQUIRE(solver->analyse(system).status == SolveStatus::kSolved);
  REQUIRE(solver->factor(system).status == SolveStatus::kSolved);
  REQUIRE(solver->solve(b, x, 3).status == SolveStatus::kSolved);
  double error = 0.0, moved = 0.0;
  for (std::size_t v = 0; v < n; ++v)
    for (std::size_t a = 0; a < 3; ++a) {
      error += std::pow(out.position[v][a] - x[3 * v + a], 2);
      moved += std::pow(x[3 * v + a] - block.position[v][a], 2);
    }
  return std::sqrt(error / moved);
}

}  // namespace

TEST_CASE("smooth: Chebyshev steps agree with the direct solution of the same system", "[property]") {
  const double lambda = GENERATE(3.0, 10.0, 40.0);
  const int order = GENERATE(1, 2);
  CHECK(error_against_direct(4, 0.01, lambda, order) < 1e-3);
  // Without noise a plate moves its longest waves alone, and them by far less than it bends them.
  CHECK(error_against_direct(5, 0.0, lambda, 2) < 1e-3);
}

TEST_CASE("smooth: the same on 655,362 vertices, which takes CHOLMOD a minute", "[property][.large]") {
  const double error = error_against_direct(8, 0.001, 10.0, 1);
  INFO("error " << error << " of the displacement");
  CHECK(error < 1e-3);
  WARN("655,362 vertices: error " << error << " of the displacement");
}

TEST_CASE("smooth: crease junk of heavy noise cannot make a filter grow", "[property]") {
  MeshBlock block = test::sphere_block(5);
  const double edge = 0.05, noise = 0.4 * edge;
  test::add_noise(block, noise, 37);
  SmoothOptions options;
  options.feature_angle_deg = 25;
  options.order = GENERATE(1, 2);
  options.lambda = GENERATE(10.0, 60.0);
  const SmoothedBlock out = smooth_block(block, only_round(options));
  CHECK(out.counts.line > 300);
  CHECK(out.counts.line + out.counts.fixed < out.counts.vertices - 300);
  double largest = 0.0;
  for (std::size_t v = 0; v < out.position.size(); ++v)
    largest = std::max(largest, distance(out.position[v], block.position[v]));
  CHECK(largest < 4 * edge);
}

}  // namespace smooth_test
