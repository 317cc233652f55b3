// Change between clouds is that of brute force over all points, and of planes what is known of them.
#include <catch2/catch.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "kernels/change/core_change.h"
#include "octree/small_matrix.h"
#include "tests/helpers/random.h"

namespace core_change_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// A bent sheet with a wall and noise, so that there are all directions of normals.
std::vector<Double3> cloud(std::size_t count, unsigned seed, double lift) {
  Random random(seed);
  std::vector<Double3> points;
  for (std::size_t i = 0; i < count; ++i) {
    const double u = random.in(0.0, 20.0), v = random.in(0.0, 20.0);
    Double3 p = random.below(4) == 0 ? Double3{10.0, u, 0.3 * v}
                                     : Double3{u, v, 1.5 * std::sin(0.5 * u) + 0.02 * v * v + lift};
    for (double& x : p) x += 0.02 * random.gaussian();
    points.push_back(p);
  }
  return points;
}

/// The plane through all points of a ball, by a mean and a second pass around it.
Double3 brute_normal(const std::vector<Double3>& points, const Double3& p, double radius) {
  std::vector<Double3> in;
  Double3 mean{};
  for (const Double3& q : points)
    if (squared_distance(q, p) <= radius * radius) in.push_back(q), mean = mean + q;
  mean = mean / static_cast<double>(in.size());
  std::array<double, 6> m{};
  for (const Double3& q : in) {
    const Double3 d = q - mean;
    m[0] += d[0] * d[0], m[1] += d[0] * d[1], m[2] += d[0] * d[2];
    m[3] += d[1] * d[1], m[4] += d[1] * d[2], m[5] += d[2] * d[2];
  }
  Double3 values;
  std::array<Double3, 3> vectors;
  symmetric_eigen3(m, values, vectors);
  return vectors[0][2] < 0.0 ? -vectors[0] : vectors[0];
}

std::vector<double> brute_positions(const std::vector<Double3>& points, const Cylinder& c) {
  std::vector<double> at;
  for (const Double3& q : points) {
    const Double3 d = q - c.middle;
    const double along = dot(d, c.axis);
    if (std::abs(along) <= c.depth && dot(d, d) - along * along <= c.radius * c.radius) at.push_back(along);
  }
  std::sort(at.begin(), at.end());
  return at;
}

double quartile(const std::vector<double>& v, double share) {
  const double at = share * static_cast<double>(v.size() - 1);
  const auto k = static_cast<std::size_t>(at);
  return v[k] + (at - std::floor(at)) * (v[std::min(k + 1, v.size() - 1)] - v[k]);
}

ChangeRule rule_of(double ball, double cylinder, double depth) {
  ChangeRule rule;
  rule.normal_scale = ball, rule.projection_scale = cylinder, rule.max_depth = depth;
  return rule;
}

std::vector<CoreChange> measure(const std::vector<Double3>& before, const std::vector<Double3>& after,
                                const std::vector<Double3>& places, const ChangeRule& rule,
                                std::size_t group = 7) {
  const double size = change_cell_size(rule);
  const PointCells a(before, size, true), b(after, size, false);
  std::vector<CoreChange> out(places.size());
  ChangeWork work;
  for (std::size_t i = 0; i < places.size(); i += group) {
    const std::size_t n = std::min(group, places.size() - i);
    changes_at(a, b, std::span(places).subspan(i, n), rule, work, std::span(out).subspan(i, n));
  }
  return out;
}

}  // namespace

TEST_CASE("core change: normals, means and spreads are those of brute force over all points", "[property]") {
  const std::vector<Double3> before = cloud(30000, 1, 0.0), after = cloud(20000, 2, 0.35);
  std::vector<Double3> places(before.begin(), before.begin() + 400);
  for (const bool median : {false, true})
    for (const auto& [ball, cylinder, depth] :
         {std::array{2.0, 1.0, 3.0}, std::array{1.0, 2.5, 0.8}, std::array{6.0, 0.3, 20.0}}) {
      ChangeRule rule = rule_of(ball, cylinder, depth);
      rule.median = median, rule.registration_error = 0.01;
      const std::vector<CoreChange> found = measure(before, after, places, rule);
      std::size_t wrong = 0, with = 0;
      for (std::size_t i = 0; i < places.size(); ++i) {
        const CoreChange& c = found[i];
        const Double3 normal = brute_normal(before, places[i], 0.5 * ball);
        wrong += norm(c.normal - normal) < 1e-6 || norm(c.normal + normal) < 1e-6 ? 0 : 1;
        // From here on with its normal: which points lie in a cylinder hangs on the last bit of it.
        const Cylinder tube = {places[i], c.normal, 0.5 * cylinder, depth};
        std::array<double, 2> mean{}, variance{};
        std::array<std::vector<double>, 2> at = {brute_positions(before, tube), brute_positions(after, tube)};
        for (std::size_t k = 0; k < 2; ++k) {
          const std::vector<double>& v = at[k];
          wrong += c.clouds[k].count == v.size() ? 0 : 1;
          if (v.empty()) continue;
          const double n = static_cast<double>(v.size());
          double sum = 0.0, square = 0.0;
          for (const double x : v) sum += x;
          for (const double x : v) square += (x - sum / n) * (x - sum / n);
          mean[k] = median ? quartile(v, 0.5) : sum / n;
          const double spread = median          ? quartile(v, 0.75) - quartile(v, 0.25)
                                : v.size() == 1 ? 0.0
                                                : std::sqrt(square / (n - 1.0));
          wrong += std::abs(c.clouds[k].mean - mean[k]) < 1e-6 * depth ? 0 : 1;
          wrong += std::abs(c.clouds[k].spread - spread) < 1e-6 * depth ? 0 : 1;
          variance[k] = spread * spread / n;
        }
        if (at[0].empty() || at[1].empty()) {
          wrong += std::isnan(c.distance) && std::isnan(c.uncertainty) && !c.significant ? 0 : 1;
          continue;
        }
        ++with;
        wrong += std::abs(c.distance - (mean[1] - mean[0])) < 1e-6 * depth ? 0 : 1;
        if (at[0].size() < 5 || at[1].size() < 5) {
          wrong += std::isnan(c.uncertainty) && !c.significant ? 0 : 1;
          continue;
        }
        const double level = 1.96 * (std::sqrt(variance[0] + variance[1]) + 0.01);
        wrong += std::abs(c.uncertainty - level) < 1e-6 * depth ? 0 : 1;
        wrong += c.significant == (std::abs(c.distance) > c.uncertainty) ? 0 : 1;
      }
      CAPTURE(median, ball, cylinder, depth);
      CHECK(wrong == 0);
      CHECK(with > places.size() / 4);
    }
}

