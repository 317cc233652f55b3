// The coarse level of smoothing: long wavelengths against direct solutions, and independence of blocks.
#include "kernels/smooth/coarse_level.h"

#include <Eigen/SparseLU>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>

#include "kernels/smooth/coarse_system.h"
#include "kernels/smooth/smooth.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "solvers/sparse_matrix.h"
#include "tests/helpers/block_meshes.h"

namespace coarse_level_test {

namespace {

using namespace tessera;

double rms_edge(const MeshBlock& block) {
  double sum = 0.0;
  for (const auto& f : block.faces)
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t a = 0; a < 3; ++a)
        sum += std::pow(block.position[f[k]][a] - block.position[f[(k + 1) % 3]][a], 2);
  return std::sqrt(sum / (3.0 * static_cast<double>(block.faces.size())));
}

CoarseOptions options_for(const MeshBlock& block, double lambda, int order = 1) {
  return coarse_options(lambda, order, rms_edge(block), block.faces.size());
}

/// One cycle with the whole mesh as one patch.
SmoothedBlock cycle(const MeshBlock& block, const SmoothedBlock& before, const SmoothRound& round) {
  const CoarseOptions options = options_for(block, round.filter.lambda, round.filter.order);
  const SurfaceRows rows = make_surface_rows(block, FaceCorners(block), round.rows);
  const CoarseBasis basis = make_coarse_basis(block, rows, options);
  std::vector<std::uint32_t> all(block.key.size());
  std::iota(all.begin(), all.end(), 0u);
  std::vector<CoarseUnknown> unknowns;
  for (std::size_t i = 0; i < basis.name.size(); ++i)
    unknowns.push_back({basis.name[i], block.position[basis.seed[i]], basis.on_line[i]});
  CoarseSystem system(unknowns, options);
  for (const CoarseEntry& e : coarse_matrix(rows, basis, all, options)) system.add(e);
  const StepState state{block.position, before.position, before.laplacian};
  const CoarseSolution solution{basis.name, system.solve(coarse_load(rows, basis, state, all, options))};
  SmoothedBlock out = smooth_cycle(block, before.position, before.laplacian, round, options, solution);
  CHECK(out.counts.vertices == block.key.size());
  return out;
}

std::vector<Double3> smoothed(const MeshBlock& block, const SmoothOptions& options) {
  SmoothedBlock now;
  now.position = block.position;
  for (const SmoothRound& round : smooth_rounds(options))
    now = round.cycle >= 0 ? cycle(block, now, round) : smooth_block(block, round);
  return now.position;
}

/// A as it applies to displacements, each row as the filter sees it: lines do not see the free vertices at their ends.
/// \param laplacian  free vertices do not see lines either
SparseMatrix operator_of(const SurfaceRows& rows, bool laplacian) {
  SparseMatrix a;
  const auto n = static_cast<std::uint32_t>(rows.role.size());
  a.rows = a.columns = static_cast<std::int32_t>(n);
  a.start.push_back(0);
  for (std::uint32_t v = 0; v < n; ++v) {
    std::map<std::int32_t, double> row;
    double degree = 0.0;
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e)
      degree += static_cast<double>(rows.weight[e]);
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e) {
      const std::uint32_t u = rows.neighbour[e];
      if (rows.role[u] != rows.role[v] && (laplacian || rows.role[v] == VertexRole::kLine)) continue;
      row[static_cast<std::int32_t>(u)] -= static_cast<double>(rows.weight[e]) / degree;
    }
    row[static_cast<std::int32_t>(v)] = degree > 0.0 ? 1.0 : 0.0;
    for (const auto& [column, value] : row) {
      a.column.push_back(column);
      a.value.push_back(value);
    }
    a.start.push_back(static_cast<std::int32_t>(a.column.size()));
  }
  return a;
}

