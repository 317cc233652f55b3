#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/scene/fractal_noise.h"
#include "kernels/scene/sample_source.h"
#include "kernels/scene/scene.h"
#include "kernels/scene/scene_smooth.h"
#include "kernels/scene/surface_sampler.h"
#include "octree/error.h"

namespace scene_test {

using namespace tessera;
using namespace tessera::synth;

namespace {

const std::vector<std::string> kParametric = {"sphere", "torus", "cube", "csg", "fandisk", "terrain"};

struct Samples {
  std::vector<Double3> points, normals;
};

Samples sample_all(const SurfaceSampler& sampler) {
  Samples all;
  SurfaceBatch batch;
  for (const auto& span : sampler.spans()) {
    sampler.sample(span, batch);
    REQUIRE(batch.size() == span.points);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      all.points.push_back({batch.x[i], batch.y[i], batch.z[i]});
      all.normals.push_back({batch.nx[i], batch.ny[i], batch.nz[i]});
    }
  }
  return all;
}

Double3 random_in(const synth::Box3& box, std::uint64_t i) {
  const auto u = [&](std::uint64_t stream) { return to_unit(random_bits(7, stream, i)); };
  const Double3 d = box.hi - box.lo;
  return {box.lo[0] + d[0] * u(1), box.lo[1] + d[1] * u(2), box.lo[2] + d[2] * u(3)};
}

}  // namespace

TEST_CASE("portable math agrees with the library to rounding", "[unit]") {
  for (int i = -4000; i <= 4000; ++i) {
    const double a = i * 0.0173;
    const SinCos t = sin_cos(a);
    CHECK(std::fabs(t.sin - std::sin(a)) < 2e-14);
    CHECK(std::fabs(t.cos - std::cos(a)) < 2e-14);
    const double v = 1e-12 + (i + 4000.0) * 0.37;
    CHECK(std::fabs(natural_log(v) - std::log(v)) < 1e-14 * std::max(1.0, std::fabs(std::log(v))));
  }
  CHECK(natural_log(1.0) == 0.0);
}

TEST_CASE("gaussian variates have mean 0, deviation 1 and normal tails", "[unit]") {
  constexpr int n = 200000;
  double sum = 0, squares = 0;
  int beyond_two = 0;
  for (int i = 0; i < n; ++i) {
    const std::uint64_t bits = random_bits(3, 5, static_cast<std::uint64_t>(i));
    const double g = gaussian(bits, mix(bits));
    sum += g;
    squares += g * g;
    beyond_two += std::fabs(g) > 2.0;
  }
  CHECK(std::fabs(sum / n) < 0.01);
  CHECK(std::fabs(squares / n - 1.0) < 0.01);
  CHECK(std::fabs(beyond_two / double(n) - 0.0455) < 0.002);
}

TEST_CASE("fractal noise: slopes are the derivatives of the height and stay within bounds", "[unit]") {
  FractalOptions o;
  const double e = 1e-5;
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Double3 p = random_in({{-900, -900, -900}, {900, 900, 900}}, i);
    const double x[5] = {p[0], p[0] + e, p[0] - e, p[0], p[0]}, y[5] = {p[1], p[1], p[1], p[1] + e, p[1] - e};
    double h[5], sx[5], sy[5];
    fractal_heights(o, x, y, h, sx, sy);
    CHECK(sx[0] == Approx((h[1] - h[2]) / (2 * e)).margin(1e-6));
    CHECK(sy[0] == Approx((h[3] - h[4]) / (2 * e)).margin(1e-6));
    CHECK(std::fabs(h[0]) <= fractal_height_bound(o));
    CHECK(std::sqrt(sx[0] * sx[0] + sy[0] * sy[0]) <= fractal_slope_bound(o));
    Double3 g{}, unused{};
    fractal_volume(o, p, g);
    const double dz =
        fractal_volume(o, p + Double3{0, 0, e}, unused) - fractal_volume(o, p - Double3{0, 0, e}, unused);
    const double dx =
        fractal_volume(o, p + Double3{e, 0, 0}, unused) - fractal_volume(o, p - Double3{e, 0, 0}, unused);
    CHECK(g[2] == Approx(dz / (2 * e)).margin(1e-6));
    CHECK(g[0] == Approx(dx / (2 * e)).margin(1e-6));
    CHECK(norm(g) <= fractal_volume_slope_bound(o));
  }
}

