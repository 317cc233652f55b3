// Which vertices regions take.
#include "kernels/edit/edit_regions.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/error.h"
#include "tests/helpers/surfaces.h"

namespace edit_regions_test {

namespace {

using namespace tessera;
using namespace tessera::test;

EditRegion region(RegionRole role, RegionShape shape, const char* name = "") {
  EditRegion r;
  r.role = role;
  r.shape = shape;
  r.name = name;
  return r;
}

}  // namespace

TEST_CASE("edit regions: later ones take from earlier ones, the rest is fixed", "[unit]") {
  const Surface s = height_grid(20, 20.0, [](double, double) { return 0.0; });
  EditRegion support = region(RegionRole::kSupport, RegionShape::kBox);
  support.low = {2, 2, -1}, support.high = {18, 18, 1};
  EditRegion knob = region(RegionRole::kHandle, RegionShape::kSphere, "knob");
  knob.point = {10, 10, 0}, knob.radius = 3.0, knob.smoothness = 0.0;
  EditRegion side = region(RegionRole::kHandle, RegionShape::kHalfSpace, "side");
  side.point = {1, 0, 0}, side.normal = {2, 0, 0}, side.smoothness = 5.0;
  EditRegion dot = region(RegionRole::kHandle, RegionShape::kPoints, "knob");
  dot.points = {{5.2, 5.1, 0.3}};
  const EditRegions out =
      resolve_regions(std::vector<EditRegion>{support, knob, side, dot}, EditSurface{s.position, s.faces}, 3);
  CHECK(out.handles == std::vector<std::string>{"knob", "side"});
  for (std::size_t v = 0; v < s.position.size(); ++v) {
    const Double3& p = s.position[v];
    const std::int32_t want = p == Double3{5, 5, 0} || norm(p - Double3{10, 10, 0}) <= 3.0 ? 0
                              : p[0] <= 1.0                                                ? 1
                              : p[0] >= 2 && p[1] >= 2 && p[0] <= 18 && p[1] <= 18         ? kSupportVertex
                                                                                           : kFixedVertex;
    CHECK(out.role[v] == want);
    if (want == 0) CHECK(out.smoothness[v] == (p == Double3{5, 5, 0} ? 2.0 : 0.0));
    if (want == 1) CHECK(out.smoothness[v] == 2.0);
  }
  EditRegion far = region(RegionRole::kHandle, RegionShape::kSphere, "far");
  far.point = {100, 0, 0}, far.radius = 1.0;
  CHECK_THROWS_WITH(
      resolve_regions(std::vector<EditRegion>{support, far}, EditSurface{s.position, s.faces}, 2),
      Catch::Contains("region 2 ('far') takes no vertex"));
}

TEST_CASE("edit regions: distance along the surface", "[unit]") {
  const Surface s = height_grid(60, 6.0, [](double, double) { return 0.0; });
  const std::vector<double> d = surface_distance(s.position, s.faces, std::vector<Double3>{{3, 3, 0}});
  double worst = 0.0;
  for (std::size_t v = 0; v < d.size(); ++v) {
    const double true_distance = norm(s.position[v] - Double3{3, 3, 0});
    CHECK(d[v] >= true_distance - 1e-9);
    if (true_distance > 1.0) worst = std::max(worst, d[v] / true_distance - 1.0);
  }
  CHECK(worst < 0.09);
  // Around a sphere it is the arc, not the chord.
  const Surface ball = sphere(5, 1.0);
  const std::vector<double> arc =
      surface_distance(ball.position, ball.faces, std::vector<Double3>{{0, 0, 1}});
  for (std::size_t v = 0; v < arc.size(); ++v)
    if (ball.position[v] == Double3{0, 0, -1}) CHECK(arc[v] == Approx(3.14159).epsilon(0.02));
}

TEST_CASE("edit regions: a patch ends at creases, or where they are made to matter", "[unit]") {
  // A roof: two slopes that meet at x = 10, and a gentle bend at x = 5.
  const Surface s = height_grid(20, 20.0, [](double x, double) {
    return x <= 5 ? 0.2 * x : x <= 10 ? 1 + 0.5 * (x - 5) : 3.5 - 1.5 * (x - 10);
  });
  EditRegion side = region(RegionRole::kSupport, RegionShape::kPatch);
  side.points = {{7.5, 4.2, 9.0}};
  side.crease_deg = 30.0;
  EditRegions out = resolve_regions(std::vector<EditRegion>{side}, EditSurface{s.position, s.faces}, 2);
  for (std::size_t v = 0; v < s.position.size(); ++v)
    CHECK((out.role[v] == kSupportVertex) == (s.position[v][0] <= 10.0));
  side.crease_deg = 5.0;
  out = resolve_regions(std::vector<EditRegion>{side}, EditSurface{s.position, s.faces}, 2);
  for (std::size_t v = 0; v < s.position.size(); ++v)
    CHECK((out.role[v] == kSupportVertex) == (s.position[v][0] <= 10.0 && s.position[v][0] >= 5.0));
  // Creases are asked of the surface before it was smoothed.
  const Surface flat = height_grid(20, 20.0, [](double, double) { return 0.0; });
  out = resolve_regions(std::vector<EditRegion>{side}, {flat.position, s.faces, s.position}, 2);
  for (std::size_t v = 0; v < s.position.size(); ++v)
    CHECK((out.role[v] == kSupportVertex) == (s.position[v][0] <= 10.0 && s.position[v][0] >= 5.0));
}

TEST_CASE("edit regions: what is painted", "[unit]") {
  const Surface s = height_grid(10, 10.0, [](double, double) { return 0.0; });
  std::vector<std::uint32_t> colour;
  for (const Double3& p : s.position) colour.push_back(p[0] < 4 ? 0xff2010f0u : p[0] < 6 ? 0x102040a0u : 0u);
  EditRegion red = region(RegionRole::kHandle, RegionShape::kPainted, "red");
  red.colour = {255, 0, 0};
  red.within = 40;
  EditRegions out = resolve_regions(std::vector<EditRegion>{red}, {s.position, s.faces, {}, colour}, 2);
  for (std::size_t v = 0; v < s.position.size(); ++v)
    CHECK(out.role[v] == (s.position[v][0] < 4 ? 0 : kFixedVertex));
  red.within = 95;
  out = resolve_regions(std::vector<EditRegion>{red}, {s.position, s.faces, {}, colour}, 2);
  for (std::size_t v = 0; v < s.position.size(); ++v)
    CHECK(out.role[v] == (s.position[v][0] < 6 ? 0 : kFixedVertex));
  red.colour = {0, 255, 0};
  red.within = 0;
  CHECK_THROWS_WITH(resolve_regions(std::vector<EditRegion>{red}, {s.position, s.faces, {}, colour}, 2),
                    Catch::Contains("region 1 ('red') takes no vertex"));
  CHECK_THROWS_WITH(resolve_regions(std::vector<EditRegion>{red}, EditSurface{s.position, s.faces}, 2),
                    Catch::Contains("the mesh has no vertex colours"));
}

}  // namespace edit_regions_test
