// Points on cuts and what is asked of them, against rational numbers.
#include <catch2/catch.hpp>

#include <cmath>

#include "kernels/boolean/exact_point.h"
#include "kernels/mesh/orientation_sign.h"
#include "tests/helpers/random.h"

namespace tessera::exact_point_test {
namespace {

using Rational = boost::multiprecision::cpp_rational;
using Rational3 = std::array<Rational, 3>;

Rational3 rational(const Double3& p) {
  return {Rational(p[0]), Rational(p[1]), Rational(p[2])};
}
Rational3 minus(const Rational3& a, const Rational3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Rational triple(const Rational3& a, const Rational3& b, const Rational3& c) {
  return (a[1] * b[2] - a[2] * b[1]) * c[0] + (a[2] * b[0] - a[0] * b[2]) * c[1] +
         (a[0] * b[1] - a[1] * b[0]) * c[2];
}
Rational3 on_plane(const Rational3& p, const Rational3& q, const Rational3& a, const Rational3& b,
                   const Rational3& c) {
  const Rational s = triple(minus(b, a), minus(c, a), minus(p, a)),
                 t = triple(minus(b, a), minus(c, a), minus(q, a)), w = s / (s - t);
  const Rational3 d = minus(q, p);
  return {p[0] + w * d[0], p[1] + w * d[1], p[2] + w * d[2]};
}
int sign_of(const Rational& x) {
  return x > 0 ? 1 : x < 0 ? -1 : 0;
}
Double3 random_point(test::Random& random, double scale, const Double3& by) {
  return Double3{std::round(random.in(-8, 8)), std::round(random.in(-8, 8)), random.in(-8, 8)} * scale + by;
}

}  // namespace

TEST_CASE("exact point: a point on a plane is the rational one, rounded to the nearest double", "[unit]") {
  test::Random random(5);
  for (int round = 0; round < 400; ++round) {
    const double scale = round % 2 == 0 ? 1.0 : 1e-3;
    const Double3 by = round % 3 == 0 ? Double3{691600, 5334700, 500} : Double3{0, 0, 0};
    std::array<Double3, 5> p;
    for (Double3& x : p) x = random_point(random, scale, by);
    if (orient3d_sign(p[2], p[3], p[4], p[0]) * orient3d_sign(p[2], p[3], p[4], p[1]) >= 0) continue;
    const PointTable table({p.begin(), p.end()});
    const ExactPoint made = table.grid().on_plane(p[0], p[1], p[2], p[3], p[4]);
    const Rational3 exact =
        on_plane(rational(p[0]), rational(p[1]), rational(p[2]), rational(p[3]), rational(p[4]));
    const Double3 near = table.grid().rounded(made);
    for (std::size_t k = 0; k < 3; ++k) {
      const Rational off = abs(Rational(near[k]) - exact[k]);
      CHECK(off <= abs(Rational(std::nextafter(near[k], 1e300)) - exact[k]));
      CHECK(off <= abs(Rational(std::nextafter(near[k], -1e300)) - exact[k]));
    }
  }
}

TEST_CASE("exact point: signs of points that were made are those of rational numbers", "[unit]") {
  test::Random random(6);
  int zeros = 0;
  for (int round = 0; round < 60; ++round) {
    const Double3 by = round % 2 == 0 ? Double3{691600, 5334700, 500} : Double3{0, 0, 0};
    // Edges through one plane: what they make lies in it.
    std::vector<Double3> given = {random_point(random, 1.0, by), random_point(random, 1.0, by),
                                  random_point(random, 1.0, by)};
    if (collinear(given[0], given[1], given[2])) continue;
    for (int i = 0; i < 16; ++i) given.push_back(random_point(random, 1.0, by));
    PointTable table(given);
    std::vector<Rational3> exact;
    for (const Double3& p : given) exact.push_back(rational(p));
    for (std::uint32_t i = 3; i + 1 < 19; ++i) {
      if (table.orient3d(0, 1, 2, i) * table.orient3d(0, 1, 2, i + 1) >= 0) continue;
      table.add(table.grid().on_plane(given[i], given[i + 1], given[0], given[1], given[2]));
      exact.push_back(on_plane(exact[i], exact[i + 1], exact[0], exact[1], exact[2]));
    }
    const auto pick = [&] { return static_cast<std::uint32_t>(random.below(table.size())); };
    for (int i = 0; i < 200; ++i) {
      const std::uint32_t a = pick(), b = pick(), c = pick(), d = pick();
      const Rational3 p = minus(exact[b], exact[a]), q = minus(exact[c], exact[a]),
                      r = minus(exact[d], exact[a]);
      const int wanted = sign_of(triple(p, q, r));
      zeros += wanted == 0 && a != b && b != c && c != d;
      CHECK(table.orient3d(a, b, c, d) == wanted);
      CHECK(table.orient2d(a, b, c, 0, 1) == sign_of(p[0] * q[1] - p[1] * q[0]));
    }
  }
  CHECK(zeros > 100);
}

TEST_CASE("exact point: lines that pass each other, and the middle of three points", "[unit]") {
  PointTable table({{0, 0, 0}, {3, 3, 3}, {1, 0, 0}, {0, 1, 1}, {0, 0, 0.5}});
  const Double3 crossing =
      table.grid().rounded(table.grid().on_line(table.near(0), table.near(1), table.near(2), table.near(3)));
  // (t, t, t) = (1 - s, s, s)
  CHECK(crossing == Double3{0.5, 0.5, 0.5});
  const std::uint32_t middle = table.add_middle(0, 1, 4);
  CHECK(table.near(middle) == Double3{1.0, 1.0, 3.5 / 3.0});
  CHECK_FALSE(table.is_given(middle));
  CHECK(table.orient3d(0, 1, 4, middle) == 0);
}

}  // namespace tessera::exact_point_test
