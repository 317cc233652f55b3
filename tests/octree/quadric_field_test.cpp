#include "octree/quadric_field.h"

#include <bit>
#include <catch2/catch.hpp>
#include <cmath>

#include "tests/helpers/dipole_samples.h"

namespace quadric_field_test {

using namespace tessera;
using test::quantised;
using test::queries_around;
using test::Split;

namespace {

constexpr float kCore = 3.0f;
const Double3 kCentre = {300.3, 311.7, 290.1};

/// Without what lies above `height`.
std::vector<Dipole> cut(std::vector<Dipole> dipoles, double height) {
  std::erase_if(dipoles, [&](const Dipole& d) { return d.q[2] > height * kQuantaPerCell; });
  return dipoles;
}

Double3 cells(const Int3& q) {
  return {static_cast<double>(q[0]) / kQuantaPerCell, static_cast<double>(q[1]) / kQuantaPerCell,
          static_cast<double>(q[2]) / kQuantaPerCell};
}

}  // namespace

TEST_CASE("quadric field: continues a sphere exactly however much of it is missing", "[unit]") {
  for (const double height : {2.0, 0.5, -0.5}) {
    const MultipoleTree tree(cut(test::sphere_dipoles(kCentre, 60.0, 1.5), kCentre[2] + 60.0 * height),
                             kLeafBits);
    const std::vector<Int3> queries = queries_around(kCentre, 100.0, 1000);
    std::vector<QuadricValue> value(queries.size());
    QuadricField(tree, kCore).evaluate(queries, value);
    double worst = 0, misfit = 0;
    for (std::size_t i = 0; i < queries.size(); ++i) {
      const Double3 p = cells(queries[i]);
      const double true_distance = std::hypot(p[0] - kCentre[0], p[1] - kCentre[1], p[2] - kCentre[2]) - 60.0;
      worst = std::max(worst, std::abs(static_cast<double>(value[i].distance) - true_distance));
      misfit = std::max(misfit, static_cast<double>(value[i].misfit));
    }
    CHECK(worst < 0.02);
    CHECK(misfit < 1e-3);
  }
}

TEST_CASE("quadric field: continues a plane across any gap", "[unit]") {
  std::vector<Dipole> dipoles;
  for (int i = 0; i < 200; ++i)
    for (int j = 0; j < 200; ++j) {
      const Double3 p = {201.0 + i, 201.0 + j, 300.0 + 0.25 * i};
      if (std::hypot(p[0] - 300.0, p[1] - 300.0) < 60.0) continue;
      const float s = 1.0f / std::sqrt(1.0625f);
      dipoles.push_back({quantised(p), {-0.25f * s, 0.0f, s}});
    }
  std::sort(dipoles.begin(), dipoles.end(),
            [](const Dipole& a, const Dipole& b) { return test::before(a.q, b.q); });
  const MultipoleTree tree(dipoles, kLeafBits);
  std::vector<Int3> queries;
  for (int i = 0; i < 100; ++i)
    queries.push_back(
        quantised({251.0 + i, 300.0, 300.0 + 0.25 * (50 + i) + (i % 7 - 3.0) * std::sqrt(1.0625)}));
  std::vector<QuadricValue> value(queries.size());
  QuadricField(tree, kCore).evaluate(queries, value);
  for (int i = 0; i < 100; ++i) {
    CHECK(std::abs(static_cast<double>(value[static_cast<std::size_t>(i)].distance) - (i % 7 - 3.0)) < 0.02);
    CHECK(value[static_cast<std::size_t>(i)].misfit < 1e-3f);
  }
}

TEST_CASE("quadric field: continues tubes and saddles", "[unit]") {
  // A torus without what lies within 14 cells of a point of its outer and one of its inner equator.
  constexpr double kRing = 60.0, kTube = 25.0;
  const auto distance = [&](const Double3& p) {
    return std::hypot(std::hypot(p[0] - kCentre[0], p[1] - kCentre[1]) - kRing, p[2] - kCentre[2]) - kTube;
  };
  test::Random random(5);
  test::Samples samples;
  test::add_torus(kCentre, kRing, kTube, 1 / 1.5, random, samples);
  const double area = 4 * test::kPi * test::kPi * kRing * kTube / static_cast<double>(samples.size());
  const Double3 outer = {kCentre[0] + kRing + kTube, kCentre[1], kCentre[2]};
  const Double3 inner = {kCentre[0], kCentre[1] + kRing - kTube, kCentre[2]};
  for (const Double3& hole : {outer, inner}) {
    const auto in_hole = [&](const Double3& p) {
      return std::hypot(p[0] - hole[0], p[1] - hole[1], p[2] - hole[2]) < 14.0;
    };
    test::Samples kept;
    std::vector<Int3> queries;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (!in_hole(samples[i].p))
        kept.push_back(samples[i]);
      else
        queries.push_back(quantised(samples[i].p));
    }
    REQUIRE(queries.size() > 500);
    const MultipoleTree tree(test::dipoles_of(kept, area), kLeafBits);
    std::vector<QuadricValue> value(queries.size());
    QuadricField(tree, kCore).evaluate(queries, value);
    double sum = 0, worst = 0;
    for (const QuadricValue& v : value) {
      const double error = std::abs(static_cast<double>(v.distance));
      sum += error;
      worst = std::max(worst, error);
    }
    CHECK(sum / static_cast<double>(value.size()) < 0.4);
    CHECK(worst < 1.5);  // a plane across would be off by 4
    CHECK(std::abs(distance(cells(queries[0]))) < 0.01);
  }
}

