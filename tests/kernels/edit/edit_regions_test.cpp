// Which vertices regions take.
#include "kernels/edit/edit_regions.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/error.h"
#include "tests/helpers/surfaces.h"

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
  knob.point = {10, 10, 0}, knob.reach = 3.0, knob.smoothness = 0.0;
  EditRegion side = region(RegionRole::kHandle, RegionShape::kHalfSpace, "side");
  side.point = {1, 0, 0}, side.normal = {2, 0, 0}, side.smoothness = 5.0;
  EditRegion dot = region(RegionRole::kHandle, RegionShape::kPoints, "knob");
  dot.points = {{5.2, 5.1, 0.3}};
  const EditRegions out =
      resolve_regions(std::vector<EditRegion>{support, knob, side, dot}, s.position, s.faces, 3);
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
  far.point = {100, 0, 0}, far.reach = 1.0;
  CHECK_THROWS_WITH(resolve_regions(std::vector<EditRegion>{support, far}, s.position, s.faces, 2),
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
