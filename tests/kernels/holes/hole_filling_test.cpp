#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <set>

#include "kernels/holes/hole_filling.h"
#include "kernels/holes/hole_triangulation.h"
#include "octree/vector.h"
#include "solvers/envelope_cholesky.h"
#include "tests/helpers/random.h"

namespace hole_filling_test {

using namespace tessera;

namespace {

constexpr double kTau = 6.283185307179586;

/// A loop at height z(r) of a body around the z axis, seen from above; `step` leads along the surface away
/// from it.
template <class Surface>
HoleLoop ring(std::size_t n, double radius, double step, const Surface& z) {
  HoleLoop loop;
  for (std::size_t i = 0; i < n; ++i) {
    const double a = kTau * static_cast<double>(i) / static_cast<double>(n);
    const double b = kTau * (static_cast<double>(i) + 0.5) / static_cast<double>(n);
    loop.position.push_back({radius * std::cos(a), radius * std::sin(a), z(radius)});
    loop.opposite.push_back({(radius + step) * std::cos(b), (radius + step) * std::sin(b), z(radius + step)});
  }
  return loop;
}

/// Every inner edge twice, in opposite directions; the loop's edges once, in its own; a disk.
void require_disk(const HoleLoop& loop, const HoleFilling& f) {
  const auto n = static_cast<std::uint32_t>(loop.position.size());
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> count;
  for (const auto& t : f.faces)
    for (std::size_t e = 0; e < 3; ++e) ++count[{t[e], t[(e + 1) % 3]}];
  std::size_t open = 0;
  for (const auto& [edge, times] : count) {
    REQUIRE(times == 1);
    REQUIRE(edge.first < n + f.position.size());
    if (count.count({edge.second, edge.first})) continue;
    ++open;
    REQUIRE(edge.second == (edge.first + 1) % n);
  }
  REQUIRE(open == n);
  REQUIRE(f.faces.size() == n - 2 + 2 * f.position.size());  // Euler
}

}  // namespace

TEST_CASE("hole filling: a flat hole stays flat, with edges like the rim's", "[unit]") {
  const HoleLoop loop = ring(48, 8.0, 1.0, [](double) { return 3.0; });
  const HoleFilling f = fill_hole(loop);
  REQUIRE(f.outcome == HoleOutcome::kFilled);
  CHECK(f.fair);
  require_disk(loop, f);
  const double edge = kTau * 8.0 / 48;
  const double even = 3.14159 * 64 / (0.866 * edge * edge);
  CHECK(static_cast<double>(f.position.size()) > 0.6 * even);
  CHECK(static_cast<double>(f.position.size()) < 1.5 * even);
  for (const Double3& p : f.position) {
    CHECK(std::abs(p[2] - 3.0) < 1e-9);
    CHECK(std::hypot(p[0], p[1]) < 8.0);
  }
}

TEST_CASE("hole filling: the cap of a sphere comes back from its rim", "[unit]") {
  // A cap of 45 degrees, 2.9 high: the flat patch is off by all of that.
  const double r = 10.0;
  const auto z = [&](double x) { return std::sqrt(r * r - x * x); };
  const HoleLoop loop = ring(64, r * std::sin(kTau / 8), 0.5, z);
  const HoleFilling f = fill_hole(loop);
  REQUIRE(f.outcome == HoleOutcome::kFilled);
  require_disk(loop, f);
  double worst = 0.0;
  for (const Double3& p : f.position) worst = std::max(worst, std::abs(norm(p) - r));
  CHECK(worst < 0.45);
  CHECK(worst > 0.0);
}

TEST_CASE("hole filling: a saddle's rim is met smoothly", "[unit]") {
  // z = x y / 12 is nearly of least bending, so the patch must follow it closely.
  const auto z = [](const Double3& p) { return p[0] * p[1] / 12.0; };
  HoleLoop loop = ring(60, 6.0, 0.6, [](double) { return 0.0; });
  for (Double3& p : loop.position) p[2] = z(p);
  for (Double3& p : loop.opposite) p[2] = z(p);
  const HoleFilling f = fill_hole(loop);
  REQUIRE(f.outcome == HoleOutcome::kFilled);
  require_disk(loop, f);
  for (const Double3& p : f.position) CHECK(std::abs(p[2] - z(p)) < 0.12);
}

TEST_CASE("hole filling: small loops, edges that are taken, the outside of a piece", "[unit]") {
  HoleLoop square = ring(4, 1.0, 0.7, [](double) { return 0.0; });
  HoleFilling f = fill_hole(square);
  REQUIRE(f.outcome == HoleOutcome::kFilled);
  require_disk(square, f);
  // One diagonal taken: the other; both: none.
  square.taken = {{0, 2}};
  f = fill_hole(square);
  REQUIRE(f.outcome == HoleOutcome::kFilled);
  require_disk(square, f);
  for (const auto& t : f.faces)
    CHECK_FALSE((std::count(t.begin(), t.end(), 0u) == 1 && std::count(t.begin(), t.end(), 2u) == 1));
  square.taken = {{0, 2}, {1, 3}};
  CHECK(fill_hole(square).outcome == HoleOutcome::kTaken);
  // The border of a flat disk: its faces lie inside the loop, seen the other way round.
  HoleLoop disk = ring(40, 8.0, -1.0, [](double) { return 0.0; });
  std::reverse(disk.position.begin(), disk.position.end());
  std::reverse(disk.opposite.begin(), disk.opposite.end() - 1);
  CHECK(fill_hole(disk).outcome == HoleOutcome::kOuter);
  // A lone triangle.
  HoleLoop lone;
  lone.position = {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}};
  lone.opposite = {{1, 0, 0}, {0, 0, 0}, {0, 1, 0}};
  CHECK(fill_hole(lone).outcome == HoleOutcome::kOuter);
  // The end of a tube is closed by a cap.
  HoleLoop tube = ring(30, 3.0, 0.0, [](double) { return 0.0; });
  for (Double3& p : tube.opposite) p[2] = -0.6;
  f = fill_hole(tube);
  REQUIRE(f.outcome == HoleOutcome::kFilled);
  require_disk(tube, f);
}