TEST_CASE("fractal noise: a point alone has the bits it has in a batch", "[property]") {
  FractalOptions o;
  std::vector<double> x, y;
  for (std::uint64_t i = 0; i < 1003; ++i) {
    const Double3 p = random_in({{0, 0, 0}, {1000, 1000, 1}}, i);
    x.push_back(p[0]);
    y.push_back(p[1]);
  }
  std::vector<double> h(x.size()), sx(x.size()), sy(x.size());
  fractal_heights(o, x, y, h, sx, sy);
  for (std::size_t i = 0; i < x.size(); ++i) {
    double one, ox, oy;
    fractal_heights(o, {&x[i], 1}, {&y[i], 1}, {&one, 1}, {&ox, 1}, {&oy, 1});
    REQUIRE(one == h[i]);
    REQUIRE(ox == sx[i]);
    REQUIRE(oy == sy[i]);
  }
}

TEST_CASE("samples lie on the truth with the truth's normals, in the number asked for", "[unit]") {
  for (const auto& name : kParametric) {
    for (const std::uint64_t n : {std::uint64_t{1}, std::uint64_t{777}, std::uint64_t{20000}}) {
      CAPTURE(name, n);
      const auto scene = make_scene({name, 4, 0});
      const SurfaceSampler sampler(*scene, n, 3);
      const Samples all = sample_all(sampler);
      REQUIRE(all.points.size() == n);
      const double size = norm(scene->bounds().hi - scene->bounds().lo);
      int tilted = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const SurfacePoint truth = scene->closest(all.points[i]);
        REQUIRE(norm(truth.position - all.points[i]) < 1e-12 * size);
        REQUIRE(std::fabs(norm(all.normals[i]) - 1.0) < 1e-12);
        tilted += dot(truth.normal, all.normals[i]) < 1.0 - 1e-9;
      }
      CHECK(tilted == 0);
    }
  }
}

TEST_CASE("direct sampling has the true area and an even density", "[unit]") {
  const std::vector<std::pair<std::string, double>> areas = {
      {"sphere", 4 * kPi}, {"torus", 4 * kPi * kPi * 0.4}, {"cube", 24.0}};
  for (const auto& [name, area] : areas) {
    CAPTURE(name);
    const auto scene = make_scene({name, 0, 0});
    CHECK(SurfaceSampler(*scene, 100000, 1).area() == Approx(area).epsilon(2e-3));
  }
  // Octants of the sphere share the points evenly; neighbours keep their distance.
  const auto sphere = make_scene({"sphere", 0, 0});
  const SurfaceSampler sampler(*sphere, 16000, 1);
  const Samples all = sample_all(sampler);
  int octant[8] = {};
  for (const auto& p : all.points) ++octant[(p[0] > 0) | (p[1] > 0) << 1 | (p[2] > 0) << 2];
  for (const int count : octant) CHECK(std::abs(count - 2000) < 60);
  int lonely = 0;
  for (std::size_t i = 0; i < 400; ++i) {
    double nearest = 1e9;
    for (std::size_t j = 0; j < all.points.size(); ++j) {
      if (i != j) nearest = std::min(nearest, norm(all.points[i] - all.points[j]));
    }
    lonely += nearest > 1.5 * sampler.spacing();
  }
  CHECK(lonely == 0);
}

TEST_CASE("normals point outwards: the divergence theorem gives the volume", "[unit]") {
  const double rod = kPi * 0.55 * 0.55 * 1.0, bore = kPi * 0.35 * 0.35 * 2.4;
  const std::vector<std::pair<std::string, double>> volumes = {
      {"sphere", 4 * kPi / 3}, {"torus", 2 * kPi * kPi * 0.16}, {"cube", 8.0}, {"csg", 7.68 + rod - bore}};
  for (const auto& [name, volume] : volumes) {
    CAPTURE(name);
    const auto scene = make_scene({name, 0, 0});
    const SurfaceSampler sampler(*scene, 200000, 1);
    const Samples all = sample_all(sampler);
    double sum = 0;
    for (std::size_t i = 0; i < all.points.size(); ++i) sum += dot(all.points[i], all.normals[i]);
    CHECK(sum * sampler.area() / (3.0 * 200000) == Approx(volume).epsilon(3e-3));
  }
}