/// (1 + lambda A^order) d = -lambda A^order b by a sparse factor.
std::vector<Double3> direct(const MeshBlock& block, const SmoothOptions& options) {
  const SurfaceRows rows =
      make_surface_rows(block, FaceCorners(block), {LaplaceWeights::kCotangent, options.feature_angle_deg});
  const std::size_t n = block.position.size();
  // A b, from all that a row names.
  std::vector<double> b(3 * n), x(3 * n);
  for (std::uint32_t v = 0; v < n; ++v) {
    double degree = 0.0;
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e)
      degree += static_cast<double>(rows.weight[e]);
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e)
      for (std::size_t k = 0; k < 3; ++k)
        b[3 * v + k] -= static_cast<double>(rows.weight[e]) / degree *
                        (block.position[v][k] - block.position[rows.neighbour[e]][k]);
  }
  SparseMatrix a = operator_of(rows, false);
  if (options.order == 2) {
    const SparseMatrix laplacian = operator_of(rows, true);
    std::vector<double> once = b;
    multiply(laplacian, once, b, 3);
    a = product(laplacian, a);
  }
  for (double& value : b) value *= options.lambda;
  const SparseMatrix system = sum(1.0, diagonal_matrix(std::vector<double>(n, 1.0)), options.lambda, a);
  const Eigen::SparseMatrix<double> columns =
      Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor, std::int32_t>>(
          system.rows, system.columns, static_cast<Eigen::Index>(system.entries()), system.start.data(),
          system.column.data(), system.value.data());
  const Eigen::SparseLU<Eigen::SparseMatrix<double>> factor(columns);
  REQUIRE(factor.info() == Eigen::Success);
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
  const Eigen::MatrixXd right = Eigen::Map<const Rows>(b.data(), system.rows, 3);
  const Eigen::MatrixXd solution = factor.solve(right);
  Eigen::Map<Rows>(x.data(), system.rows, 3) = solution;
  std::vector<Double3> out(n);
  for (std::size_t v = 0; v < n; ++v)
    for (std::size_t k = 0; k < 3; ++k) out[v][k] = block.position[v][k] + x[3 * v + k];
  return out;
}

/// RMS difference as a share of the RMS displacement.
double error(const MeshBlock& block, const std::vector<Double3>& got, const std::vector<Double3>& right) {
  double wrong = 0.0, moved = 0.0;
  for (std::size_t v = 0; v < got.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a) {
      wrong += std::pow(got[v][a] - right[v][a], 2);
      moved += std::pow(right[v][a] - block.position[v][a], 2);
    }
  return std::sqrt(wrong / moved);
}

/// A sphere with long waves and noise; with `cut` its lower part is squeezed, so that a crease runs around it.
MeshBlock wavy_sphere(int level, bool cut) {
  MeshBlock block = test::sphere_block(level);
  for (Double3& p : block.position) {
    const double w = 1.0 + 0.1 * std::sin(3.0 * p[0]) * std::cos(4.0 * p[1] + p[2]);
    for (double& x : p) x *= w;
    if (cut && p[2] < 0.0) p[2] *= 0.2;
  }
  test::add_noise(block, 0.1 * rms_edge(block), 31);
  return block;
}

}  // namespace

TEST_CASE("coarse level: long wavelengths agree with the direct solution, where Chebyshev alone does not",
          "[property]") {
  const bool cut = GENERATE(false, true);
  const MeshBlock block = wavy_sphere(5, cut);
  SmoothOptions options;
  options.order = GENERATE(1, 2);
  options.lambda = options.order == 1 ? GENERATE(200.0, 1e4, 1e6, 1e9) : GENERATE(1e3, 1e4, 1e6, 1e9);
  options.feature_angle_deg = cut ? 50 : 0;
  CAPTURE(cut, options.order, options.lambda);
  const std::vector<Double3> right = direct(block, options);
  CHECK(error(block, smoothed(block, options), right) < 1e-3);
  options.degree = 64;
  const double alone = error(block, smoothed(block, options), right);
  if (options.lambda >= (options.order == 1 ? 1e4 : 1e6)) CHECK(alone > 0.1);
}

TEST_CASE("coarse level: the same of order 2 on 65,538 vertices", "[property][.large]") {
  const MeshBlock block = wavy_sphere(7, false);
  SmoothOptions options;
  options.order = 2;
  options.feature_angle_deg = 0;
  for (const double lambda : {1e3, 1e4, 1e6, 1e8}) {
    options.lambda = lambda;
    const double e = error(block, smoothed(block, options), direct(block, options));
    WARN("lambda " << lambda << ": error " << e << " of the displacement");
    CHECK(e < 1e-3);
  }
}

TEST_CASE("coarse level: so do they among vertices that noise makes creases and corners", "[property]") {
  MeshBlock block = test::sphere_block(5);
  test::add_noise(block, 0.4 * rms_edge(block), 37);
  SmoothOptions options;
  options.order = GENERATE(1, 2);
  options.lambda = GENERATE(300.0, 1e5);
  options.feature_angle_deg = 25;
  const SurfaceRows rows = make_surface_rows(block, FaceCorners(block), {LaplaceWeights::kCotangent, 25});
  CHECK(std::count(rows.role.begin(), rows.role.end(), VertexRole::kLine) > 300);
  CAPTURE(options.order, options.lambda);
  CHECK(error(block, smoothed(block, options), direct(block, options)) < 1e-3);
}