TEST_CASE("hole filling: the outer border of rough ground is none, a hole in it is", "[unit]") {
  test::Random random(3);
  constexpr int kSide = 40;
  // Ground of unit edges, with hills, and noise of more than half an edge.
  std::vector<std::vector<double>> z(kSide + 3, std::vector<double>(kSide + 3));
  for (int i = 0; i < kSide + 3; ++i)
    for (int j = 0; j < kSide + 3; ++j)
      z[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] =
          6.0 * std::sin(0.21 * i) * std::cos(0.17 * j) + 0.6 * random.gaussian();
  const auto at = [&](int i, int j) {
    return Double3{1.0 * i, 1.0 * j, z[static_cast<std::size_t>(i + 1)][static_cast<std::size_t>(j + 1)]};
  };
  // The square from 0 to kSide, counter-clockwise seen from above; what lies across each edge, inside or outside.
  const auto square = [&](int inwards) {
    HoleLoop loop;
    for (int side = 0; side < 4; ++side)
      for (int k = 0; k < kSide; ++k) {
        const std::array<std::array<int, 2>, 4> corner = {
            {{k, 0}, {kSide, k}, {kSide - k, kSide}, {0, kSide - k}}};
        const std::array<std::array<int, 2>, 4> in = {{{0, 1}, {-1, 0}, {0, -1}, {1, 0}}};
        const auto& c = corner[static_cast<std::size_t>(side)];
        const auto& d = in[static_cast<std::size_t>(side)];
        loop.position.push_back(at(c[0], c[1]));
        loop.opposite.push_back(at(c[0] + inwards * d[0], c[1] + inwards * d[1]));
      }
    return loop;
  };
  HoleLoop border = square(1);
  std::reverse(border.position.begin(), border.position.end());
  std::reverse(border.opposite.begin(), border.opposite.end() - 1);
  CHECK(fill_hole(border).outcome == HoleOutcome::kOuter);
  const HoleLoop hole = square(-1);
  const HoleFilling f = fill_hole(hole);
  REQUIRE(f.outcome == HoleOutcome::kFilled);
  require_disk(hole, f);
}