TEST_CASE("closest point: nothing sampled is nearer, and it lies on the surface", "[property]") {
  for (const auto& name : kParametric) {
    CAPTURE(name);
    const auto scene = make_scene({name, 3, 0});
    const SurfaceSampler sampler(*scene, 40000, 5);
    const Samples all = sample_all(sampler);
    const bool terrain = name == "terrain";
    for (std::uint64_t i = 0; i < 150; ++i) {
      Double3 p = random_in(scene->bounds(), i);
      // The terrain's foot point is exact near the surface only.
      if (terrain) p = all.points[i * 200] + all.normals[i * 200] * (sampler.spacing() * 2.0);
      const SurfacePoint foot = scene->closest(p);
      const double d = norm(p - foot.position);
      double brute = std::numeric_limits<double>::max();
      for (const auto& q : all.points) brute = std::min(brute, norm(p - q));
      CHECK(d <= brute + 1e-9);
      CHECK(d >= brute - 2.0 * sampler.spacing());
      CHECK(norm(scene->closest(foot.position).position - foot.position) < 1e-9);
      // The line to the foot is at right angles to the surface there, unless a border or a crease stops it.
      if (d > 1e-6 && !terrain)
        CHECK(std::fabs(dot((p - foot.position) * (1.0 / d), foot.normal)) > 1.0 - 1e-9);
    }
  }
}

TEST_CASE("rays hit the surface where nothing is before it", "[property]") {
  for (const auto& name : kParametric) {
    CAPTURE(name);
    const auto scene = make_scene({name, 3, 0});
    const synth::Box3 box = scene->bounds();
    const double size = norm(box.hi - box.lo);
    const Samples targets = sample_all(SurfaceSampler(*scene, 300, 9));
    int hits = 0;
    for (std::size_t i = 0; i < targets.points.size(); ++i) {
      // From far outside towards a point of the surface: something must be hit, not behind that point.
      const Double3 from = targets.points[i] + unit(targets.normals[i] + Double3{0.1, 0.2, 0.3}) * size;
      const Double3 delta = targets.points[i] - from;
      const Ray ray{from, tessera::unit(delta)};
      RayHit hit;
      const bool found = scene->intersect(ray, 2.0 * size, hit);
      if (!found) continue;  // grazes a border or a crease
      ++hits;
      CHECK(hit.range <= norm(delta) + 1e-6 * size);
      CHECK(norm(scene->closest(hit.point.position).position - hit.point.position) < 1e-9 * size);
      CHECK(norm(ray.origin + ray.direction * hit.range - hit.point.position) < 1e-8 * size);
    }
    CHECK(hits >= 295);
    RayHit none;
    CHECK_FALSE(scene->intersect({box.hi + Double3{1, 1, size}, {0, 0, 1}}, 10.0 * size, none));
  }
}

TEST_CASE("creases and corners of the solids are where the faces meet", "[unit]") {
  SharpFeature f;
  const auto cube = make_scene({"cube", 0, 0});
  REQUIRE(cube->nearest_crease({1.1, 1.1, 0.3}, f));
  CHECK(f.distance == Approx(std::sqrt(0.02)));
  CHECK(norm(f.position - Double3{1, 1, 0.3}) < 1e-12);
  REQUIRE(cube->nearest_corner({0.9, 0.9, 0.9}, f));
  CHECK(f.distance == Approx(std::sqrt(0.03)));
  const auto csg = make_scene({"csg", 0, 0});
  REQUIRE(csg->nearest_crease({0.6, 0.0, 1.3}, f));
  CHECK(f.distance == Approx(0.05));
  REQUIRE(csg->nearest_crease({1.2, 0.0, 0.4}, f));
  CHECK(f.distance == Approx(0.05));
  // Every crease of the fandisk lies on its surface, also the elliptic ones.
  const auto disk = make_scene({"fandisk", 0, 0});
  for (std::uint64_t i = 0; i < 300; ++i) {
    const Double3 p = random_in(disk->bounds(), i);
    REQUIRE(disk->nearest_crease(p, f));
    CHECK(norm(disk->closest(f.position).position - f.position) < 1e-9);
    SharpFeature again;
    disk->nearest_crease(f.position, again);
    CHECK(again.distance < 1e-9);
  }
  CHECK_FALSE(make_scene({"sphere", 0, 0})->nearest_crease({0, 0, 0}, f));
}

TEST_CASE("an unknown scene is refused with the names that exist", "[unit]") {
  CHECK_THROWS_AS(make_scene({"teapot", 0, 0}), UsageError);
  for (const auto& scene : scene_names()) {
    CHECK(make_scene({std::string(scene.name), 3, 1.0})->name() == scene.name);
  }
}

