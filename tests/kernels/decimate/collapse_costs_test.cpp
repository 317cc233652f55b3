#include "kernels/decimate/collapse_costs.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "tests/helpers/collapse_fixture.h"

namespace tessera::collapse_costs_test {
namespace {

using test::CollapseFixture;
using test::sheet;

CollapseCosts costs_of(CollapseFixture& m, const DecimateOptions& options) {
  return CollapseCosts(m.mesh, m.block, Double3{}, options);
}

}  // namespace

TEST_CASE("collapse costs: in a plane short edges go first, of equal ones the lower vertex", "[unit]") {
  CollapseFixture m = sheet();
  const DecimateOptions options;
  CollapseCosts costs = costs_of(m, options);
  CHECK(costs.area() == Approx(16.0));
  CandidateStar s(options);
  CandidateList list;
  REQUIRE(costs.gather(m.vertex[12], s));
  costs.list(s, list);
  REQUIRE(list.size == 6);
  double before = 0.0;
  for (std::size_t i = 0; i < 6; ++i) {
    const CollapseCandidate c = list.next(i);
    CHECK(c.cost >= before);
    CHECK(c.vertex == s.star.ring[c.at]);
    if (i > 0 && c.cost == before) CHECK(c.vertex > list.item[i - 1].vertex);
    before = c.cost;
  }
  CHECK(list.item[5].cost > list.item[0].cost);  // a diagonal
}

TEST_CASE("collapse costs: the squared distance to planes, by area, in lanes or not", "[unit]") {
  CollapseFixture m = sheet(0.5);
  DecimateOptions options;
  for (const double weight : {0.0, 1.0}) {
    options.colour_weight = weight;  // not plain: none in lanes; and the block has no colours
    CollapseCosts costs = costs_of(m, options);
    CandidateStar s(options);
    REQUIRE(costs.gather(m.vertex[18], s));
    CHECK(s.in_lanes == (weight == 0.0));
    CandidateList list;
    costs.list(s, list);
    // Two of the six planes around 18, (3, 3, 0), hold 12 as well.
    const CollapseCandidate best = list.next(0);
    CHECK(best.vertex != m.vertex[12]);
    for (std::size_t i = 0; i < list.size; ++i)
      if (list.item[i].vertex == m.vertex[12]) CHECK(list.item[i].cost > 0.1);
    const StarLanes::Cheapest cheapest = costs.cheapest(s, 1e+30);
    CHECK(cheapest.cost == Approx(best.cost));
    CHECK(costs.cheapest(s, 1e-30).cost <= Approx(best.cost));
  }
}

TEST_CASE("collapse costs: a border vertex may go along its border alone", "[unit]") {
  CollapseFixture m = sheet();
  const DecimateOptions options;
  CollapseCosts costs = costs_of(m, options);
  CandidateStar s(options);
  CandidateList list;
  REQUIRE(costs.gather(m.vertex[2], s));
  costs.list(s, list);
  CHECK(list.size == 2);
}

TEST_CASE("collapse costs: a vertex takes over what was merged into it, and counts it as its error",
          "[unit]") {
  CollapseFixture m = sheet(0.5);
  const DecimateOptions options;
  CollapseCosts costs = costs_of(m, options);
  CHECK(m.mesh.node(m.vertex[18]).error == Approx(0.0).margin(1e-12));
  costs.merge(m.vertex[12], m.vertex[18]);
  CHECK(m.mesh.node(m.vertex[18]).error > 0.1);
}

TEST_CASE("collapse costs: the best position of a tent's edge is on its ridge, as a float", "[unit]") {
  CollapseFixture m(
      test::grid_block(4, 4, [](double x, double) { return 0.3 * (2.0 - std::fabs(x - 2.0)); }));
  DecimateOptions options;
  options.placement = DecimatePlacement::kOptimal;
  options.priority = DecimatePriority::kProbabilistic;
  options.noise = 0.01;
  CollapseCosts costs = costs_of(m, options);
  CHECK(costs.may_move(m.vertex[12], m.vertex[13]));
  CHECK_FALSE(costs.may_move(m.vertex[13], m.vertex[14]));  // on the border
  const Double3 p = costs.best_position(m.vertex[12], m.vertex[7]);
  CHECK(p[0] == Approx(2.0).margin(0.01));
  CHECK(p[2] == Approx(0.6).margin(0.01));
  for (const double c : p) CHECK(c == static_cast<double>(static_cast<float>(c)));
}

TEST_CASE("collapse costs: every priority orders by what it says", "[unit]") {
  CollapseFixture m = sheet(0.1);
  m.at(13)[0] = 2.5;
  DecimateOptions options;
  CandidateList list;
  const auto cheapest = [&](DecimatePriority priority) {
    options.priority = priority;
    CollapseCosts costs = costs_of(m, options);
    CandidateStar s(options);
    REQUIRE(costs.gather(m.vertex[12], s));
    costs.list(s, list);
    REQUIRE(list.size > 0);  // those that fold have no distance
    return list.next(0);
  };
  CHECK(cheapest(DecimatePriority::kEdgeLength).vertex == m.vertex[13]);
  CHECK(cheapest(DecimatePriority::kEdgeLength).cost == Approx(0.26));
  CHECK(cheapest(DecimatePriority::kSampleDistance).cost == Approx(0.01).epsilon(1e-3));
  const CollapseCandidate round = cheapest(DecimatePriority::kMeanRatio);
  CHECK(round.cost > 0.0);
  CHECK(round.cost < 2.0);
  CHECK(cheapest(DecimatePriority::kNormalDeviation).cost > 0.0);
}

}  // namespace tessera::collapse_costs_test
