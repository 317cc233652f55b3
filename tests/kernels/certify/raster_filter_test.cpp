#include "kernels/certify/raster_filter.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/certify/certificate_pair.h"
#include "octree/vector.h"
#include "tests/helpers/surfaces.h"

namespace raster_filter_test {

namespace {

using namespace tessera;
using test::Surface;

SurfaceFaces faces_of(const Surface& s) {
  return {s.position, s.faces};
}

Box3 box_of(const Surface& s, double margin) {
  Box3 box{s.position[0], s.position[0]};
  for (const Double3& p : s.position)
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], p[k] - margin);
      box.high[k] = std::max(box.high[k], p[k] + margin);
    }
  return box;
}

bool inside(const Double3& p, const Box3& box) {
  bool in = true;
  for (std::size_t k = 0; k < 3; ++k) in = in && p[k] >= box.low[k] && p[k] <= box.high[k];
  return in;
}

/// Settled faces, after points of each were measured by hand against every face of the reference.
std::size_t hold_to_truth(const Surface& surface, const Surface& reference, const Box3& core,
                          double tolerance, double pixel, test::Random& random, int points = 8) {
  RasterFilterReport report;
  const std::vector<std::uint32_t> doubts =
      raster_doubts(faces_of(surface), core, faces_of(reference), core.low, tolerance, pixel, &report);
  CHECK(report.faces == report.decided + doubts.size());
  std::vector<bool> open(surface.faces.size());
  for (const std::uint32_t f : doubts) open[f] = true;
  for (std::size_t f = 0; f < surface.faces.size(); ++f) {
    if (open[f]) continue;
    for (int i = 0; i < points; ++i) {
      const Double3 p = i < 3 ? surface.position[surface.faces[f][static_cast<std::size_t>(i)]]
                              : test::random_point(surface, f, random);
      if (!inside(p, core)) continue;
      const double truth = test::surface_distance(p, reference);
      if (truth > tolerance) {
        INFO("face " << f << " is " << truth << " away, tolerance " << tolerance << ", pixel " << pixel);
        FAIL_CHECK("settled, and exceeds");
      }
    }
  }
  return report.decided;
}

/// The surface of [0, 1]^3, n x n squares a side.
Surface cube(int n) {
  Surface s;
  std::map<std::array<int, 3>, std::uint32_t> known;
  const auto vertex = [&](std::array<int, 3> at) {
    const auto [it, fresh] = known.try_emplace(at, static_cast<std::uint32_t>(s.position.size()));
    if (fresh) s.position.push_back({1.0 * at[0] / n, 1.0 * at[1] / n, 1.0 * at[2] / n});
    return it->second;
  };
  for (std::size_t k = 0; k < 3; ++k)
    for (const int side : {0, n})
      for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
          const auto at = [&](int di, int dj) {
            std::array<int, 3> p{};
            p[k] = side, p[(k + 1) % 3] = i + di, p[(k + 2) % 3] = j + dj;
            return vertex(p);
          };
          const std::uint32_t a = at(0, 0), b = at(1, 0), c = at(1, 1), d = at(0, 1);
          if (side == 0)
            s.faces.insert(s.faces.end(), {{a, c, b}, {a, d, c}});
          else
            s.faces.insert(s.faces.end(), {{a, b, c}, {a, c, d}});
        }
  return s;
}

Surface moved(Surface s, const Double3& by) {
  for (Double3& p : s.position) p = p + by;
  return s;
}

Surface rotated(Surface s) {
  for (Double3& p : s.position)
    p = {0.8 * p[0] - 0.6 * p[1], 0.36 * p[0] + 0.48 * p[1] - 0.8 * p[2],
         0.48 * p[0] + 0.64 * p[1] + 0.6 * p[2]};
  return s;
}

Surface noisy(Surface s, double by, test::Random& random) {
  for (Double3& p : s.position)
    for (double& c : p) c += random.in(-by, by);
  return s;
}

double hills(double x, double y) {
  return 0.2 * std::sin(5.0 * x) * std::cos(4.0 * y + 1.0);
}

}  // namespace