TEST_CASE("implicit scenes: direct samples lie on the field's zero, normals are its gradient", "[unit]") {
  for (const std::string name : {"parts", "statue", "indoor", "city"}) {
    CAPTURE(name);
    const auto scene = make_scene({name, 0, 0});
    const double size = norm(scene->bounds().hi - scene->bounds().lo);
    const auto source = sample_surface(*scene, 4000, 1);
    SampleBatch batch;
    std::size_t count = 0, tilted = 0;
    for (std::uint64_t unit = 0; unit < source->unit_count(); ++unit) {
      source->sample(unit, batch);
      for (std::size_t i = 0; i < batch.surface.size(); ++i) {
        const auto& s = batch.surface;
        const Double3 p{s.x[i], s.y[i], s.z[i]}, n{s.nx[i], s.ny[i], s.nz[i]};
        const SurfacePoint truth = scene->closest(p);
        REQUIRE(norm(truth.position - p) < 1e-9 * size);
        tilted += dot(truth.normal, n) < 0.999999;
        // From a little outside, the way back is the same.
        const Double3 away = p + n * (1e-4 * size);
        const double back = norm(scene->closest(away).position - away);
        REQUIRE(back < 1.0001e-4 * size);
        ++count;
      }
    }
    CHECK(std::fabs(static_cast<double>(count) / 4000.0 - 1.0) < 0.1);
    CHECK(tilted <= count / 1000);
  }
}

TEST_CASE("sensors: noise-free returns lie on the surface, in sight, near the number asked for",
          "[property]") {
  const std::vector<std::pair<std::string, SensorKind>> cases = {{"indoor", SensorKind::kTerrestrial},
                                                                 {"csg", SensorKind::kTerrestrial},
                                                                 {"city", SensorKind::kAirborne},
                                                                 {"terrain", SensorKind::kAirborne},
                                                                 {"parts", SensorKind::kStructuredLight}};
  for (const auto& [name, kind] : cases) {
    CAPTURE(name);
    const auto scene = make_scene({name, 3, 0});
    const double size = norm(scene->bounds().hi - scene->bounds().lo);
    SensorOptions options;
    options.kind = kind;
    options.points = 5000;
    options.flying = 0.0;
    const auto source = sample_by_sensor(*scene, options);
    SampleBatch batch;
    std::size_t count = 0;
    for (const ScanInfo& scan : source->scans()) {
      for (std::uint64_t unit = scan.first_unit; unit < scan.first_unit + scan.units; ++unit) {
        source->sample(unit, batch);
        CHECK(batch.flying == 0);
        for (std::size_t i = 0; i < batch.surface.size(); ++i) {
          const auto& s = batch.surface;
          const Double3 p{s.x[i], s.y[i], s.z[i]}, n{s.nx[i], s.ny[i], s.nz[i]};
          REQUIRE(norm(scene->closest(p).position - p) < 1e-8 * size);
          REQUIRE(dot(n, {batch.dx[i], batch.dy[i], batch.dz[i]}) < 0.0);
          if (kind != SensorKind::kAirborne && i % 16 == 0) {
            RayHit before;
            const Double3 delta = p - scan.origin;
            CHECK_FALSE(
                scene->intersect({scan.origin, tessera::unit(delta)}, norm(delta) - 1e-3 * size, before));
          }
          ++count;
        }
      }
    }
    CHECK(std::fabs(static_cast<double>(count) / 5000.0 - 1.0) < 0.15);
    CHECK(source->spacing() > 0.0);
  }
}

TEST_CASE("sensors: flying points lie on a ray between two surfaces, gaps keep the grid", "[unit]") {
  const auto scene = make_scene({"indoor", 0, 0});
  SensorOptions options;
  options.points = 20000;
  options.flying = 1.0;
  options.gaps = true;
  const auto source = sample_by_sensor(*scene, options);
  SampleBatch batch;
  std::uint64_t flying = 0, off = 0;
  for (const ScanInfo& scan : source->scans()) {
    std::uint64_t in_scan = 0;
    for (std::uint64_t unit = scan.first_unit; unit < scan.first_unit + scan.units; ++unit) {
      source->sample(unit, batch);
      in_scan += batch.surface.size();
      flying += batch.flying;
      for (std::size_t i = 0; i < batch.surface.size(); ++i) {
        const Double3 p{batch.surface.x[i], batch.surface.y[i], batch.surface.z[i]};
        if (!std::isnan(p[0])) off += norm(scene->closest(p).position - p) > 1e-6;
      }
    }
    CHECK(in_scan == scan.columns * scan.rows);
  }
  CHECK(flying > 50);
  CHECK(off > flying / 2);
  CHECK(off <= flying);
}

}  // namespace scene_test
