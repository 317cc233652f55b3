#include "kernels/certify/distance_samples.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <limits>
#include <numbers>

#include "kernels/certify/certificate_pair.h"
#include "octree/vector.h"
#include "tests/helpers/surfaces.h"

namespace distance_samples_test {

namespace {

using namespace tessera;
using test::Surface;

constexpr Double3 kOrigin = {0.5, 0.5, 0.0};

CertificateOptions generous(double tolerance) {
  return {.tolerance = tolerance, .max_distance = 2.0 * tolerance, .area_unit = 0x1p-40, .samples = 1u << 14};
}

DeviationPair measure(const Surface& a, const Surface& b, double tolerance, const Box3* core = nullptr) {
  return certify_pair({a.position, a.faces}, {b.position, b.faces}, core, kOrigin, generous(tolerance));
}

/// Root mean square distance, the slow way: a face has the same number of points in every triangle of a grid over it.
double slow_rms(const Surface& a, const Surface& b, int parts) {
  double squares = 0.0, area = 0.0;
  for (const auto& f : a.faces) {
    const Double3 &p = a.position[f[0]], u = a.position[f[1]] - p, v = a.position[f[2]] - p;
    const double each = 0.5 * norm(cross(u, v)) / (parts * parts);
    for (int j = 0; j < parts; ++j)
      for (int i = 0; i < 2 * (parts - j) - 1; ++i) {
        const double s = (i / 2 + (i % 2 + 1) / 3.0) / parts, t = (j + (i % 2 + 1) / 3.0) / parts;
        const double d = test::surface_distance(p + u * s + v * t, b);
        squares += each * d * d, area += each;
      }
  }
  return std::sqrt(squares / area);
}

}  // namespace

TEST_CASE("distance samples: an RMS is that of the distances, however generous the tolerance", "[property]") {
  const Surface two = test::height_grid(1, 1.0, [](double, double) { return 0.0; });
  const Surface wave = test::height_grid(
      40, 1.0, [](double x, double) { return 0.01 * std::sin(x * std::numbers::pi / 0.1); });
  const Surface tilted = test::height_grid(1, 1.0, [](double x, double) { return 0.02 * x; });
  const Surface raised = test::height_grid(1, 1.0, [](double, double) { return 0.01; });
  const Surface coarse = test::sphere(2, 0.5), fine = test::sphere(4, 0.5);
  for (const auto& [a, b] : {std::pair(&two, &wave), std::pair(&two, &tilted), std::pair(&two, &raised),
                             std::pair(&wave, &tilted), std::pair(&coarse, &fine)}) {
    const double there = slow_rms(*a, *b, a->faces.size() == 2 ? 60 : 6),
                 back = slow_rms(*b, *a, b->faces.size() == 2 ? 60 : 6);
    for (const double tolerance : {0.05, 0.5, 5.0}) {
      const DeviationPair pair = measure(*a, *b, tolerance);
      CHECK(pair.there.rms() == Approx(there).epsilon(0.02));
      CHECK(pair.back.rms() == Approx(back).epsilon(0.02));
      for (const DeviationReport& r : {pair.there, pair.back}) {
        CHECK(r.rms() <= r.lower * (1.0 + 1e-9));
        CHECK(r.lower <= r.upper);
        CHECK(r.samples > 0);
      }
      const DeviationReport alone =
          certify_deviation({a->position, a->faces}, nullptr, ClosestFaces(b->position, b->faces, kOrigin),
                            generous(tolerance));
      CHECK(alone.rms() == Approx(there).epsilon(0.02));
    }
  }
}

TEST_CASE("distance samples: boxes that tile space tell the mean of the whole, large faces across them too",
          "[property]") {
  const Surface two = test::height_grid(1, 1.0, [](double, double) { return 0.0; });
  const Surface hill = test::height_grid(30, 1.0, [](double x, double y) { return 0.1 * x * x * (1.0 - y); });
  const DeviationPair whole = measure(two, hill, 0.5);
  DeviationPair parts;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Box3 box = {{i / 3.0, j / 3.0, -1.0}, {(i + 1) / 3.0, (j + 1) / 3.0, 1.0}};
      const DeviationPair part = measure(two, hill, 0.5, &box);
      parts.there.merge(part.there);
      parts.back.merge(part.back);
    }
  CHECK(parts.there.rms() == Approx(whole.there.rms()).epsilon(0.01));
  CHECK(parts.back.rms() == Approx(whole.back.rms()).epsilon(0.01));
  CHECK(parts.there.rms() == Approx(slow_rms(two, hill, 60)).epsilon(0.02));
}