TEST_CASE("raster filter: what it settles stays within the tolerance, measured by hand", "[property]") {
  test::Random random(1);
  std::size_t decided = 0;
  for (int round = 0; round < 400; ++round) {
    Surface a, b;
    switch (round % 6) {
      case 0:
        a = test::height_grid(9, 1.0, hills), b = test::height_grid(13, 1.0, hills);
        break;
      case 1:
        a = test::sphere(3, 1.0), b = test::sphere(2, 1.0);
        break;
      case 2:
        a = rotated(cube(3)), b = noisy(rotated(cube(4)), 0.02, random);
        break;
      case 3:
        b = noisy(test::height_grid(12, 1.0, hills), 0.03, random), a = noisy(b, 0.02, random);
        break;
      case 4:  // holes, islands and faces that meet no other
        b = test::soup(120, 0.3, random), a = noisy(b, 0.02, random);
        break;
      default:  // a wall of two sides, open and torn
        b = test::height_grid(10, 1.0, hills);
        for (std::size_t f = 0; f < b.faces.size(); f += 9)
          b.faces.erase(b.faces.begin() + static_cast<long>(f));
        a = noisy(test::height_grid(7, 1.0, hills), 0.01, random);
        const Surface back = moved(b, {0, 0, -0.05});
        const auto n = static_cast<std::uint32_t>(b.position.size());
        b.position.insert(b.position.end(), back.position.begin(), back.position.end());
        for (const auto& f : back.faces) b.faces.push_back({f[0] + n, f[2] + n, f[1] + n});
    }
    Box3 core = box_of(b, 0.1);
    if (round % 4 == 3)  // a cell of several
      for (std::size_t k = 0; k < 3; ++k)
        core.high[k] = core.low[k] + random.in(0.3, 0.8) * (core.high[k] - core.low[k]);
    // Near the distance of some face, so that many are close to it.
    double tolerance = 0.0;
    for (int i = 0; i < 5; ++i)
      tolerance = std::max(
          tolerance, test::surface_distance(test::random_point(a, random.below(a.faces.size()), random), b));
    tolerance = std::max(1e-3, tolerance * random.in(0.6, 1.0));
    const double pixel = std::pow(10.0, random.in(-1.8, -0.4));
    decided += hold_to_truth(a, b, core, tolerance, pixel, random);
    decided += hold_to_truth(b, a, core, tolerance, pixel, random);
  }
  CHECK(decided > 800);
}

TEST_CASE("raster filter: a hole far smaller than a pixel is not overlooked", "[unit]") {
  test::Random random(2);
  const auto flat = [](double, double) { return 0.0; };
  Surface reference = test::height_grid(40, 1.0, flat);
  const Surface whole = reference;
  // One of 40 x 40 squares is missing, a pixel is eight of them wide; a hole's middle is 0.0125 from its rim. The border
  // of the reference lies outside the core.
  for (int f = 0; f < 2; ++f) reference.faces.erase(reference.faces.begin() + 2 * (40 * 21 + 17));
  const Surface lid = test::height_grid(10, 1.0, flat);
  const Box3 core{{0.1, 0.1, -0.5}, {0.9, 0.9, 0.5}};
  hold_to_truth(lid, reference, core, 0.01, 0.2, random, 40);
  CHECK(raster_doubts(faces_of(lid), core, faces_of(whole), {0, 0, 0}, 0.01, 0.2).empty());
  const std::vector<std::uint32_t> doubts =
      raster_doubts(faces_of(lid), core, faces_of(reference), {0, 0, 0}, 0.01, 0.2);
  CHECK(doubts.size() > 0);
  CHECK(doubts.size() < lid.faces.size());
  // A slit of no width counts as one too: nobody knows here that it is closed.
  Surface slit = whole;
  const auto n = static_cast<std::uint32_t>(slit.position.size());
  slit.position.insert(slit.position.end(), whole.position.begin(), whole.position.end());
  for (std::size_t f = slit.faces.size() / 2; f < slit.faces.size(); ++f)
    for (std::uint32_t& v : slit.faces[f]) v += n;
  CHECK(raster_doubts(faces_of(lid), core, faces_of(slit), {0, 0, 0}, 0.01, 0.02).size() > 0);
  // A sheet above does not stand in for the one that has the hole.
  const Surface above = moved(whole, {0, 0, 0.2});
  Surface two = reference;
  const auto m = static_cast<std::uint32_t>(two.position.size());
  two.position.insert(two.position.end(), above.position.begin(), above.position.end());
  for (const auto& f : above.faces) two.faces.push_back({f[0] + m, f[1] + m, f[2] + m});
  CHECK(raster_doubts(faces_of(lid), core, faces_of(two), {0, 0, 0}, 0.01, 0.2) == doubts);
}

