#include "kernels/certify/tolerance_volume.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "kernels/certify/tolerance_filter.h"
#include "octree/rounding.h"
#include "octree/vector.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/surfaces.h"

namespace {

using namespace tessera;
using test::Surface;

constexpr TexturePrecision kPrecisions[] = {TexturePrecision::k8Bit, TexturePrecision::kHalf,
                                            TexturePrecision::kFloat};

struct Bed {
  Surface surface = test::sphere(4, 1.0);
  ClosestFaces reference{surface.position, surface.faces, {0, 0, 0}};
  ToleranceVolume volume{
      {{-1.1, -1.1, -1.1}, {1.1, 1.1, 1.1}}, reference, {.tolerance = 0.1, .spacing = 0.07}};

  double truth(const Double3& p) const {
    return std::sqrt(reference.closest(p, 1e30, ClosestFaces::kNone).square);
  }
  /// Near the sphere, inside the grid.
  static Double3 place(test::Random& random) {
    Double3 p;
    double size = 0.0;
    do {
      size = 0.0;
      for (double& c : p) {
        c = random.in(-1, 1);
        size += c * c;
      }
    } while (size > 1.0 || size < 0.01);
    const double r = random.in(0.8, 1.08) / std::sqrt(size);
    return p * r;
  }
  static std::vector<Double3> triangles(std::size_t count, double edge, test::Random& random) {
    std::vector<Double3> corners;
    for (std::size_t i = 0; i < count; ++i) {
      const Double3 at = place(random);
      for (int c = 0; c < 3; ++c) {
        Double3 p = at;
        for (double& x : p) x = std::min(1.1, std::max(-1.1, x + random.in(-edge, edge)));
        corners.push_back(p);
      }
    }
    return corners;
  }
  GridTriangles grid(const std::vector<Double3>& corners) const {
    GridTriangles out;
    for (std::size_t i = 0; i < corners.size(); i += 3)
      out.add(volume.to_grid(corners[i]), volume.to_grid(corners[i + 1]), volume.to_grid(corners[i + 2]));
    return out;
  }
  /// The same samples, in double.
  double largest(const Double3* c, int n) const {
    double most = 0.0;
    for (int j = 0; j < n; ++j)
      for (int i = 0; i + j < n; ++i) {
        const double s = (i + static_cast<double>(kSampleOffset)) / n,
                     t = (j + static_cast<double>(kSampleOffset)) / n;
        Double3 p;
        for (std::size_t k = 0; k < 3; ++k)
          p[k] = c[0][k] + s * (c[1][k] - c[0][k]) + t * (c[2][k] - c[0][k]);
        most = std::max(most, volume.interpolate(p));
      }
    return most;
  }
};

}  // namespace

TEST_CASE("tolerance volume: interpolation never says less than the distance", "[property]") {
  const Bed bed;
  test::Random random(2);
  double loose = 0.0;
  int near = 0;
  for (int i = 0; i < 20000; ++i) {
    const Double3 p = Bed::place(random);
    const double truth = bed.truth(p), said = bed.volume.interpolate(p);
    if (truth > 0.1) {
      CHECK(said > 0.1);
      continue;
    }
    CHECK(said >= truth * (1.0 - 1e-6));
    loose += said - truth;
    ++near;
  }
  REQUIRE(near > 1000);
  CHECK(loose / near < 0.7 * 0.07);  // below the worst case of sqrt(3)/2 h
  CHECK(bed.volume.mean_lift() <= bed.volume.largest_lift());
  CHECK(bed.volume.largest_lift() <= 0.8661 * 0.07);
}

TEST_CASE("tolerance volume: halfs round up, and back", "[unit]") {
  test::Random random(4);
  for (int i = 0; i < 10000; ++i) {
    const auto v = static_cast<float>(random.in(0, 30) * std::pow(2.0, random.in(-20, 0)));
    const float h = half_value(half_rounded_up(v));
    CHECK(h >= v);
    CHECK(static_cast<double>(h) <= static_cast<double>(v) * (1.0 + 0x1p-10) + 0x1p-24);
  }
  CHECK(half_rounded_up(0.0f) == 0);
  CHECK(half_value(half_rounded_up(1.0f)) == 1.0f);
}

TEST_CASE("tolerance raster: backends agree within the error term", "[property]") {
  const Bed bed;
  test::Random random(6);
  const std::vector<Double3> corners = Bed::triangles(3001, 0.1, random);
  const GridTriangles triangles = bed.grid(corners);
  const auto context = create_gl_context();
  for (const TexturePrecision precision : kPrecisions) {
    std::vector<std::unique_ptr<ToleranceRaster>> rasters;
    rasters.push_back(make_cpu_raster(bed.volume, precision));
    rasters.push_back(make_gl_raster(bed.volume, precision, *context, GlRaster::kAtlas));
    rasters.push_back(make_gl_raster(bed.volume, precision, *context, GlRaster::kFragment));
    for (const auto& raster : rasters)
      for (const int n : {1, 4, 7}) {
        std::vector<float> out(triangles.size());
        raster->largest(triangles, n, out);
        const double filter = bed.volume.filter_error(precision, raster->hardware_filter());
        double low = 0.0, high = 0.0;
        for (std::size_t i = 0; i < out.size(); ++i) {
          const double truth = bed.largest(&corners[3 * i], n);
          const double off = static_cast<double>(out[i]) * bed.volume.spacing() - truth;
          low = std::min(low, off);
          high = std::max(high, off);
        }
        INFO(raster->description() << ", precision " << static_cast<int>(precision) << ", " << n
                                   << " a side");
        CHECK(low >= -filter);
        CHECK(high <= filter + bed.volume.texture_error(precision));
      }
  }
}

