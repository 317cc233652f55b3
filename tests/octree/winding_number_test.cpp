#include "octree/winding_number.h"

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>

#include "octree/points.h"
#include "tests/helpers/dipole_samples.h"

namespace winding_number_test {

using namespace tessera;
using test::kPi;
using test::quantised;
using test::queries_around;
using test::Split;

namespace {

double brute_force(const std::vector<Dipole>& dipoles, const Int3& q) {
  double sum = 0;
  for (const Dipole& d : dipoles) {
    double p[3], r2 = 0, along = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      p[c] = static_cast<double>(d.q[c] - q[c]) / kQuantaPerCell;
      r2 += p[c] * p[c];
      along += p[c] * static_cast<double>(d.moment[c]);
    }
    const double r = std::max(std::sqrt(r2), static_cast<double>(kDipoleCore));
    sum += along / (r * r * r);
  }
  return sum / (4 * kPi);
}

}  // namespace

TEST_CASE("winding number: agrees with brute force", "[unit]") {
  const Double3 centre = {300.3, 311.7, 290.1};
  const std::vector<Dipole> dipoles = test::sphere_dipoles(centre, 60.0, 1.5);
  const MultipoleTree tree(dipoles, kLeafBits);
  const std::vector<Int3> queries = queries_around(centre, 120.0, 1500);
  std::vector<float> value(queries.size());
  WindingField(tree).evaluate(queries, value);
  double sum2 = 0, worst = 0;
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const double error = std::abs(static_cast<double>(value[i]) - brute_force(dipoles, queries[i]));
    sum2 += error * error;
    worst = std::max(worst, error);
  }
  CHECK(std::sqrt(sum2 / static_cast<double>(queries.size())) < 3e-3);
  CHECK(worst < 1e-2);
}

TEST_CASE("winding number: 1 inside, 0 outside a closed surface, half the sphere seen from a cap's rim",
          "[unit]") {
  const Double3 centre = {300.3, 311.7, 290.1};
  const MultipoleTree tree(test::sphere_dipoles(centre, 60.0, 1.0), kLeafBits);
  const std::vector<Int3> queries = {quantised(centre), quantised({330, 320, 300}),
                                     quantised({400, 311, 290})};
  std::vector<float> value(3);
  WindingField(tree).evaluate(queries, value);
  CHECK(std::abs(value[0] - 1.0f) < 0.01f);
  CHECK(std::abs(value[1] - 1.0f) < 0.01f);
  CHECK(std::abs(value[2]) < 0.01f);
}

TEST_CASE("winding number: the gradient is that of the values", "[unit]") {
  const Double3 centre = {300.3, 311.7, 290.1};
  const MultipoleTree tree(test::sphere_dipoles(centre, 40.0, 1.5), kLeafBits);
  // Steps that stay in the leaf of the query: lists change between leaves.
  for (const Double3& p : {Double3{260, 316, 292}, {300, 300, 340.5}, {356.5, 340, 300}, {300, 308, 268.5}}) {
    const double step = 0.25;
    std::vector<Int3> queries = {quantised(p)};
    for (std::size_t c = 0; c < 3; ++c)
      for (const double sign : {-1.0, 1.0}) {
        Double3 moved = p;
        moved[c] += sign * step;
        queries.push_back(quantised(moved));
      }
    std::vector<float> value(queries.size());
    std::vector<Float3> gradient(queries.size());
    WindingField(tree).evaluate(queries, value, gradient);
    const double size = std::sqrt(static_cast<double>(
        gradient[0][0] * gradient[0][0] + gradient[0][1] * gradient[0][1] + gradient[0][2] * gradient[0][2]));
    for (std::size_t c = 0; c < 3; ++c) {
      const double slope = static_cast<double>(value[2 * c + 2] - value[2 * c + 1]) / (2 * step);
      CHECK(std::abs(slope - static_cast<double>(gradient[0][c])) < 0.05 * size + 2e-5);
    }
  }
}

TEST_CASE("winding number: the same bits for any block that holds the halo", "[property]") {
  const Double3 centre = {300.3, 311.7, 290.1};
  const std::vector<Dipole> dipoles = test::sphere_dipoles(centre, 90.0, 2.0);
  const MultipoleTree whole(dipoles, kLeafBits);
  std::vector<Int3> queries;
  for (const Int3& q : queries_around(centre, 110.0, 3000)) {
    bool in = true;
    for (const int c : q) in &= c >> 16 == 4;  // brick (4,4,4)
    if (in) queries.push_back(q);
  }
  REQUIRE(queries.size() > 50);
  std::vector<float> expected(queries.size()), value(queries.size());
  std::vector<Float3> expected_gradient(queries.size()), gradient(queries.size());
  WindingField(whole).evaluate(queries, expected, expected_gradient);
  for (const auto& [low, high] : {std::pair{Int3{4, 4, 4}, Int3{5, 5, 5}}, {Int3{4, 3, 4}, Int3{6, 5, 5}}}) {
    const Split split(dipoles, low, high);
    WindingField(split.far, split.near).evaluate(queries, value, gradient);
    for (std::size_t i = 0; i < queries.size(); ++i) {
      REQUIRE(std::bit_cast<std::uint32_t>(value[i]) == std::bit_cast<std::uint32_t>(expected[i]));
      REQUIRE(gradient[i] == expected_gradient[i]);
    }
  }
  // One at a time, and another order: lanes and groups do not matter.
  std::reverse(queries.begin(), queries.end());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    float one = 0;
    WindingField(whole).evaluate({&queries[i], 1}, {&one, 1});
    REQUIRE(std::bit_cast<std::uint32_t>(one) ==
            std::bit_cast<std::uint32_t>(expected[queries.size() - 1 - i]));
  }
}

TEST_CASE("multipoles: a parent's is that of its points", "[unit]") {
  test::Random random(3);
  std::vector<Dipole> dipoles;
  for (int i = 0; i < 300; ++i) {
    Dipole d;
    for (std::size_t c = 0; c < 3; ++c) {
      d.q[c] = static_cast<int>((1 << 20) + random.unit() * (1 << 16));
      d.moment[c] = static_cast<float>(random.unit() - 0.3);
    }
    dipoles.push_back(d);
  }
  std::sort(dipoles.begin(), dipoles.end(),
            [](const Dipole& a, const Dipole& b) { return test::before(a.q, b.q); });
  const MultipoleTree tree(dipoles, 3);
  const Multipole direct = multipole_of(dipoles, 6);
  REQUIRE(tree.level(6).cells.size() == 1);
  const Multipole& merged = tree.level(6).cells[0];
  CHECK(merged.key == direct.key);
  CHECK(merged.points == 300);
  for (std::size_t c = 0; c < 3; ++c) CHECK(std::abs(merged.centre[c] - direct.centre[c]) <= 2);
  const auto close = [](float a, float b) { return std::abs(a - b) < 2e-4f * 0.1f; };
  for (std::size_t i = 0; i < 3; ++i) CHECK(close(merged.first[i], direct.first[i]));
  for (std::size_t i = 0; i < 5; ++i) CHECK(close(merged.second[i], direct.second[i]));
  for (std::size_t i = 0; i < 7; ++i) CHECK(close(merged.third[i], direct.third[i]));
}

}  // namespace winding_number_test
