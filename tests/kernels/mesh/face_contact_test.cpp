#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <boost/multiprecision/cpp_int.hpp>

#include "kernels/mesh/face_contact.h"
#include "kernels/mesh/face_planes.h"
#include "kernels/mesh/orientation_sign.h"
#include "tests/helpers/random.h"

namespace tessera::face_contact_test {
namespace {

// The oracle: the common part of two triangles is clipped out in rational numbers.
using Rational = boost::multiprecision::cpp_rational;
using Exact3 = std::array<Rational, 3>;

Exact3 minus(const Exact3& a, const Exact3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Exact3 times(const Exact3& a, const Exact3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Rational along(const Exact3& a, const Exact3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Exact3 exact(const Double3& p) {
  return {Rational(p[0]), Rational(p[1]), Rational(p[2])};
}

/// Keeps where along(n, x - at) >= 0.
std::vector<Exact3> clipped(const std::vector<Exact3>& polygon, const Exact3& at, const Exact3& n) {
  std::vector<Exact3> out;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Exact3 &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
    const Rational s = along(n, minus(p, at)), t = along(n, minus(q, at));
    if (s >= 0) out.push_back(p);
    if ((s > 0 && t < 0) || (s < 0 && t > 0)) {
      const Rational w = s / (s - t);
      const Exact3 d = minus(q, p);
      out.push_back({p[0] + w * d[0], p[1] + w * d[1], p[2] + w * d[2]});
    }
  }
  return out;
}

struct ExactFace {
  std::array<Exact3, 3> corner;
  Exact3 normal;
  Exact3 inward(std::size_t k) const { return times(normal, minus(corner[(k + 1) % 3], corner[k])); }
  bool inside(const Exact3& p) const {
    for (std::size_t k = 0; k < 3; ++k)
      if (along(inward(k), minus(p, corner[k])) <= 0) return false;
    return true;
  }
};

ExactFace exact_face(const ContactFace& f) {
  ExactFace e{{exact(f.corner[0]), exact(f.corner[1]), exact(f.corner[2])}, {}};
  e.normal = times(minus(e.corner[1], e.corner[0]), minus(e.corner[2], e.corner[0]));
  return e;
}

FaceContact oracle(const ContactFace& one, const ContactFace& two) {
  const ExactFace a = exact_face(one), b = exact_face(two);
  std::vector<Exact3> common(a.corner.begin(), a.corner.end());
  const Exact3 down = {-b.normal[0], -b.normal[1], -b.normal[2]};
  common = clipped(clipped(common, b.corner[0], b.normal), b.corner[0], down);
  for (std::size_t k = 0; k < 3; ++k) common = clipped(common, b.corner[k], b.inward(k));
  if (common.empty()) return FaceContact::kNone;
  // The mean of its corners lies inside a face if anything of it does.
  Exact3 middle{0, 0, 0};
  for (const Exact3& p : common)
    for (std::size_t k = 0; k < 3; ++k) middle[k] += p[k] / static_cast<int>(common.size());
  if (a.inside(middle) && b.inside(middle))
    return along(times(a.normal, b.normal), times(a.normal, b.normal)) == 0 ? FaceContact::kOverlap
                                                                            : FaceContact::kCross;
  std::vector<Exact3> shared;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      if (one.vertex[i] == two.vertex[j]) shared.push_back(a.corner[i]);
  for (const Exact3& p : common) {
    if (shared.empty()) return FaceContact::kTouch;
    const Exact3 d = minus(shared.back(), shared.front()), e = minus(p, shared.front());
    const Exact3 off = times(d, e);
    const bool on = shared.size() == 1
                        ? along(e, e) == 0
                        : along(off, off) == 0 && along(d, e) >= 0 && along(d, e) <= along(d, d);
    if (!on) return FaceContact::kTouch;
  }
  return FaceContact::kNone;
}

/// Three numbers of their own.
ContactFace make_face(const std::array<Double3, 3>& corner, std::uint64_t first) {
  return {corner, {first, first + 1, first + 2}};
}
/// Most corners that coincide become shared ones.
void join(const ContactFace& a, ContactFace& b, test::Random& random) {
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      if (a.corner[i] == b.corner[j] && random.below(4) != 0) b.vertex[j] = a.vertex[i];
}

ContactFace moved(ContactFace f, const Double3& by, double scale) {
  for (Double3& p : f.corner) p = p * scale + by;
  return f;
}

TEST_CASE("face contact: random faces on a small lattice meet as in rational arithmetic", "[property]") {
  test::Random random(38);
  std::array<std::size_t, 4> seen{};
  std::array<std::array<std::size_t, 4>, 4> by_shared{};
  for (int round = 0; round < 15000; ++round) {
    const std::uint32_t size = 2 + static_cast<std::uint32_t>(round % 4);
    const auto corner = [&] {
      return Double3{static_cast<double>(random.below(size)), static_cast<double>(random.below(size)),
                     static_cast<double>(random.below(round % 3 == 0 ? 1 : size))};
    };
    ContactFace a = make_face({corner(), corner(), corner()}, 0),
                b = make_face({corner(), corner(), corner()}, 3);
    if (collinear(a.corner[0], a.corner[1], a.corner[2]) || collinear(b.corner[0], b.corner[1], b.corner[2]))
      continue;
    join(a, b, random);
    std::size_t shared = 0;
    for (const std::uint64_t v : b.vertex) shared += v < 3;
    const FaceContact truth = oracle(a, b);
    ++seen[static_cast<std::size_t>(truth)];
    ++by_shared[shared][static_cast<std::size_t>(truth)];
    INFO("round " << round);
    REQUIRE(face_contact(a, b) == truth);
    REQUIRE(face_contact(b, a) == truth);
    ContactFace turned = b;
    std::rotate(turned.corner.begin(), turned.corner.begin() + 1, turned.corner.end());
    std::rotate(turned.vertex.begin(), turned.vertex.begin() + 1, turned.vertex.end());
    REQUIRE(face_contact(a, turned) == truth);
    std::swap(turned.corner[0], turned.corner[1]);
    std::swap(turned.vertex[0], turned.vertex[1]);
    REQUIRE(face_contact(turned, a) == truth);
    // Survey coordinates: exact in doubles, and so is the answer.
    const Double3 far = {6378137.0, -4.5e6, 812.25};
    REQUIRE(face_contact(moved(a, far, 0x1p-12), moved(b, far, 0x1p-12)) == truth);
  }
  for (const std::size_t n : seen) CHECK(n > 150);
  for (std::size_t contact = 0; contact < 4; ++contact) {
    CHECK(by_shared[0][contact] > 12);
    CHECK(by_shared[1][contact] > 12);
  }
  CHECK(by_shared[2][0] > 12);
  CHECK(by_shared[2][2] > 12);
  CHECK(by_shared[3][2] > 1);
}

TEST_CASE("face contact: corners an ulp or two off planes, lines and each other", "[property]") {
  test::Random random(83);
  std::array<std::size_t, 4> seen{};
  for (int round = 0; round < 6000; ++round) {
    const auto nudge = [&](double x) {
      for (std::uint64_t steps = random.below(3); steps > 0; --steps)
        x = std::nextafter(x, random.below(2) ? std::numeric_limits<double>::infinity() : -1e300);
      return x;
    };
    const double scale = round % 2 ? 0.1 : 1.0 / 3.0, offset = round % 5 ? 0.7 : 41234.7;
    const auto corner = [&] {
      Double3 p;
      for (double& x : p) x = nudge(offset + scale * static_cast<double>(random.below(3)));
      if (round % 3 == 0) p[2] = nudge(p[0] + p[1]);
      return p;
    };
    ContactFace a = make_face({corner(), corner(), corner()}, 0),
                b = make_face({corner(), corner(), corner()}, 3);
    if (collinear(a.corner[0], a.corner[1], a.corner[2]) || collinear(b.corner[0], b.corner[1], b.corner[2]))
      continue;
    if (round % 7 < 4) b.corner[1] = a.corner[2];
    if (round % 7 < 2) b.corner[0] = a.corner[0];
    if (collinear(b.corner[0], b.corner[1], b.corner[2])) continue;
    join(a, b, random);
    const FaceContact truth = oracle(a, b);
    ++seen[static_cast<std::size_t>(truth)];
    INFO("round " << round);
    REQUIRE(face_contact(a, b) == truth);
    REQUIRE(face_contact(b, a) == truth);
  }
  CHECK(seen[0] > 300);
  CHECK(seen[1] > 30);
  CHECK(seen[3] > 300);
}

TEST_CASE("orientation: signs are those of rational arithmetic, an ulp off planes and lines", "[property]") {
  test::Random random(5);
  std::array<std::size_t, 3> seen{};
  for (int round = 0; round < 6000; ++round) {
    const double scale = std::ldexp(1.0, static_cast<int>(random.below(60)) - 30);
    std::array<Double3, 4> p;
    for (Double3& q : p) {
      for (std::size_t k = 0; k < 3; ++k) q[k] = scale * (0.1 + 0.1 * static_cast<double>(random.below(4)));
      if (round % 2) q[2] = q[0] + q[1];
      if (round % 3 == 0) q[1] *= 0x1p-40;  // no common unit within 62 bits
    }
    const Exact3 a = exact(p[0]), u = minus(exact(p[1]), a), v = minus(exact(p[2]), a),
                 w = minus(exact(p[3]), a);
    const Rational six = along(times(u, v), w), twice = u[0] * v[1] - u[1] * v[0];
    const int sign = six > 0 ? 1 : six < 0 ? -1 : 0;
    ++seen[static_cast<std::size_t>(sign + 1)];
    REQUIRE(orient3d_sign(p[0], p[1], p[2], p[3]) == sign);
    REQUIRE(orient2d_sign({p[0][0], p[0][1]}, {p[1][0], p[1][1]}, {p[2][0], p[2][1]}) == (twice > 0   ? 1
                                                                                          : twice < 0 ? -1
                                                                                                      : 0));
  }
  for (const std::size_t n : seen) CHECK(n > 300);
}

TEST_CASE("face planes: what they set apart meets in shared corners alone, and most that does is set apart",
          "[property]") {
  test::Random random(29);
  std::size_t apart = 0, beyond = 0;
  for (int round = 0; round < 3000; ++round) {
    const double scale = round % 2 ? 0.1 : 1.0, offset = round % 5 ? 0.0 : 41234.7;
    const auto corner = [&] {
      Double3 p;
      for (double& x : p) x = offset + scale * static_cast<double>(random.below(5));
      return p;
    };
    const auto face = [&](std::uint64_t first) {
      ContactFace f;
      do f = make_face({corner(), corner(), corner()}, first);
      while (collinear(f.corner[0], f.corner[1], f.corner[2]));
      return f;
    };
    const ContactFace other = face(0);
    std::vector<ContactFace> faces;
    FacePlanes planes;
    for (std::size_t i = 0; i < 1 + random.below(FacePlanes::kLanes); ++i) {
      ContactFace f = face(3 * i + 3);
      const std::uint64_t shared = random.below(4);  // three: the same face
      for (std::size_t k = 0; k < shared; ++k) f.corner[k] = other.corner[k], f.vertex[k] = other.vertex[k];
      if (collinear(f.corner[0], f.corner[1], f.corner[2])) continue;
      planes.add(f);
      faces.push_back(f);
    }
    const unsigned bits = planes.apart(other);
    REQUIRE(bits >> faces.size() == 0);
    for (std::size_t i = 0; i < faces.size(); ++i) {
      bool side = false;
      int sum = 0, corners = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        if (std::count(faces[i].vertex.begin(), faces[i].vertex.end(), other.vertex[k]) != 0) continue;
        ++corners;
        sum += orient3d_sign(faces[i].corner[0], faces[i].corner[1], faces[i].corner[2], other.corner[k]);
      }
      side = corners > 0 && std::abs(sum) == corners;
      beyond += side;
      apart += bits >> i & 1u;
      if ((bits >> i & 1u) == 0) continue;
      REQUIRE(side);
      REQUIRE(face_contact(faces[i], other) == FaceContact::kNone);
    }
  }
  CHECK(apart > beyond - beyond / 50);
  CHECK(beyond > 3000);
}

}  // namespace
}  // namespace tessera::face_contact_test