TEST_CASE("distance samples: the histogram is that of the area, also beyond the tolerance", "[unit]") {
  // Half of the plane is farther than the tolerance, and no face boundary lies there.
  const Surface two = test::height_grid(1, 1.0, [](double, double) { return 0.0; });
  const Surface tilted = test::height_grid(1, 1.0, [](double x, double) { return 0.2 * x; });
  CertificateOptions options = generous(0.1 / std::sqrt(1.04));
  options.max_distance *= 2.0;
  const DeviationReport r =
      certify_pair({two.position, two.faces}, {tilted.position, tilted.faces}, nullptr, kOrigin, options)
          .there;
  double all = 0.0, exceeding = 0.0;
  for (std::size_t i = 0; i < r.histogram.size(); ++i) {
    all += static_cast<double>(r.histogram[i]);
    if (i >= kDeviationBins) exceeding += static_cast<double>(r.histogram[i]);
  }
  CHECK(exceeding / all == Approx(0.5).margin(0.02));
}

TEST_CASE("distance samples: faces picked near the points tell what all of them tell, bit for bit",
          "[property]") {
  const Surface two = test::height_grid(1, 1.0, [](double, double) { return 0.0; });
  const Surface wave = test::height_grid(
      40, 1.0, [](double x, double) { return 0.01 * std::sin(x * std::numbers::pi / 0.1); });
  const Surface tilted = test::height_grid(3, 1.0, [](double x, double) { return 0.2 * x; });
  const Surface coarse = test::sphere(2, 0.5), fine = test::sphere(4, 0.5);
  // All of them across one box.
  Surface crossing;
  for (std::uint32_t i = 0; i < 400; ++i) {
    const double at = i * 0.002;
    crossing.position.insert(crossing.position.end(),
                             {{0.0, at, 0.001 * at}, {1.0, 1.0 - at, 0.01}, {1.0, 1.001 - at, 0.0}});
    crossing.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const Surface& needles = crossing;
  for (const auto& [a, b] : {std::pair(&two, &wave), std::pair(&wave, &two), std::pair(&two, &tilted),
                             std::pair(&wave, &tilted), std::pair(&coarse, &fine), std::pair(&fine, &coarse),
                             std::pair(&two, &needles), std::pair(&needles, &wave)})
    for (const double tolerance : {0.005, 0.5}) {
      CertificateOptions options = generous(tolerance);
      const SurfaceFaces from{a->position, a->faces}, to{b->position, b->faces};
      const ClosestFaces all(b->position, b->faces, kOrigin);
      std::vector<float> bound;
      options.samples = 0;
      const DeviationReport before = certify_deviation(from, nullptr, all, options, &bound);
      options.samples = 1u << 14;
      DeviationReport picked = before, whole = before;
      picked.area = whole.area = 1.0;
      measure_samples(from, to, nullptr, kOrigin, bound, options, picked);
      measure_samples(spread_samples(from, nullptr, samples_of(options, a->faces.size(), b->faces.size())),
                      false, all, options, whole);
      CHECK(picked.samples == whole.samples);
      CHECK(picked.square_integral == whole.square_integral);
      CHECK(picked.histogram == whole.histogram);
      CHECK(picked.lower == whole.lower);
      CHECK(picked.witness == whole.witness);
      CHECK(picked.witness_face == whole.witness_face);
    }
}

TEST_CASE("distance samples: points have equal shares of the area, and lie in the box", "[unit]") {
  Surface s;
  s.position = {{0, 0, 0}, {3, 0, 0}, {0, 1, 0}, {0, 0, 5}, {1, 0, 5}, {0, 1, 5}, {0, 0, 9}, {1, 0, 9}};
  s.faces = {{0, 1, 2}, {0, 1, 1}, {3, 4, 5}, {6, 7, 7}};
  s.faces[1] = {0, 0, 1};  // no area
  s.faces.pop_back();
  const SurfaceSamples all = spread_samples({s.position, s.faces}, nullptr, 4000);
  REQUIRE(all.at.size() == 4000);
  std::size_t first = 0;
  for (std::size_t i = 0; i < all.at.size(); ++i) {
    first += all.face[i] == 0;
    CHECK(test::triangle_distance(all.at[i], s.position[s.faces[all.face[i]][0]],
                                  s.position[s.faces[all.face[i]][1]],
                                  s.position[s.faces[all.face[i]][2]]) < 1e-12);
  }
  CHECK(first == Approx(3000).margin(2));
  const Box3 box = {{0.5, 0.0, -1.0}, {1.0, 0.25, 1.0}};
  const SurfaceSamples some = spread_samples({s.position, s.faces}, &box, 500);
  REQUIRE(some.at.size() == 500);
  Double3 mean{};
  for (const Double3& p : some.at) {
    mean = mean + p * (1.0 / 500);
    for (std::size_t k = 0; k < 3; ++k) CHECK((p[k] >= box.low[k] - 1e-12 && p[k] <= box.high[k] + 1e-12));
  }
  CHECK(mean[0] == Approx(0.75).margin(0.01));
  CHECK(mean[1] == Approx(0.125).margin(0.005));
  const std::vector<std::array<std::uint32_t, 3>> flat = {{0, 0, 1}, {2, 2, 2}};
  CHECK(spread_samples({s.position, flat}, nullptr, 10).at.empty());
}

}  // namespace distance_samples_test
