// A box onto a bent and noisy scan of it.
#include "kernels/edit/scan_fit.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "octree/error.h"

namespace scan_fit_test {

using namespace tessera;

namespace {

constexpr Double3 kBox = {2, 1, 0.5};
constexpr double kNoise = 0.004;

/// What was built: bent along x, twisted a little, moved.
Double3 built(const Double3& p) {
  return p + Double3{0.02 + 0.01 * p[2], 0.02 * p[0] * p[2], 0.06 * (p[0] - 1) * (p[0] - 1) - 0.03};
}

SurfaceFoot foot_on_box(const Double3& p, double max_distance) {
  SurfaceFoot foot;
  Double3 in;
  for (std::size_t a = 0; a < 3; ++a) in[a] = std::clamp(p[a], 0.0, kBox[a]);
  foot.at = in;
  if (in == p) {
    double nearest = 1e300;
    for (std::size_t a = 0; a < 3; ++a)
      for (const double end : {0.0, kBox[a]})
        if (std::fabs(p[a] - end) < nearest) {
          nearest = std::fabs(p[a] - end);
          foot.at = p, foot.at[a] = end;
          foot.normal = {}, foot.normal[a] = end > 0.0 ? 1.0 : -1.0;
        }
  } else {
    foot.normal = unit(p - in);
  }
  foot.found = norm(p - foot.at) <= max_distance;
  return foot;
}

std::vector<SurfaceFoot> feet(std::span<const Double3> points, double max_distance) {
  std::vector<SurfaceFoot> out;
  for (const Double3& p : points) out.push_back(foot_on_box(p, max_distance));
  return out;
}

Double3 place_on_box(std::mt19937& random) {
  std::uniform_real_distribution<double> u(0.0, 1.0);
  const double areas[3] = {kBox[1] * kBox[2], kBox[0] * kBox[2], kBox[0] * kBox[1]};
  double at = u(random) * (areas[0] + areas[1] + areas[2]);
  std::size_t a = 0;
  while (a < 2 && at > areas[a]) at -= areas[a++];
  Double3 p = {u(random) * kBox[0], u(random) * kBox[1], u(random) * kBox[2]};
  p[a] = u(random) < 0.5 ? 0.0 : kBox[a];
  return p;
}

struct Scan {
  std::vector<PlaneCell> cells;
  PlaneCellReport report;
  explicit Scan(int points, const Double3& moved = {}, bool outliers = false) {
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, kNoise);
    std::uniform_real_distribution<double> anywhere(-0.2, 2.2);
    PlaneCells sums({-0.5, -0.5, -0.5}, {2.5, 1.5, 1.0}, 3.0 / 1024);
    for (int i = 0; i < points; ++i) {
      const Double3 p = built(place_on_box(random)) + moved;
      sums.add(p + Double3{noise(random), noise(random), noise(random)}, {});
      // A table beneath the box.
      if (outliers && i % 4 == 0) sums.add({anywhere(random), anywhere(random), -0.14 + noise(random)}, {});
    }
    cells = sums.finish(report);
  }
};

ScanFitOptions options(const Scan& scan) {
  ScanFitOptions o;
  o.max_distance = 0.23;
  o.cell_edge = scan.report.edge;
  o.high = kBox;
  return o;
}

/// Distances of the moved box from what was built, along its normals, away from edges.
double rms_from_truth(const DisplacementLattice& lattice) {
  std::mt19937 random(9);
  double sum = 0.0;
  int count = 0;
  while (count < 5000) {
    const Double3 p = place_on_box(random);
    const SurfaceFoot side = foot_on_box(p, 1.0);
    const Double3 off = p + lattice.at(p) - built(p);
    sum += dot(off, side.normal) * dot(off, side.normal);
    ++count;
  }
  return std::sqrt(sum / count);
}

}  // namespace

TEST_CASE("scan fit: a bent box is found below a third of the noise", "[unit]") {
  const Scan scan(80000);
  ScanFitReport report;
  const DisplacementLattice lattice = fit_scan(scan.cells, feet, options(scan), report);
  CHECK(rms_from_truth(lattice) < kNoise / 3);
  CHECK(report.matched > scan.cells.size() * 9 / 10);
  CHECK(report.scales.front().kept);
  CHECK(report.wavelength < 2.3);
  for (const int order : {1, 3}) {
    ScanFitOptions o = options(scan);
    o.order = order;
    CHECK(rms_from_truth(fit_scan(scan.cells, feet, o, report)) < 2 * kNoise);
  }
}

TEST_CASE("scan fit: a table beside the box does not draw it", "[unit]") {
  const Scan scan(80000, {}, true);
  ScanFitReport report;
  const DisplacementLattice lattice = fit_scan(scan.cells, feet, options(scan), report);
  CHECK(rms_from_truth(lattice) < kNoise / 2);
}

TEST_CASE("scan fit: a scan elsewhere and one of a corner are refused", "[unit]") {
  ScanFitReport report;
  const Scan away(20000, {0, 0, 0.45});
  ScanFitOptions o = options(away);
  o.max_distance = 0.01;
  CHECK_THROWS_AS(fit_scan(std::vector<PlaneCell>{}, feet, o, report), EmptyError);
  std::vector<PlaneCell> few(away.cells.begin(), away.cells.begin() + 20);
  for (PlaneCell& c : few) c.at = {1.0, 0.5, 0.505}, c.normal = {0, 0, 1};
  CHECK_THROWS_AS(fit_scan(few, feet, o, report), ValidationError);
  for (PlaneCell& c : few) c.normal = {1, 0, 0};
  CHECK_THROWS_AS(fit_scan(few, feet, o, report), EmptyError);
}

}  // namespace scan_fit_test
