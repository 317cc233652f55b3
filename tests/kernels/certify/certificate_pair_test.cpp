#include "kernels/certify/certificate_pair.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <vector>

#include "kernels/certify/overlay_proof.h"
#include "tests/helpers/surfaces.h"

namespace certificate_pair_test {

namespace {

using namespace tessera;
using test::Surface;

constexpr Double3 kOrigin = {0.5, 0.5, 0.0};

CertificateOptions options_for(double tolerance) {
  return {.tolerance = tolerance, .max_distance = 1.25 * tolerance, .area_unit = 0x1p-40};
}

DeviationPair measure(const Surface& a, const Surface& b, double tolerance, const Box3* core = nullptr) {
  return certify_pair({a.position, a.faces}, {b.position, b.faces}, core, kOrigin, options_for(tolerance));
}

OverlayProof overlay(const Surface& coarse, const Surface& fine, double tolerance) {
  return prove_by_overlay({coarse.position, coarse.faces}, {fine.position, fine.faces}, nullptr,
                          1.25 * tolerance, kOrigin, options_for(tolerance));
}

std::size_t proven(const OverlaySide& side) {
  std::size_t n = 0;
  for (const float b : side.bound) n += std::isfinite(b);
  return n;
}

/// No point of `a` may be farther from `b` than its face's bound. Returns the largest distance found.
double check_bounds(const Surface& a, const Surface& b, const std::vector<float>& bound, test::Random& random,
                    int samples) {
  double maximum = 0.0;
  for (int i = 0; i < samples; ++i) {
    const std::size_t face = random.below(a.faces.size());
    const double d = test::surface_distance(test::random_point(a, face, random), b);
    maximum = std::max(maximum, d);
    CHECK(d <= static_cast<double>(bound[face]));
  }
  return maximum;
}

double hills(double x, double y) {
  return 0.05 * std::sin(7.0 * x) * std::cos(5.0 * y);
}

/// A coarse grid whose corners lie on the fine one.
constexpr int kCoarse = 8, kFine = 48;
constexpr int kAlike = 40;  ///< not so much coarser that one overlay would do

}  // namespace

TEST_CASE("certificate of a pair: the overlay proves most of a terrain, and never too much", "[property]") {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    test::Random random(seed);
    const double noise = 0.001 * static_cast<double>(seed - 1);
    const Surface coarse = test::height_grid(kCoarse, 1.0, hills);
    const Surface fine = test::height_grid(
        kFine, 1.0, [&](double x, double y) { return hills(x, y) + random.in(-noise, noise); });
    const OverlayProof proof = overlay(coarse, fine, 0.02);
    CHECK(proven(proof.coarse) >= coarse.faces.size() * 6 / 10);
    CHECK(proven(proof.fine) >= fine.faces.size() * 7 / 10);
    check_bounds(coarse, fine, proof.coarse.bound, random, 3000);
    check_bounds(fine, coarse, proof.fine.bound, random, 3000);
    const DeviationPair pair = measure(coarse, fine, 0.02);
    CHECK(pair.there.upper <= 1.03 * pair.there.lower * (1.0 + 1e-6));
    CHECK(pair.back.upper <= 1.03 * pair.back.lower * (1.0 + 1e-6));
    CHECK(pair.there.faces == coarse.faces.size());
    CHECK(pair.back.faces == fine.faces.size());
  }
}

