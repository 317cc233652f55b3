// Boundary constraint modelling against dense systems, and what its orders and smoothness promise.
#include "kernels/edit/boundary_model.h"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cmath>

#include "octree/error.h"
#include "solvers/laplacian_system.h"
#include "tests/helpers/random.h"
#include "tests/helpers/surfaces.h"
#include "tests/solvers/dense.h"

namespace boundary_model_test {

namespace {

using namespace tessera;
using namespace tessera::test;

Surface bumpy_sphere() {
  Surface s = sphere(3, 1.0);
  Random random(7);
  for (Double3& p : s.position) p = p * random.in(0.97, 1.03);
  return s;
}

/// Free between two caps.
std::vector<std::uint8_t> belt(const Surface& s) {
  std::vector<std::uint8_t> free;
  for (const Double3& p : s.position) free.push_back(std::fabs(p[2]) < 0.55);
  return free;
}

std::vector<double> coordinates(const Surface& s) {
  std::vector<double> out;
  for (const Double3& p : s.position) out.insert(out.end(), p.begin(), p.end());
  return out;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::fabs(a[i] - b[i]));
  return worst;
}

/// How a surface leaves its outer boundary.
struct Leaving {
  double slope = 0.0, curvature = 0.0;
};

/// A plane ring between radii 1 and 2, of so many cells, whose inside is lifted by 1 while the outside stays.
Leaving leaving(int cells, int order, double smoothness) {
  const double h = 1.0 / cells;
  const int beyond = 4, rings = cells + 2 * beyond,
            around = static_cast<int>(2.0 * 3.14159265358979 * 1.5 / h);
  Surface s;
  std::vector<std::uint8_t> free;
  std::vector<double> values, smooth;
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j < around; ++j) {
      const double r = 1.0 + (i - beyond) * h, t = 2.0 * 3.14159265358979 * j / around;
      s.position.push_back({r * std::cos(t), r * std::sin(t), 0.0});
      free.push_back(i > beyond && i < beyond + cells);
      values.push_back(i <= beyond ? 1.0 : 0.0);
      smooth.push_back(i <= beyond ? order - 1.0 : smoothness);
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * around + j % around); };
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < around; ++j) {
      s.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      s.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  BoundaryModel(laplacian({s.position, s.faces}), free, smooth, {.order = order}).solve(values, 1);
  const double f1 = values[at(beyond + cells - 1, 0)], f2 = values[at(beyond + cells - 2, 0)];
  return {f1 / h, (f2 - 2.0 * f1) / (h * h)};
}

/// The same everywhere, or not.
std::vector<double> smoothness_of(const Surface& s, int order, bool mixed) {
  std::vector<double> smoothness(s.position.size(), order - 1.0);
  if (mixed)
    for (std::size_t v = 0; v < smoothness.size(); ++v)
      smoothness[v] = s.position[v][2] > 0.0 ? 0.0 : 0.7 * (order - 1.0);
  return smoothness;
}

}  // namespace

TEST_CASE("boundary model: solutions are those of the dense system", "[unit]") {
  const Surface s = bumpy_sphere();
  const Laplacian lap = laplacian({s.position, s.faces});
  const std::vector<std::uint8_t> free = belt(s);
  const int order = GENERATE(1, 2, 3);
  const bool mixed = GENERATE(false, true);
  CAPTURE(order, mixed);
  const std::vector<double> smoothness = smoothness_of(s, order, mixed);
  BoundaryModel model(lap, free, smoothness, {.order = order});
  CHECK(model.report().symmetric == (order < 3 || !mixed));
  std::vector<double> values = coordinates(s);
  model.solve(values, 3);

  // Row by row as the thesis defines it, in long double.
  using Matrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const auto n = static_cast<Eigen::Index>(free.size());
  const Matrix stiffness = dense(lap.stiffness).cast<long double>();
  Matrix power = stiffness;
  for (int level = 1; level < order; ++level) {
    for (Eigen::Index v = 0; v < n; ++v) {
      const auto i = static_cast<std::size_t>(v);
      const double damping = free[i] ? 1.0 : std::min(1.0, std::max(0.0, smoothness[i] - (level - 1)));
      power.row(v) *= static_cast<long double>(damping / lap.mass[i]);
    }
    power = stiffness * power;
  }
  const std::vector<std::int32_t>& unknown = model.free_vertices();
  const auto m = static_cast<Eigen::Index>(unknown.size());
  Matrix a(m, m), b = Matrix::Zero(m, 3);
  const std::vector<double> given = coordinates(s);
  for (Eigen::Index r = 0; r < m; ++r) {
    for (Eigen::Index c = 0; c < m; ++c) a(r, c) = power(unknown[r], unknown[c]);
    for (Eigen::Index v = 0; v < n; ++v)
      if (!free[static_cast<std::size_t>(v)])
        for (Eigen::Index k = 0; k < 3; ++k) b(r, k) -= power(unknown[r], v) * given[3 * v + k];
  }
  const Matrix x = a.partialPivLu().solve(b);
  double worst = 0.0;
  for (Eigen::Index r = 0; r < m; ++r)
    for (Eigen::Index k = 0; k < 3; ++k)
      worst = std::max(worst, static_cast<double>(std::fabs(x(r, k) - values[3 * unknown[r] + k])));
  CHECK(worst < 1e-9);
}