TEST_CASE("coarse level: the sides of a thin wall move apart", "[property]") {
  // Two sheets closer than a cell, waves against each other: corners around them must have an unknown for each.
  const int side = 60;
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (int sheet = 0; sheet < 2; ++sheet)
    for (int j = 0; j <= side; ++j)
      for (int i = 0; i <= side; ++i)
        position.push_back({double(i), double(j),
                            0.5 + sheet + (sheet - 0.5) * 0.8 * std::sin(0.1 * i) * std::sin(0.1 * j)});
  for (std::uint32_t sheet = 0; sheet < 2; ++sheet)
    for (std::uint32_t j = 0; j < side; ++j)
      for (std::uint32_t i = 0; i < side; ++i) {
        const std::uint32_t a = (sheet * (side + 1) + j) * (side + 1) + i, c = a + side + 1;
        faces.push_back({a, a + 1, c + 1});
        faces.push_back({a, c + 1, c});
      }
  const MeshBlock block = test::make_block(position, faces);
  SmoothOptions options;
  options.order = GENERATE(1, 2);
  options.lambda = options.order == 1 ? 1e4 : 1e6;
  options.feature_angle_deg = 0;
  CHECK(error(block, smoothed(block, options), direct(block, options)) < 1e-3);
}

TEST_CASE("coarse level: sums have the same bits in every block that holds the surroundings", "[property]") {
  const MeshBlock whole = wavy_sphere(5, true);
  const CoarseOptions options = options_for(whole, 1000, GENERATE(1, 2));
  const SurfaceRowOptions how{LaplaceWeights::kCotangent, 50};
  const SurfaceRows rows = make_surface_rows(whole, FaceCorners(whole), how);
  const CoarseBasis basis = make_coarse_basis(whole, rows, options);
  std::vector<Double3> now = whole.position;
  std::vector<Float3> laplacian;
  for (std::size_t v = 0; v < now.size(); ++v) {
    now[v][0] += 1e-3 * now[v][1];
    if (options.order == 2)
      laplacian.push_back({static_cast<float>(now[v][1]), 0.1F, static_cast<float>(now[v][2])});
  }
  std::vector<std::uint32_t> core;
  for (std::uint32_t v = 0; v < now.size(); ++v)
    if (whole.position[v][0] < -0.6) core.push_back(v);
  const auto entries = coarse_matrix(rows, basis, core, options);
  const auto loads = coarse_load(rows, basis, {whole.position, now, laplacian}, core, options);
  REQUIRE(entries.size() > 500);
  const auto in_piece = [&](double margin) {
    const MeshBlock piece =
        test::piece_of(whole, [&](std::uint32_t v) { return whole.position[v][0] < -0.6 + margin; });
    const SurfaceRows part = make_surface_rows(piece, FaceCorners(piece), how);
    const CoarseBasis seen = make_coarse_basis(piece, part, options);
    std::vector<std::uint32_t> same;
    std::vector<Double3> there;
    std::vector<Float3> laplacians;
    for (std::uint32_t v = 0, at = 0; v < piece.key.size(); ++v) {
      while (whole.key[at] != piece.key[v]) ++at;
      there.push_back(now[at]);
      if (!laplacian.empty()) laplacians.push_back(laplacian[at]);
      if (std::binary_search(core.begin(), core.end(), at)) same.push_back(v);
    }
    REQUIRE(same.size() == core.size());
    const auto e = coarse_matrix(part, seen, same, options);
    const auto l = coarse_load(part, seen, {piece.position, there, laplacians}, same, options);
    REQUIRE(e.size() == entries.size());
    REQUIRE(l.size() == loads.size());
    std::size_t different = 0;
    for (std::size_t k = 0; k < e.size(); ++k)
      different += e[k].row != entries[k].row || e[k].column != entries[k].column ||
                   e[k].mass != entries[k].mass || e[k].stiffness != entries[k].stiffness;
    for (std::size_t k = 0; k < l.size(); ++k)
      different +=
          l[k].row != loads[k].row || l[k].moved != loads[k].moved || l[k].laplacian != loads[k].laplacian;
    CHECK(different == 0);
  };
  in_piece(coarse_halo(options) + 4 * 0.06);
  CHECK_THROWS_AS(in_piece(0.3 * options.cell), std::logic_error);
}