TEST_CASE("certificate of a pair: says what the search of both directions says", "[property]") {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    test::Random random(seed);
    const double noise = 0.002 * static_cast<double>(seed);
    Surface a = test::height_grid(5, 1.0, [&](double, double) { return random.in(-noise, noise); });
    Surface b = test::height_grid(23, 1.0, [&](double, double) { return random.in(-noise, noise); });
    if (seed == 5) a = test::sphere(2, 1.0), b = test::sphere(5, 1.0);
    if (seed == 6) a = test::soup(20, 0.4, random), b = test::soup(300, 0.3, random);
    const double tolerance = seed == 5 ? 0.2 : seed == 6 ? 0.3 : 0.02;
    const CertificateOptions options = options_for(tolerance);
    const DeviationPair pair = measure(a, b, tolerance);
    const DeviationPair swapped = measure(b, a, tolerance);
    CHECK(swapped.back.upper == pair.there.upper);
    CHECK(swapped.there.upper == pair.back.upper);
    const DeviationReport there = certify_deviation({a.position, a.faces}, nullptr,
                                                    ClosestFaces(b.position, b.faces, kOrigin), options);
    const DeviationReport back = certify_deviation({b.position, b.faces}, nullptr,
                                                   ClosestFaces(a.position, a.faces, kOrigin), options);
    for (const auto& [mine, theirs] : {std::pair(pair.there, there), std::pair(pair.back, back)}) {
      CHECK(mine.beyond == theirs.beyond);
      CHECK(mine.area == Approx(theirs.area));
      CHECK(mine.rms() == Approx(theirs.rms()).epsilon(0.1));
      if (theirs.beyond) continue;
      CHECK(mine.upper >= theirs.lower);
      CHECK(theirs.upper >= mine.lower);
      CHECK(mine.upper == Approx(theirs.upper).epsilon(0.04));
    }
  }
}

TEST_CASE("certificate of a pair: where one surface has no face, all of the other is beyond", "[unit]") {
  const Surface hill = test::height_grid(kCoarse, 1.0, hills), none;
  for (const DeviationPair& pair : {measure(hill, none, 0.1), measure(none, hill, 0.1)}) {
    const bool first = pair.there.faces > 0;
    const DeviationReport &some = first ? pair.there : pair.back, &nothing = first ? pair.back : pair.there;
    CHECK(some.faces == hill.faces.size());
    CHECK(some.beyond);
    CHECK(std::isinf(some.upper));
    CHECK(nothing.faces == 0);
    CHECK_FALSE(nothing.beyond);
  }
}

TEST_CASE("certificate of a pair: what is missing from the fine surface is missed", "[property]") {
  const int cells = GENERATE(kCoarse, kAlike);
  CAPTURE(cells);
  const Surface coarse = test::height_grid(cells, 1.0, hills);
  const Surface whole = test::height_grid(kFine, 1.0, hills);
  const double tolerance = 0.01;  // a cell of the fine grid is 0.02 wide
  REQUIRE(measure(coarse, whole, tolerance).there.upper <= tolerance);
  test::Random random(2);
  for (int trial = 0; trial < 40; ++trial) {
    // A hole of a few cells anywhere: at corners and sides of coarse faces as well as within.
    const double x = std::floor(random.in(1.0, kFine - 4.0)) / kFine,
                 y = std::floor(random.in(1.0, kFine - 4.0)) / kFine;
    Surface fine = whole;
    std::erase_if(fine.faces, [&](const auto& f) {
      double low = 1e9, high = -1e9, left = 1e9, right = -1e9;
      for (const std::uint32_t v : f) {
        left = std::min(left, fine.position[v][0]), right = std::max(right, fine.position[v][0]);
        low = std::min(low, fine.position[v][1]), high = std::max(high, fine.position[v][1]);
      }
      constexpr double kWide = 2.0 / kFine, kSlack = 1e-9;
      return left >= x - kSlack && right <= x + kWide + kSlack && low >= y - kSlack &&
             high <= y + kWide + kSlack;
    });
    REQUIRE(fine.faces.size() == whole.faces.size() - 8);
    const DeviationPair pair = measure(coarse, fine, tolerance);
    CHECK(pair.there.upper > tolerance);
    CHECK(pair.back.upper <= tolerance);
  }
}

TEST_CASE("certificate of a pair: what is missing from the coarse surface is missed", "[property]") {
  const Surface whole = test::height_grid(kCoarse, 1.0, hills);
  const Surface fine = test::height_grid(kFine, 1.0, hills);
  for (std::size_t f = 0; f < whole.faces.size(); f += 3) {
    Surface coarse = whole;
    coarse.faces.erase(coarse.faces.begin() + static_cast<std::ptrdiff_t>(f));
    CHECK(measure(coarse, fine, 0.01).back.upper > 0.01);
    CHECK(measure(coarse, fine, 0.01).there.upper <= 0.01);
  }
}