TEST_CASE("boundary model: a factor in a store gives the same bits", "[unit]") {
  const Surface s = bumpy_sphere();
  const Laplacian lap = laplacian({s.position, s.faces});
  const std::vector<std::uint8_t> free = belt(s);
  const int order = GENERATE(1, 2, 3);
  const bool mixed = GENERATE(false, true);
  CAPTURE(order, mixed);
  const std::vector<double> smoothness = smoothness_of(s, order, mixed);
  MemoryFactorStore store;
  BoundaryModel held(lap, free, smoothness, {.order = order}),
      stored(lap, free, smoothness, {.order = order, .memory_bytes = 0, .store = &store});
  CHECK(store.size() == stored.report().factor.factor_entries);
  CHECK(store.size() > 0);
  std::vector<double> a = coordinates(s), b = a;
  held.solve(a, 3);
  stored.solve(b, 3);
  CHECK(a == b);
}

TEST_CASE("boundary model: columns are solved for one by one", "[unit]") {
  // More of them than are refined at a time.
  const Surface s = bumpy_sphere();
  BoundaryModel model(laplacian({s.position, s.faces}), belt(s), {}, {.order = 2});
  const std::vector<double> three = coordinates(s);
  constexpr std::size_t kCopies = 3;
  std::vector<double> nine;
  for (std::size_t v = 0; v < s.position.size(); ++v)
    for (std::size_t k = 0; k < kCopies; ++k)
      nine.insert(nine.end(), three.begin() + static_cast<std::ptrdiff_t>(3 * v),
                  three.begin() + static_cast<std::ptrdiff_t>(3 * v + 3));
  std::vector<double> alone = three;
  model.solve(alone, 3);
  const int refinements = model.report().refinements;
  CHECK(refinements > 0);
  model.solve(nine, 3 * kCopies);
  CHECK(model.report().refinements == refinements);
  double worst = 0.0;
  for (std::size_t i = 0; i < nine.size(); ++i)
    worst = std::max(worst, std::fabs(nine[i] - alone[i / (3 * kCopies) * 3 + i % 3]));
  CHECK(worst < 1e-13);
}

TEST_CASE("boundary model: less smoothness everywhere is a lower order", "[unit]") {
  // Delta^2 f = 0 beyond the boundary leaves a thin plate, Delta f = 0 beyond it a membrane.
  const Surface s = bumpy_sphere();
  const Laplacian lap = laplacian({s.position, s.faces});
  const std::vector<std::uint8_t> free = belt(s);
  for (const int lower : {1, 2}) {
    const std::vector<double> smoothness(s.position.size(), lower - 1.0);
    std::vector<double> damped = coordinates(s), low = damped, high = damped;
    BoundaryModel(lap, free, smoothness, {.order = 3}).solve(damped, 3);
    BoundaryModel(lap, free, {}, {.order = lower}).solve(low, 3);
    BoundaryModel(lap, free, {}, {.order = 3}).solve(high, 3);
    CAPTURE(lower);
    CHECK(largest_difference(damped, low) < 1e-8);
    CHECK(largest_difference(damped, high) > 1e-3);
  }
}

// What a boundary that is C^s lacks goes to zero with the cells: slopes from C^1 on, curvatures from C^2 on.
TEST_CASE("boundary model: slopes and curvatures meet those of the boundary as cells shrink", "[unit]") {
  struct Case {
    int order;
    double smoothness;
    bool slope, curvature;
  };
  for (const Case& c : {Case{1, 0.0, false, false}, Case{2, 0.0, false, false}, Case{2, 1.0, true, false},
                        Case{3, 0.0, false, false}, Case{3, 1.0, true, false}, Case{3, 2.0, true, true}}) {
    CAPTURE(c.order, c.smoothness);
    const Leaving coarse = leaving(12, c.order, c.smoothness), fine = leaving(24, c.order, c.smoothness),
                  finer = leaving(48, c.order, c.smoothness);
    const double slopes = std::fabs(finer.slope / fine.slope),
                 curvatures = std::fabs(finer.curvature / fine.curvature);
    CAPTURE(coarse.slope, fine.slope, finer.slope, coarse.curvature, fine.curvature, finer.curvature);
    CHECK((slopes < 0.6) == c.slope);
    CHECK((std::fabs(fine.slope / coarse.slope) < 0.6) == c.slope);
    if (!c.slope) CHECK(slopes > 0.9);
    if (!c.slope) continue;  // its curvature is that of a border: none
    CHECK((curvatures < 0.7) == c.curvature);
    if (!c.curvature) CHECK(curvatures > 0.9);
    if (c.curvature) CHECK(slopes < 0.35);
  }
}

TEST_CASE("boundary model: the solution has the least energy", "[unit]") {
  const Surface s = bumpy_sphere();
  const Laplacian lap = laplacian({s.position, s.faces});
  const std::vector<std::uint8_t> free = belt(s);
  for (const int order : {1, 2, 3}) {
    BoundaryModel model(lap, free, {}, {.order = order});
    std::vector<double> values = coordinates(s);
    const double before = model.energy(values, 3);
    model.solve(values, 3);
    const double minimum = model.energy(values, 3);
    CAPTURE(order);
    CHECK(minimum > 0.0);
    CHECK(minimum < before);
  }
}

TEST_CASE("boundary model: nothing that holds a piece is refused", "[unit]") {
  const Surface s = sphere(2, 1.0);
  const Laplacian lap = laplacian({s.position, s.faces});
  const std::vector<std::uint8_t> all(s.position.size(), 1);
  CHECK_THROWS_AS(BoundaryModel(lap, all, {}, {.order = 1}), InputError);
  const std::vector<std::uint8_t> none(s.position.size(), 0);
  CHECK_THROWS_AS(BoundaryModel(lap, none, {}, {.order = 1}), UsageError);
  CHECK_THROWS_AS(BoundaryModel(lap, belt(s), {}, {.order = 2, .memory_bytes = 1000}), ResourceError);
}

}  // namespace boundary_model_test