TEST_CASE("coarse level: what a factor would take too long for goes to multigrid", "[property]") {
  // A sheet, and a block of cells as no surface has them.
  const bool solid = GENERATE(false, true);
  const std::array<int, 3> size = solid ? std::array<int, 3>{30, 30, 30} : std::array<int, 3>{164, 164, 1};
  CoarseOptions options;
  options.cell = 1.0;
  options.lambda = 1000.0;
  const auto name = [&](int x, int y, int z) {
    return static_cast<std::uint64_t>((z * size[1] + y) * size[0] + x);
  };
  std::vector<CoarseUnknown> unknowns;
  std::vector<CoarseEntry> entries;
  std::vector<CoarseLoad> loads;
  for (int z = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x) {
        const std::uint64_t own = name(x, y, z);
        unknowns.push_back({own, {1.0 * x, 1.0 * y, 1.0 * z}, 0});
        loads.push_back({own, {std::sin(0.1 * x), std::cos(0.2 * y), std::sin(0.3 * z + 0.1 * x)}, {}});
        std::map<std::uint64_t, double> row;
        for (std::size_t a = 0; a < 3; ++a)
          for (const int step : {-1, 1}) {
            std::array<int, 3> at = {x, y, z};
            at[a] += step;
            if (at[a] < 0 || at[a] >= size[a]) continue;
            row[name(at[0], at[1], at[2])] = -1.0;
            row[own] += 1.0;
          }
        for (const auto& [column, stiffness] : row)
          entries.push_back({own, column, column == own ? 1.0 : 0.0, stiffness});
      }
  CoarseSystem system(unknowns, options);
  for (const CoarseEntry& e : entries) system.add(e);
  const std::vector<CoarseValue> values = system.solve(loads);
  CHECK(system.systems() == 1);
  CHECK((system.cycles() > 0) == solid);
  std::vector<Double3> rest;
  for (const CoarseLoad& l : loads) rest.push_back(l.moved);
  for (const CoarseEntry& e : entries)
    for (std::size_t a = 0; a < 3; ++a)
      rest[e.row][a] -= (e.mass + options.lambda * e.stiffness) * values[e.column].moved[a];
  double left = 0.0, whole = 0.0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    left += dot(rest[i], rest[i]);
    whole += dot(loads[i].moved, loads[i].moved);
  }
  CHECK(std::sqrt(left / whole) < (solid ? 1e-4 : 1e-9));
}

TEST_CASE("coarse level: a small part at survey coordinates has the unknowns that it has at zero", "[unit]") {
  MeshBlock block = wavy_sphere(3, false);
  for (Double3& p : block.position)
    for (double& x : p) x = std::round(x * 0x1p20) * 0x1p-20;  // so that the shift rounds nothing
  CoarseOptions options = options_for(block, 1000);
  options.cell = 0x1p-9;
  const CoarseBasis there =
      make_coarse_basis(block, make_surface_rows(block, FaceCorners(block), {}), options);
  for (Double3& p : block.position) p = p + Double3{0x1p23, 0x1p24, 0.0};  // 2^33 cells
  const CoarseBasis far = make_coarse_basis(block, make_surface_rows(block, FaceCorners(block), {}), options);
  CHECK(far.name == there.name);
  CHECK(far.unknown == there.unknown);
  CHECK(far.weight == there.weight);
}

TEST_CASE("coarse level: what cannot be solved is said", "[unit]") {
  const MeshBlock block = wavy_sphere(3, false);
  CoarseOptions options = options_for(block, 1000);
  const SurfaceRows rows = make_surface_rows(block, FaceCorners(block), {});
  SECTION("a mesh too far from zero") {
    options.cell = 1e-16;
    CHECK_THROWS_AS(make_coarse_basis(block, rows, options), InputError);
  }
  SECTION("a system without a diagonal") {
    CoarseSystem system({{3, {0, 0, 0}, 0}, {5, {1, 0, 0}, 0}}, options);
    system.add({3, 3, 1.0, 0.0});
    const std::vector<CoarseLoad> loads = {{3, {1, 1, 1}, {}}};
    CHECK_THROWS_AS(system.solve(loads), InputError);
  }
  SECTION("an entry of nobody") {
    // No input can bring that about.
    CoarseSystem system({{3, {0, 0, 0}, 0}}, options);
    CHECK_THROWS_AS(system.add({4, 4, 1.0, 0.0}), std::logic_error);
    CHECK_THROWS_AS(system.add({3, 4, 1.0, 0.0}), std::logic_error);
    system.add({3, 3, 1.0, 0.0});
    const std::vector<CoarseLoad> loads = {{4, {1, 1, 1}, {}}};
    CHECK_THROWS_AS(system.solve(loads), std::logic_error);
  }
}

}  // namespace coarse_level_test