TEST_CASE("certificate of a pair: turned faces and folds change no bound", "[property]") {
  test::Random random(4);
  const Surface coarse = test::height_grid(kCoarse, 1.0, hills);
  Surface fine = test::height_grid(kFine, 1.0, hills);
  const DeviationPair plain = measure(coarse, fine, 0.02);
  Surface swapped = fine;
  for (auto& f : swapped.faces) std::swap(f[1], f[2]);
  CHECK(measure(coarse, swapped, 0.02).there.upper == Approx(plain.there.upper).epsilon(0.01));
  // Vertices moved sideways by more than a cell: the surface folds over itself.
  for (Double3& p : fine.position)
    if (p[0] > 0.05 && p[0] < 0.95 && p[1] > 0.05 && p[1] < 0.95)
      p[0] += random.in(-0.02, 0.02), p[1] += random.in(-0.02, 0.02);
  const OverlayProof proof = overlay(coarse, fine, 0.02);
  check_bounds(coarse, fine, proof.coarse.bound, random, 5000);
  check_bounds(fine, coarse, proof.fine.bound, random, 5000);
  CHECK(proven(proof.coarse) > 0);
}

TEST_CASE("certificate of a pair: boxes that tile space give every point once and the same maximum",
          "[property]") {
  const Surface coarse = test::height_grid(kCoarse, 1.0, hills);
  const Surface fine = test::height_grid(kFine, 1.0, hills);
  const DeviationPair whole = measure(coarse, fine, 0.02);
  DeviationPair parts;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Box3 box = {{i / 3.0, j / 3.0, -1.0}, {(i + 1) / 3.0, (j + 1) / 3.0, 1.0}};
      const DeviationPair part = measure(coarse, fine, 0.02, &box);
      parts.there.merge(part.there);
      parts.back.merge(part.back);
    }
  CHECK(parts.there.area == Approx(whole.there.area));
  CHECK(parts.back.area == Approx(whole.back.area));
  CHECK(parts.there.upper == Approx(whole.there.upper).epsilon(0.04));
  CHECK(parts.back.upper == Approx(whole.back.upper).epsilon(0.04));
  CHECK(parts.there.rms() == Approx(whole.there.rms()).epsilon(0.05));
  CHECK(parts.back.rms() == Approx(whole.back.rms()).epsilon(0.05));
}

TEST_CASE(
    "certificate of a pair: fine faces across the boundary of the core are proven too, and never too much",
    "[property]") {
  const Surface coarse = test::height_grid(kCoarse, 1.0, hills);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    test::Random random(seed);
    // From smooth to steep and folded: then a face may leave the core at a height above the margin.
    const double noise = 0.006 * static_cast<double>(seed - 1);
    Surface fine = test::height_grid(
        kFine, 1.0, [&](double x, double y) { return hills(x, y) + random.in(-noise, noise); });
    for (Double3& p : fine.position)
      if (seed > 3) p[0] += random.in(-noise, noise), p[1] += random.in(-noise, noise);
    for (const double tolerance : {0.004, 0.02}) {
      const Box3 core = {{0.31, 0.27, -1.0}, {0.67, 0.73, 1.0}};
      const OverlayProof proof =
          prove_by_overlay({coarse.position, coarse.faces}, {fine.position, fine.faces}, &core,
                           1.25 * tolerance, kOrigin, options_for(tolerance));
      std::size_t across = 0, found = 0;
      for (std::size_t f = 0; f < fine.faces.size(); ++f) {
        int inside = 0;
        for (const std::uint32_t v : fine.faces[f]) {
          const Double3& p = fine.position[v];
          inside += p[0] > core.low[0] && p[0] < core.high[0] && p[1] > core.low[1] && p[1] < core.high[1];
        }
        if (inside == 0 || inside == 3) continue;
        ++across;
        found += std::isfinite(proof.fine.bound[f]);
        for (int i = 0; i < 40; ++i) {
          const Double3 p = test::random_point(fine, f, random);
          if (p[0] < core.low[0] || p[0] > core.high[0] || p[1] < core.low[1] || p[1] > core.high[1])
            continue;
          CHECK(test::surface_distance(p, coarse) <= static_cast<double>(proof.fine.bound[f]));
        }
      }
      if (seed == 1 && tolerance == 0.02) CHECK(2 * found > across);
    }
  }
}

}  // namespace certificate_pair_test