TEST_CASE("hole filling: what is wider or folds farther than allowed stays open", "[unit]") {
  const HoleLoop disk = ring(24, 2.0, 0.7, [](double) { return 0.0; });  // 4 area / length = 0.99 diameters
  CHECK(fill_hole(disk, {.width = 4.1}).outcome == HoleOutcome::kFilled);
  CHECK(fill_hole(disk, {.width = 3.9}).outcome == HoleOutcome::kWide);
  HoleLoop slit = disk;
  for (auto* list : {&slit.position, &slit.opposite})
    for (Double3& p : *list) p[0] *= 5.0;
  // Of nearly parallel sides: twice their distance of 4, less where it ends.
  CHECK(fill_hole(slit, {.width = 6.5}).outcome == HoleOutcome::kFilled);
  CHECK(fill_hole(slit, {.width = 5.5}).outcome == HoleOutcome::kWide);
  // A flat cap on a tube turns by a right angle at its rim; two flaps that stand up at a hole by more.
  HoleLoop tube = ring(8, 1.0, 0.0, [](double) { return 0.0; });
  for (Double3& p : tube.opposite) p[2] = -0.6;
  CHECK(fill_hole(tube, {.width = 10.0, .min_cosine = -0.3}).outcome == HoleOutcome::kFilled);
  CHECK(fill_hole(tube, {.width = 10.0, .min_cosine = 0.9}).outcome == HoleOutcome::kSharp);
  HoleLoop flaps = disk;
  for (const std::size_t i : {3u, 4u}) flaps.opposite[i] = flaps.position[i] * 0.5 + Double3{0, 0, 0.4};
  CHECK(fill_hole(flaps, {.width = 10.0, .min_cosine = 0.0}).outcome == HoleOutcome::kSharp);
  CHECK(fill_hole(flaps, {.width = 10.0}).outcome == HoleOutcome::kFilled);
}

TEST_CASE("hole filling: ragged loops give disks, colours lie between the rim's", "[property]") {
  test::Random random(5);
  for (int trial = 0; trial < 12; ++trial) {
    CAPTURE(trial);
    const std::size_t n = 3 + random.below(60);
    HoleLoop loop = ring(n, 0.16 * static_cast<double>(n), 0.8, [](double) { return 0.0; });
    for (auto* list : {&loop.position, &loop.opposite})
      for (Double3& p : *list)
        for (double& c : p) c += 0.35 * random.gaussian();
    for (std::size_t i = 0; i < n; ++i)
      loop.rgba.push_back(0xff000000u + static_cast<std::uint32_t>(random.below(100)));
    for (std::uint32_t i = 0; i + 2 < n; ++i)
      if (random.below(8) == 0 && (i > 0 || n > 3)) loop.taken.push_back({i, i + 2});
    const HoleFilling f = fill_hole(loop);
    if (f.outcome != HoleOutcome::kFilled) continue;
    require_disk(loop, f);
    for (const std::uint32_t c : f.rgba) CHECK((c >= 0xff000000u && c < 0xff000000u + 100));
    CHECK(f.rgba.size() == f.position.size());
    for (const auto& t : f.faces)
      for (std::size_t e = 0; e < 3; ++e) {
        const std::array<std::uint32_t, 2> edge = {std::min(t[e], t[(e + 1) % 3]),
                                                   std::max(t[e], t[(e + 1) % 3])};
        CHECK_FALSE(std::binary_search(loop.taken.begin(), loop.taken.end(), edge));
      }
    const HoleFilling again = fill_hole(loop);
    CHECK((again.position == f.position && again.faces == f.faces));
  }
}

