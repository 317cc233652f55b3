#include "kernels/scene/mesh_scene.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/error.h"
#include "octree/vector.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/random.h"

namespace mesh_scene_test {

using namespace tessera;
using namespace tessera::synth;
using test::Random;

namespace {

std::unique_ptr<Scene> ball_scene(int level, const Double3& centre) {
  const test::Icosphere ball = test::icosphere(level);
  std::vector<Double3> vertices;
  for (const auto& p : ball.positions) vertices.push_back(Double3{p[0], p[1], p[2]} + centre);
  return make_mesh_scene("ball.ply", vertices, ball.faces);
}
std::unique_ptr<Scene> cube_mesh() {
  std::vector<Double3> v;
  for (int c = 0; c < 8; ++c) v.push_back({c & 1 ? 1.0 : -1.0, c & 2 ? 1.0 : -1.0, c & 4 ? 1.0 : -1.0});
  return make_mesh_scene("cube.ply", v,
                         {{0, 2, 1},
                          {1, 2, 3},
                          {4, 5, 6},
                          {5, 7, 6},
                          {0, 1, 4},
                          {1, 5, 4},
                          {2, 6, 3},
                          {3, 6, 7},
                          {0, 4, 2},
                          {2, 4, 6},
                          {1, 3, 5},
                          {3, 7, 5}});
}
Double3 somewhere(Random& random, double extent) {
  return {random.in(-extent, extent), random.in(-extent, extent), random.in(-extent, extent)};
}

}  // namespace

TEST_CASE("mesh scene: a cube of triangles is the cube", "[property]") {
  const auto mesh = cube_mesh();
  const auto truth = make_scene({"cube", 0, 0});
  Random random(2);
  std::size_t hits = 0;
  for (int i = 0; i < 4000; ++i) {
    const Double3 p = somewhere(random, 3);
    CHECK(norm(mesh->closest(p).position - p) == Approx(norm(truth->closest(p).position - p)).margin(1e-12));
    const Ray ray = {somewhere(random, 4), unit(somewhere(random, 1))};
    RayHit mine, exact;
    const bool found = mesh->intersect(ray, 5.0, mine);
    REQUIRE(found == truth->intersect(ray, 5.0, exact));
    if (!found) continue;
    ++hits;
    CHECK(mine.range == Approx(exact.range).margin(1e-12));
    // From inside, too, a sensor sees the side that it looks at.
    CHECK(dot(mine.point.normal, ray.direction) < 0.0);
    CHECK(std::fabs(dot(mine.point.normal, exact.point.normal)) == Approx(1.0));
  }
  CHECK(hits > 200);
  CHECK(mesh->bounds().lo == Double3{-1, -1, -1});
  CHECK(mesh->bounds().hi == Double3{1, 1, 1});
}

TEST_CASE("mesh scene: no ray slips through an edge or a vertex, and crossings come in pairs", "[property]") {
  const Double3 centre = {3, -2, 5};
  const auto scene = ball_scene(3, centre);
  const test::Icosphere ball = test::icosphere(3);
  const auto corner = [&](std::uint32_t v) {
    return Double3{ball.positions[v][0], ball.positions[v][1], ball.positions[v][2]};
  };
  RayHit hit;
  for (const auto& f : ball.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 a = corner(f[k]), b = corner(f[(k + 1) % 3]);
      for (const double t : {0.0, 0.3, 0.5}) {
        const Double3 direction = unit(a + (b - a) * t);
        CHECK(scene->intersect({centre, direction}, 2.0, hit));
        CHECK(scene->intersect({centre + direction * 3.0, -direction}, 2.2, hit));
      }
    }
  CHECK_FALSE(scene->intersect({centre, {0, 0, 1}}, 0.5, hit));
  CHECK_FALSE(scene->intersect({centre + Double3{0, 0, 2}, {0, 0, 1}}, 9.0, hit));
  Random random(6);
  std::vector<SurfacePoint> found;
  for (int i = 0; i < 3000; ++i) {
    // Along axes through vertices as well.
    const Double3 through =
        i % 3 == 0 ? centre + corner(static_cast<std::uint32_t>(random.below(ball.positions.size())))
                   : centre + somewhere(random, 1.2);
    scene->crossings({{through[0], through[1], -20}, {0, 0, 1}}, 100.0, found);
    if (i % 3 == 0) continue;  // it may touch the outline once
    CHECK(found.size() % 2 == 0);
    for (std::size_t k = 0; k < found.size(); ++k) CHECK((found[k].normal[2] < 0.0) == (k % 2 == 0));
  }
}

TEST_CASE("mesh scene: what cannot be scanned is refused", "[unit]") {
  const std::vector<Double3> v = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  CHECK_THROWS_AS(make_mesh_scene("a.ply", v, {}), InputError);
  CHECK_THROWS_AS(make_mesh_scene("a.ply", v, {{0, 1, 1}}), InputError);
  CHECK_THROWS_AS(make_mesh_scene("a.ply", v, {{0, 1, 3}}), InputError);
  CHECK_THROWS_AS(make_mesh_scene("a.ply", {{0, 0, 0}, {1, 0, 0}, {0, std::nan(""), 0}}, {{0, 1, 2}}),
                  InputError);
  CHECK(make_mesh_scene("a.ply", v, {{0, 1, 2}, {0, 0, 1}})->bounds().hi == Double3{1, 1, 0});
}

}  // namespace mesh_scene_test