TEST_CASE("core change: what is found of a place hangs neither on its company nor on the order of the points",
          "[property]") {
  std::vector<Double3> before = cloud(20000, 3, 0.0), after = cloud(20000, 4, 0.2);
  const std::vector<Double3> places(before.begin(), before.begin() + 500);
  const ChangeRule rule = rule_of(1.6, 0.8, 2.0);
  const std::vector<CoreChange> want = measure(before, after, places, rule, 1);
  std::reverse(before.begin(), before.end());
  std::reverse(after.begin(), after.end());
  const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x); };
  for (const std::size_t group : {3u, 500u}) {
    const std::vector<CoreChange> got = measure(before, after, places, rule, group);
    std::size_t other = 0;
    for (std::size_t i = 0; i < places.size(); ++i)
      other += bits(got[i].distance) == bits(want[i].distance) &&
                       bits(got[i].uncertainty) == bits(want[i].uncertainty) &&
                       got[i].normal == want[i].normal
                   ? 0
                   : 1;
    CHECK(other == 0);
  }
}

TEST_CASE(
    "core change: between noisy planes the distance is known, and 95 % of the errors lie below the level",
    "[property]") {
  constexpr double kApart = 0.5, kNoise = 0.05;
  const Double3 normal = unit(Double3{1.0, 2.0, 4.0}), u = any_orthogonal(normal), v = cross(normal, u);
  const auto plane = [&](unsigned seed, double height, double noise) {
    Random random(seed);
    std::vector<Double3> points;
    for (std::size_t i = 0; i < 100000; ++i)
      points.push_back(u * random.in(-50.0, 50.0) + v * random.in(-50.0, 50.0) +
                       normal * (height + noise * random.gaussian()));
    return points;
  };
  const std::vector<Double3> before = plane(5, 0.0, kNoise), after = plane(6, kApart, 2.0 * kNoise);
  // So far apart that their cylinders share no point: each is a trial of its own.
  std::vector<Double3> places;
  for (double s = -45.0; s <= 45.0; s += 2.0)
    for (double t = -45.0; t <= 45.0; t += 2.0) places.push_back(u * s + v * t);
  const std::vector<CoreChange> found = measure(before, after, places, rule_of(8.0, 1.9, 5.0), 1);
  double mean = 0.0, within = 0.0;
  for (const CoreChange& c : found) {
    CHECK(dot(c.normal, normal) > 0.9995);
    CHECK(c.significant);
    mean += c.distance;
    within += std::abs(c.distance - kApart) <= c.uncertainty ? 1.0 : 0.0;
  }
  const double n = static_cast<double>(found.size());
  CHECK(n > 2000.0);
  CHECK(mean / n == Approx(kApart).margin(1e-3));
  CHECK(within / n > 0.93);
  CHECK(within / n < 0.97);

  // No change: 5 % are taken for one, and none with an error of registration that is as large as the noise.
  const std::vector<Double3> same = plane(7, 0.0, kNoise);
  ChangeRule rule = rule_of(8.0, 1.9, 5.0);
  double taken = 0.0;
  for (const CoreChange& c : measure(before, same, places, rule, 1)) taken += c.significant ? 1.0 : 0.0;
  CHECK(taken / n > 0.03);
  CHECK(taken / n < 0.07);
  rule.registration_error = kNoise;
  for (const CoreChange& c : measure(before, same, places, rule, 1)) CHECK_FALSE(c.significant);
}

TEST_CASE("core change: four points have no level of detection, five have", "[unit]") {
  const AxialPositions four = {4, 0.0, 1.0}, five = {5, 1.0, 2.0};
  CHECK(std::isnan(level_of_detection(four, five, 0.0)));
  CHECK(std::isnan(level_of_detection(five, four, 0.0)));
  CHECK(level_of_detection(five, {10, 0.0, 1.0}, 0.25) == Approx(1.96 * (std::sqrt(4.0 / 5.0 + 0.1) + 0.25)));
}

TEST_CASE("core change: without a plane there is no distance", "[unit]") {
  std::vector<Double3> line;
  for (int i = 0; i < 50; ++i) line.push_back({0.1 * i, 0.0, 0.0});
  const ChangeRule rule = rule_of(2.0, 1.0, 1.0);
  CHECK(std::isnan(measure(line, line, {line[20]}, rule)[0].distance));
  CHECK(std::isnan(measure({{0, 0, 0}, {0.1, 0, 0}}, line, {{0, 0, 0}}, rule)[0].distance));
  CHECK(std::isnan(measure(line, {}, {line[20]}, rule)[0].distance));
}

}  // namespace core_change_test