TEST_CASE("quadric field: continuous from leaf to leaf", "[unit]") {
  // Two spheres that no quadric explains.
  std::vector<Dipole> dipoles = cut(test::sphere_dipoles(kCentre, 40.0, 1.5), kCentre[2] + 20.0);
  for (const Dipole& d : cut(test::sphere_dipoles({370, 311, 290}, 25.0, 1.5), 300.0)) dipoles.push_back(d);
  std::sort(dipoles.begin(), dipoles.end(),
            [](const Dipole& a, const Dipole& b) { return test::before(a.q, b.q); });
  const MultipoleTree tree(dipoles, kLeafBits);
  std::vector<Int3> queries;  // across the gap of the first, in steps that pass leaves and bricks
  for (int i = 0; i < 400; ++i) queries.push_back(quantised({280.0 + 0.2 * i, 309.0, 316.0 + 0.02 * i}));
  std::vector<QuadricValue> value(queries.size());
  QuadricField(tree, kCore).evaluate(queries, value);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    if (i > 0) CHECK(std::abs(value[i].distance - value[i - 1].distance) < 0.5f);
    CHECK((value[i].misfit >= 0.0f && value[i].misfit <= 1.0f));
  }
}

TEST_CASE("quadric field: the same bits for any block that holds the halo", "[property]") {
  const std::vector<Dipole> dipoles = cut(test::sphere_dipoles(kCentre, 90.0, 2.0), 320.0);
  const MultipoleTree whole(dipoles, kLeafBits);
  std::vector<Int3> queries;
  for (const Int3& q : queries_around(kCentre, 110.0, 3000)) {
    bool in = true;
    for (const int c : q) in &= c >> 16 == 4;  // brick (4,4,4)
    if (in) queries.push_back(q);
  }
  REQUIRE(queries.size() > 50);
  const auto same = [](const QuadricValue& a, const QuadricValue& b) {
    return std::bit_cast<std::uint32_t>(a.distance) == std::bit_cast<std::uint32_t>(b.distance) &&
           std::bit_cast<std::uint32_t>(a.misfit) == std::bit_cast<std::uint32_t>(b.misfit);
  };
  std::vector<QuadricValue> expected(queries.size()), value(queries.size());
  QuadricField(whole, kCore).evaluate(queries, expected);
  for (const auto& [low, high] : {std::pair{Int3{4, 4, 4}, Int3{5, 5, 5}}, {Int3{4, 3, 4}, Int3{6, 5, 5}}}) {
    const Split split(dipoles, low, high);
    QuadricField(split.far, split.near, kCore).evaluate(queries, value);
    for (std::size_t i = 0; i < queries.size(); ++i) REQUIRE(same(value[i], expected[i]));
  }
  std::reverse(queries.begin(), queries.end());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    QuadricValue one;
    QuadricField(whole, kCore).evaluate({&queries[i], 1}, {&one, 1});
    REQUIRE(same(one, expected[queries.size() - 1 - i]));
  }
}

TEST_CASE("quadric field: no data, no confidence", "[unit]") {
  const MultipoleTree tree(std::vector<Dipole>{}, kLeafBits);
  const Int3 query = quantised({300, 300, 300});
  QuadricValue value;
  QuadricField(tree, kCore).evaluate({&query, 1}, {&value, 1});
  CHECK(value.misfit == 1.0f);
}

}  // namespace quadric_field_test
