#include "kernels/decimate/tolerance_check.h"

#include <catch2/catch.hpp>

#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include "tests/helpers/collapse_fixture.h"

namespace tessera::tolerance_check_test {
namespace {

using test::CollapseFixture;
using test::sheet;

DecimateOptions within(double tolerance) {
  DecimateOptions o;
  o.tolerance = tolerance;
  return o;
}

/// The collapse of 12 into 13, whose reference is the mesh itself.
struct OneCollapse {
  OneCollapse(CollapseFixture& mesh, const DecimateOptions& options)
      : m(mesh), known(m.mesh.vertices()), at(m.gather(12, 13)) {
    std::iota(known.begin(), known.end(), 0u);
    sum = *bound_by_sum(m.mesh, m.vertex[12], m.star, at, sides);
    tolerance.emplace(m.mesh, m.mesh, known, options);
    tolerance->keep_witnesses();
  }
  CollapseRefusal check() { return tolerance->check(m.vertex[12], m.star, at, sides, sum); }
  DecimateReport report() const {
    DecimateReport r;
    tolerance->report(r);
    return r;
  }
  CollapseFixture& m;
  std::vector<std::uint32_t> known;
  std::size_t at;
  LinkSides sides;
  CollapseBound sum;
  std::optional<ToleranceCheck> tolerance;
};

}  // namespace

TEST_CASE("tolerance check: a short sum is enough, a long one asks the reference", "[unit]") {
  CollapseFixture m = sheet(0.25);
  const DecimateOptions options = within(0.3);
  OneCollapse one(m, options);
  CHECK(one.check() == CollapseRefusal::kNone);
  CHECK(one.report().exact_tests == 0);
  one.sum.bound = 9.0f;
  CHECK(one.check() == CollapseRefusal::kNone);
  CHECK(one.report().exact_tests == 1);
  CHECK(one.report().exact_accepted == 1);
  CHECK(one.sum.bound == Approx(0.25).epsilon(1e-4));
}

TEST_CASE("tolerance check: beyond the tolerance it refuses, and once more without a walk", "[unit]") {
  CollapseFixture m = sheet(0.25);
  const DecimateOptions options = within(0.2);
  OneCollapse one(m, options);
  CHECK(one.check() == CollapseRefusal::kTolerance);
  const auto walked = one.report().reference_faces_walked;
  CHECK(one.check() == CollapseRefusal::kTolerance);
  CHECK(one.report().reference_faces_walked == walked);
  CHECK(one.report().exact_tests == 2);
  CHECK(one.report().exact_accepted == 0);
}

TEST_CASE("tolerance check: a vertex that the reference lacks may go by its sum alone", "[unit]") {
  CollapseFixture m = sheet(0.25);
  const DecimateOptions options = within(0.3);
  OneCollapse one(m, options);
  one.tolerance.emplace(m.mesh, m.mesh, std::vector<std::uint32_t>(m.mesh.vertices(), kNoCorner), options);
  CHECK(one.check() == CollapseRefusal::kNone);
  one.sum.bound = 9.0f;
  CHECK(one.check() == CollapseRefusal::kTolerance);
}

TEST_CASE("tolerance check: the coarse reference is asked first", "[unit]") {
  CollapseFixture m = sheet(0.25);
  const DecimateOptions options = within(0.3);
  OneCollapse one(m, options);
  one.tolerance->set_coarse();
  one.sum.bound = 9.0f;
  CHECK(one.check() == CollapseRefusal::kNone);
  CHECK(one.report().exact_accepted == 1);
  CHECK(one.report().reference_faces_walked == 0);  // of the fine one
}

TEST_CASE("tolerance check: creases deviate by half as much", "[unit]") {
  for (const double tolerance : {0.4, 0.6}) {
    CollapseFixture m = sheet();
    m.at(12)[1] = 2.25;
    m.mark_creases([](const Double3& p) { return p[1] == 2.0 || p[1] == 2.25; });
    const DecimateOptions options = within(tolerance);
    OneCollapse one(m, options);
    CHECK(one.sum.bound == Approx(0.25));
    CHECK((one.check() == CollapseRefusal::kNone) == (tolerance > 0.5));
  }
}

TEST_CASE("tolerance check: normals are asked even where the sum is short", "[unit]") {
  CollapseFixture m = sheet(0.5);
  DecimateOptions options = within(0.6);
  options.max_normal_deviation_deg = 10.0;
  OneCollapse one(m, options);
  CHECK(one.tolerance->asks_normals());
  CHECK(one.check() == CollapseRefusal::kNormal);
}

TEST_CASE("tolerance check: an edge that goes to a place between is near by its sum or by the reference",
          "[unit]") {
  CollapseFixture m = sheet();
  DecimateOptions options = within(0.1);
  options.placement = DecimatePlacement::kOptimal;
  OneCollapse one(m, options);
  Star other;
  REQUIRE(m.mesh.gather(m.vertex[13], other));
  for (const double z : {0.05, 0.3}) {
    const Double3 p{2.4, 2.0, z};
    LinkLoop loop;
    REQUIRE(lay_edge_link(m.mesh, m.star, one.at, other, p, 0.0, loop));
    float bound = std::numeric_limits<float>::infinity();
    const bool near = one.tolerance->is_edge_near(m.vertex[12], m.vertex[13], p, loop, bound);
    CHECK(near == (z < 0.1));
    if (near) CHECK(bound == Approx(z).epsilon(1e-3));
    bound = 0.01f;
    CHECK(one.tolerance->is_edge_near(m.vertex[12], m.vertex[13], p, loop, bound));
    CHECK(bound == 0.01f);
  }
}

}  // namespace tessera::tolerance_check_test