TEST_CASE("tolerance raster: occlusion queries give the same verdicts as maxima", "[property]") {
  const Bed bed;
  test::Random random(7);
  const std::vector<Double3> corners = Bed::triangles(500, 0.1, random);
  const GridTriangles triangles = bed.grid(corners);
  const auto context = create_gl_context();
  const auto raster = make_gl_raster(bed.volume, TexturePrecision::kFloat, *context, GlRaster::kAtlas);
  QueryRaster query(bed.volume, TexturePrecision::kFloat, *context);
  std::vector<float> value(triangles.size());
  std::vector<std::uint8_t> over(triangles.size());
  const auto threshold = static_cast<float>(bed.volume.tolerance() / bed.volume.spacing());
  raster->largest(triangles, 4, value);
  query.exceeds(triangles, 4, threshold, over);
  std::size_t yes = 0;
  for (std::size_t i = 0; i < over.size(); ++i) {
    if (std::abs(value[i] - threshold) > 1e-5f) CHECK((over[i] != 0) == (value[i] > threshold));
    yes += over[i];
  }
  CHECK(yes > 50);
  CHECK(yes < 450);
}

TEST_CASE("tolerance raster: EGL, where there is one, says the same", "[property]") {
  const auto context = find_egl_context(true);
  if (!context) {
    test::skip("no GPU answers through EGL");
    return;
  }
  const Bed bed;
  test::Random random(8);
  const std::vector<Double3> corners = Bed::triangles(1000, 0.1, random);
  const GridTriangles triangles = bed.grid(corners);
  const auto cpu = make_cpu_raster(bed.volume, TexturePrecision::kFloat);
  const auto egl = make_gl_raster(bed.volume, TexturePrecision::kFloat, *context, GlRaster::kFragment);
  std::vector<float> a(triangles.size()), b(triangles.size());
  cpu->largest(triangles, 4, a);
  egl->largest(triangles, 4, b);
  const double most = bed.volume.filter_error(TexturePrecision::kFloat, true) / bed.volume.spacing();
  for (std::size_t i = 0; i < a.size(); ++i) CHECK(std::abs(static_cast<double>(a[i] - b[i])) <= most);
}

TEST_CASE("tolerance filter: what it settles, the certificate confirms", "[property]") {
  const Bed bed;
  test::Random random(9);
  std::vector<Double3> corners = Bed::triangles(2000, 0.05, random);
  for (const TexturePrecision precision : kPrecisions) {
    const auto raster = make_cpu_raster(bed.volume, precision);
    std::vector<ToleranceVerdict> verdict;
    const ToleranceFilterReport report =
        filter_by_volume(bed.volume, precision, *raster, corners, {}, verdict);
    CHECK(report.inside + report.outside + report.doubt == verdict.size());
    CHECK(report.inside > 200);
    CHECK(report.outside > 20);
    for (std::size_t i = 0; i < verdict.size(); ++i) {
      const std::array<std::array<std::uint32_t, 3>, 1> face = {{{0, 1, 2}}};
      const DeviationReport exact =
          certify_deviation({std::span(corners).subspan(3 * i, 3), face}, nullptr, bed.reference,
                            {.tolerance = 0.1, .reach = 1.0, .area_unit = 1.0});
      if (verdict[i] == ToleranceVerdict::kInside) CHECK(exact.lower <= 0.1);
      if (verdict[i] == ToleranceVerdict::kOutside) CHECK(exact.upper > 0.1);
    }
  }
}

TEST_CASE("permission grid: what it permits is within the tolerance", "[property]") {
  const Bed bed;
  const PermissionGrid grid({{-1.1, -1.1, -1.1}, {1.1, 1.1, 1.1}}, bed.reference, 0.1, 0.03);
  test::Random random(10);
  const std::vector<Double3> corners = Bed::triangles(2000, 0.05, random);
  std::size_t permitted = 0;
  for (std::size_t i = 0; i < corners.size(); i += 3) {
    if (!grid.permits(corners[i], corners[i + 1], corners[i + 2])) continue;
    ++permitted;
    for (int n = 0; n < 3; ++n) CHECK(bed.truth(corners[i + static_cast<std::size_t>(n)]) <= 0.1);
  }
  CHECK(permitted > 100);
}
