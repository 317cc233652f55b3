#include "kernels/solid/swept_tool.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/helpers/random.h"

namespace swept_tool_test {

using namespace tessera;
using test::Random;

namespace {

Double3 somewhere(Random& random, double extent) {
  return {random.in(-extent, extent), random.in(-extent, extent), random.in(-extent, extent)};
}

/// Turns, stands still and crosses itself.
std::vector<Double3> tangled_path(Random& random, std::size_t points) {
  std::vector<Double3> path = {somewhere(random, 10)};
  while (path.size() < points) {
    const std::uint64_t kind = random.below(4);
    Double3 next = path.back();
    if (kind == 1) next = next + Double3{random.in(-2, 2), random.in(-2, 2), 0.0};
    if (kind == 2) next = next + somewhere(random, 3);
    if (kind == 3) next[2] += random.in(-1, 1);
    path.push_back(next);
  }
  return path;
}

/// Distance from a tool by where it is defined, at closely set places of a segment.
double swept_by_steps(const MillingTool& tool, const Double3& a, const Double3& b, const Double3& p,
                      int steps) {
  double minimum = 1e300;
  for (int i = 0; i <= steps; ++i) {
    const Double3 q = p - (a + (b - a) * (static_cast<double>(i) / steps));
    const double across = std::hypot(q[0], q[1]);
    const double wide = across - (tool.radius - tool.corner_radius), low = tool.corner_radius - q[2];
    const double nose = wide <= 0.0 || low <= 0.0 ? std::max(wide, low) : std::hypot(wide, low);
    minimum = std::min(minimum, std::max(nose - tool.corner_radius, q[2] - tool.length));
  }
  return minimum;
}

const MillingTool kTools[] = {{1.0, 1.0, 3.0}, {1.0, 0.0, 2.0}, {1.5, 0.5, 1.0}};

}  // namespace

TEST_CASE("swept tool: its value is the least over all places of the tip", "[property]") {
  Random random(7);
  for (const MillingTool& tool : kTools) {
    const std::vector<Double3> path = tangled_path(random, 60);
    const SweptTool swept(tool, path, Placement{});
    for (int query = 0; query < 300; ++query) {
      const Double3 p = somewhere(random, 14);
      double minimum = 1e300;
      for (std::size_t s = 0; s + 1 < path.size(); ++s)
        minimum = std::min(minimum, swept_by_steps(tool, path[s], path[s + 1], p, 400));
      CHECK(swept.value(p) <= minimum + 1e-9);
      CHECK(swept.value(p) > minimum - 2e-2);  // places between the steps
    }
  }
}

TEST_CASE("swept tool: what is near a point has the same bits there, whatever was asked before",
          "[property]") {
  Random random(8);
  for (const MillingTool& tool : kTools) {
    const std::vector<Double3> path = tangled_path(random, 1000);
    Placement placement = rotation({0.6, 0.0, 0.8}, 33.0);
    for (double& m : placement.matrix) m *= 1.7;
    placement.shift = {4, 5, 6};
    const SweptTool swept(tool, path, placement);
    std::size_t same = 0, inside = 0;
    for (int ball = 0; ball < 60; ++ball) {
      const Double3 middle = placement.apply(path[random.below(path.size())] + somewhere(random, 2));
      const double radius = random.in(0.05, 1.5), margin = random.in(0.0, 1.0);
      const auto near = swept.near(middle, radius, margin);
      REQUIRE(near);
      for (int query = 0; query < 60; ++query) {
        Double3 p = somewhere(random, 1.0);
        if (norm(p) > 1.0) continue;
        p = middle + p * radius;
        const double value = swept.value(p);
        if (value > margin) {
          CHECK(near->value(p) >= value);
          continue;
        }
        CHECK(near->value(p) == value);
        CHECK(near->direction(p) == swept.direction(p));
        ++same;
        inside += value < 0.0;
      }
    }
    CHECK(same > 200);
    CHECK(inside > 100);
    CHECK(same > inside);
  }
}

TEST_CASE("swept tool: a path that stands still or comes back takes away what one pass does", "[unit]") {
  const std::vector<Double3> once = {{0, 0, 0}, {5, 1, 0}, {5, 1, 2}};
  const std::vector<Double3> again = {{0, 0, 0}, {0, 0, 0}, {5, 1, 0}, {0, 0, 0},
                                      {5, 1, 0}, {5, 1, 0}, {5, 1, 2}, {5, 1, 2}};
  Random random(9);
  for (const MillingTool& tool : kTools) {
    const SweptTool first(tool, once, Placement{}), second(tool, again, Placement{});
    const SweptTool plunge(tool, {{1, 2, 3}}, Placement{}), still(tool, {{1, 2, 3}, {1, 2, 3}}, Placement{});
    for (int query = 0; query < 200; ++query) {
      const Double3 p = somewhere(random, 7);
      CHECK(second.value(p) == Approx(first.value(p)).margin(1e-12));
      CHECK(still.value(p) == plunge.value(p));
    }
  }
}

}  // namespace swept_tool_test