TEST_CASE("envelope cholesky: solves what a product made, refuses what is not definite", "[unit]") {
  // The Laplacian of a 17 x 13 grid plus a little.
  const std::int32_t w = 17, h = 13, n = w * h;
  SparseMatrix a;
  a.rows = a.columns = n;
  a.start.push_back(0);
  for (std::int32_t i = 0; i < n; ++i) {
    const auto put = [&](bool there, std::int32_t j, double v) {
      if (!there) return;
      a.column.push_back(j);
      a.value.push_back(v);
    };
    put(i >= w, i - w, -1);
    put(i % w > 0, i - 1, -1);
    put(true, i, 4.05);
    put(i % w < w - 1, i + 1, -1);
    put(i + w < n, i + w, -1);
    a.start.push_back(static_cast<std::int32_t>(a.column.size()));
  }
  std::vector<double> x(static_cast<std::size_t>(n)), b(x.size());
  test::Random random(3);
  for (double& v : x) v = random.in(-1, 1);
  multiply(a, x, b);
  EnvelopeCholesky solver(a);
  CHECK(solver.envelope() <= static_cast<std::uint64_t>(n * (h + 2)));
  REQUIRE(solver.factor(a));
  solver.solve(b);
  for (std::size_t i = 0; i < x.size(); ++i) CHECK(b[i] == Approx(x[i]).margin(1e-12));
  for (double& v : a.value)
    if (v > 0) v = 1.0;
  CHECK_FALSE(solver.factor(a));
}

TEST_CASE("hole filling: a membrane stays within the rim where a smooth patch bulges out", "[unit]") {
  // The rim of a bag: the surface goes down steeply and outwards on all sides.
  const HoleLoop bag = ring(40, 6.0, 0.5, [](double r) { return -4.0 * (r - 6.0); });
  const auto highest = [](const HoleFilling& f) {
    double z = 0.0;
    for (const Double3& p : f.position) z = std::max(z, std::abs(p[2]));
    return z;
  };
  const HoleFilling smooth = fill_hole(bag);
  REQUIRE(smooth.outcome == HoleOutcome::kFilled);
  CHECK(highest(smooth) > 1.0);
  const HoleFilling membrane = fill_hole(bag, {.shape = HoleShape::kMembrane});
  REQUIRE(membrane.outcome == HoleOutcome::kFilled);
  require_disk(bag, membrane);
  CHECK(membrane.position.size() > 20);
  CHECK(highest(membrane) < 1e-9);
  CHECK(fill_hole(bag, {.min_cosine = 0.5, .shape = HoleShape::kMembrane}).outcome == HoleOutcome::kSharp);
}

TEST_CASE("hole filling: limits tried one after the other give what each gives alone", "[unit]") {
  const HoleLoop bag = ring(40, 6.0, 0.5, [](double r) { return -4.0 * (r - 6.0); });
  const HoleLoop outside = ring(40, 6.0, -1.0, [](double) { return 3.0; });
  for (const HoleLoop& loop : {bag, outside}) {
    HoleFiller filler(loop);
    for (const HoleLimits& limits :
         {HoleLimits{.min_cosine = 0.9}, HoleLimits{.width = 2.0, .outer = true},
          HoleLimits{.shape = HoleShape::kMembrane, .outer = true}, HoleLimits{.outer = true},
          HoleLimits{.vertices = 20, .outer = true}, HoleLimits{.outer = true},
          HoleLimits{.vertices = 0, .shape = HoleShape::kMembrane, .outer = true}}) {
      const HoleFilling one = filler.fill(limits), alone = fill_hole(loop, limits);
      CHECK(one.outcome == alone.outcome);
      CHECK(one.width == alone.width);
      CHECK(one.min_cosine == alone.min_cosine);
      CHECK(one.fair == alone.fair);
      CHECK(one.position == alone.position);
      CHECK(one.faces == alone.faces);
    }
  }
}

TEST_CASE("hole filling: no more new vertices than allowed, and outer borders on request", "[unit]") {
  const HoleLoop loop = ring(48, 8.0, 1.0, [](double) { return 3.0; });
  const HoleFilling few = fill_hole(loop, {.vertices = 20});
  REQUIRE(few.outcome == HoleOutcome::kFilled);
  require_disk(loop, few);
  CHECK(few.position.size() <= 20);
  CHECK(few.position.size() > 5);
  const HoleFilling none = fill_hole(loop, {.vertices = 0, .shape = HoleShape::kMembrane});
  REQUIRE(none.outcome == HoleOutcome::kFilled);
  require_disk(loop, none);
  CHECK(none.position.empty());
  const HoleLoop outside = ring(48, 8.0, -1.0, [](double) { return 3.0; });
  CHECK(fill_hole(outside, {.shape = HoleShape::kMembrane}).outcome == HoleOutcome::kOuter);
  CHECK(fill_hole(outside, {.shape = HoleShape::kMembrane, .outer = true}).outcome == HoleOutcome::kFilled);
}

namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

double twice_area(const HoleLoop& loop, const Triangles& faces) {
  double area = 0.0;
  for (const auto& f : faces) {
    const Double3& a = loop.position[f[0]];
    area += norm(cross(loop.position[f[1]] - a, loop.position[f[2]] - a));
  }
  return area;
}

/// The table by definition: of every chord what is best with the best of both sides.
struct Chord {
  double angle = 0.0, area = 0.0;
  Double3 normal{};
  Triangles faces;
};
Chord best_chord(const HoleLoop& loop, const std::vector<Double3>& rim, std::uint32_t i, std::uint32_t j) {
  const auto n = static_cast<std::uint32_t>(loop.position.size());
  if (j == i + 1) return {0.0, 0.0, rim[i], {}};
  Chord best = {1e300, 1e300, {}, {}};
  if (j - i + 1 < n && std::count(loop.taken.begin(), loop.taken.end(), std::array{i, j}) > 0) return best;
  for (std::uint32_t k = i + 1; k < j; ++k) {
    const Chord left = best_chord(loop, rim, i, k), right = best_chord(loop, rim, k, j);
    if (left.angle > 1e9 || right.angle > 1e9) continue;
    const Double3 area = cross(loop.position[k] - loop.position[i], loop.position[j] - loop.position[i]);
    Chord here = {std::max(left.angle, right.angle), left.area + right.area + norm(area), unit_or_zero(area),
                  left.faces};
    for (const Double3& beside : {left.normal, right.normal})
      here.angle = std::max(here.angle, 1.0 - dot(here.normal, beside));
    if (j - i + 1 == n) here.angle = std::max(here.angle, 1.0 - dot(here.normal, rim[n - 1]));
    here.faces.insert(here.faces.end(), right.faces.begin(), right.faces.end());
    here.faces.push_back({i, k, j});
    if (std::pair{here.angle, here.area} < std::pair{best.angle, best.area}) best = here;
  }
  return best;
}

/// All triangulations of the polygon from vertex i to j.
std::vector<Triangles> all_triangulations(std::uint32_t i, std::uint32_t j) {
  if (j == i + 1) return {{}};
  std::vector<Triangles> out;
  for (std::uint32_t k = i + 1; k < j; ++k)
    for (const auto& left : all_triangulations(i, k))
      for (const auto& right : all_triangulations(k, j)) {
        auto& whole = out.emplace_back(left);
        whole.insert(whole.end(), right.begin(), right.end());
        whole.push_back({i, k, j});
      }
  return out;
}

}  // namespace

TEST_CASE("hole triangulation: every chord has the best of its sides, and least area is least", "[unit]") {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    test::Random random(seed);
    HoleLoop loop = ring(9, 3.0, 1.0, [](double) { return 0.0; });
    for (auto* list : {&loop.position, &loop.opposite})
      for (Double3& p : *list)
        for (double& x : p) x += random.in(-0.8, 0.8);
    if (seed % 3 == 0) loop.taken = {{0, 4}, {2, 6}};
    const std::vector<Double3> rim = boundary_normals(loop);
    INFO("seed " << seed);
    Triangles smooth = triangulate_hole(loop, rim).faces, expected = best_chord(loop, rim, 0, 8).faces;
    std::sort(smooth.begin(), smooth.end());
    std::sort(expected.begin(), expected.end());
    CHECK(smooth == expected);
    double least = 1e300;
    for (const Triangles& faces : all_triangulations(0, 8)) {
      bool taken = false;
      for (const auto& f : faces)
        for (const std::array<std::uint32_t, 2> side : {std::array{f[0], f[1]}, {f[1], f[2]}, {f[0], f[2]}})
          taken = taken || std::count(loop.taken.begin(), loop.taken.end(), side) > 0;
      if (!taken) least = std::min(least, twice_area(loop, faces));
    }
    CHECK(twice_area(loop, triangulate_hole(loop, rim, TriangulationGoal::kLeastArea).faces) ==
          Approx(least));
  }
}

}  // namespace hole_filling_test