TEST_CASE("raster filter: it settles what is near, on steep and closed surfaces too", "[unit]") {
  const auto share = [](const Surface& a, const Surface& b, double tolerance) {
    const Box3 core = box_of(b, 0.2);
    RasterFilterReport report;
    raster_doubts(faces_of(a), core, faces_of(b), core.low, tolerance,
                  raster_pixel(faces_of(a), faces_of(b), tolerance), &report);
    CHECK(report.faces == a.faces.size());
    return static_cast<double>(report.decided) / static_cast<double>(report.faces);
  };
  test::Random random(3);
  const Surface hilly = test::height_grid(60, 1.0, hills);
  const Surface ball = test::sphere(5, 1.0);
  CHECK(share(hilly, hilly, 0.002) > 0.9);  // but at its border
  CHECK(share(ball, ball, 0.01) == 1.0);
  CHECK(share(ball, test::sphere(4, 1.0), 0.005) > 0.6);  // less where it looks between two axes
  CHECK(share(test::sphere(4, 1.0), ball, 0.005) > 0.6);
  CHECK(share(ball, test::sphere(4, 1.0), 0.01) > 0.95);
  CHECK(share(noisy(ball, 0.003, random), ball, 0.01) > 0.9);
  CHECK(share(rotated(cube(8)), rotated(cube(8)), 0.05) > 0.4);  // no pixel at a crease has one plane
  CHECK(share(moved(hilly, {0, 0, 0.01}), hilly, 0.005) < 0.2);
}

TEST_CASE("raster filter: soups of large faces end in doubt, not in endless drawing", "[unit]") {
  test::Random random(4);
  const Surface tangle = test::soup(3000, 0.9, random);
  RasterFilterReport report;
  raster_doubts(faces_of(tangle), box_of(tangle, 0.0), faces_of(tangle), {0, 0, 0}, 0.01, 1e-5, &report);
  CHECK(report.layers <= 3 * (4 * 2 * tangle.faces.size() + 4096));
}

TEST_CASE("prove by raster: the answer is that of the certificate", "[property]") {
  test::Random random(5);
  const auto both = [&](const Surface& a, const Surface& b) {
    const Box3 core = box_of(a, 0.1);
    CertificateOptions options;
    options.tolerance = 0.3;
    options.max_distance = 0.6;
    options.area_unit = 1e-9;
    const DeviationPair pair = certify_pair(faces_of(a), faces_of(b), &core, core.low, options);
    const double upper = std::max(pair.there.upper, pair.back.upper);
    REQUIRE(std::isfinite(upper));
    int yes = 0;
    for (const double factor : {0.5, 0.9, 0.97, 1.0, 1.001, 1.03, 1.2, 2.0}) {
      options.tolerance = factor * upper;
      options.max_distance = 2.0 * options.tolerance;
      options.enough = options.tolerance;
      const DeviationPair exact = certify_pair(faces_of(a), faces_of(b), &core, core.low, options);
      const bool proven = std::max(exact.there.upper, exact.back.upper) <= options.tolerance;
      const RasterProof raster = prove_by_raster(faces_of(a), faces_of(b), core, core.low, options);
      INFO("tolerance " << factor << " times the bound");
      if (raster.proven) CHECK(proven);
      if (factor > 1.0005) CHECK(raster.proven);
      if (factor < 0.95) CHECK(!raster.proven);
      yes += raster.proven;
    }
    CHECK(yes >= 3);
  };
  both(test::sphere(3, 1.0), test::sphere(4, 1.0));
  both(cube(4), noisy(cube(7), 0.01, random));
  both(test::height_grid(20, 1.0, hills), noisy(test::height_grid(20, 1.0, hills), 0.02, random));
  both(noisy(test::height_grid(30, 1.0, hills), 0.01, random),
       noisy(test::height_grid(30, 1.0, hills), 0.01, random));
}

}  // namespace raster_filter_test
