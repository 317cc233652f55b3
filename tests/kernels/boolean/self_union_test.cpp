// Closed surfaces that pass through themselves become the boundary of what they hold: boxes of a small grid in every way, a tube
// that runs through itself, faces through one point; what is off the cuts keeps its numbers.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <set>

#include "kernels/boolean/exact_boolean.h"
#include "kernels/boolean/exact_winding.h"
#include "kernels/boolean/self_cuts.h"
#include "kernels/boolean/self_union.h"
#include "kernels/boolean/solid_fans.h"
#include "kernels/mesh/block_contacts.h"
#include "octree/edge_faces.h"
#include "tests/helpers/box_solid.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/random.h"

namespace tessera::self_union_test {
namespace {

using test::Random;

void add(SolidMesh& to, const SolidMesh& m) {
  const auto first = static_cast<std::uint32_t>(to.points.size());
  to.points.insert(to.points.end(), m.points.begin(), m.points.end());
  for (const auto& f : m.faces) to.faces.push_back({first + f[0], first + f[1], first + f[2]});
}
/// A closed tube along a curve; both may be anything.
template <class Curve>
SolidMesh tube(int along, int around, double radius, const Curve& curve) {
  SolidMesh m;
  constexpr double kPi = 3.14159265358979323846;
  for (int i = 0; i < along; ++i) {
    const Double3 p = curve(i), q = curve((i + 1) % along);
    const Double3 u = unit(q - p), side = unit(cross(u, Double3{.31, .17, 1.0})), up = cross(side, u);
    for (int k = 0; k < around; ++k) {
      const double a = 2.0 * kPi * k / around;
      m.points.push_back(p + side * (radius * std::cos(a)) + up * (radius * std::sin(a)));
    }
  }
  const auto at = [&](int i, int k) { return static_cast<std::uint32_t>((i % along) * around + k % around); };
  for (int i = 0; i < along; ++i)
    for (int k = 0; k < around; ++k) {
      m.faces.push_back({at(i, k), at(i + 1, k), at(i + 1, k + 1)});
      m.faces.push_back({at(i, k), at(i + 1, k + 1), at(i, k + 1)});
    }
  return m;
}
double volume(const SolidMesh& m) {
  double sum = 0.0;
  for (const auto& f : m.faces) sum += dot(m.points[f[0]], cross(m.points[f[1]], m.points[f[2]]));
  return sum / 6.0;
}
SolidMesh turned_over(SolidMesh m) {
  for (auto& f : m.faces) std::swap(f[1], f[2]);
  return m;
}

SolidMesh result_of(const SolidMesh& mesh, const SelfUnion& made) {
  SolidMesh out;
  out.points = mesh.points;
  out.points.insert(out.points.end(), made.fresh.begin(), made.fresh.end());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    if (!made.gone[f]) out.faces.push_back(mesh.faces[f]);
  for (const SelfUnion::Face& f : made.made) out.faces.push_back(f.corner);
  return out;
}
/// Pairs that meet, vertices at one position being one.
std::size_t contacts(const SolidMesh& mesh) {
  const SolidMesh m = canonical_solid(mesh);
  std::vector<ContactFace> faces;
  for (const auto& f : m.faces)
    faces.push_back({{m.points[f[0]], m.points[f[1]], m.points[f[2]]}, {f[0], f[1], f[2]}});
  std::size_t n = 0;
  block_contacts(faces, kAllSpace, [&](std::uint32_t, std::uint32_t, FaceContact) { ++n; });
  return n;
}
bool every_edge_has_two_faces(const SolidMesh& m) {
  bool two = true;
  EdgeFaces(m.points.size(), m.faces)
      .for_each([&](std::uint32_t low, std::uint32_t, std::span<const std::uint32_t> half) {
        two = two && half.size() == 2 &&
              (m.faces[half[0] / 3][half[0] % 3] == low) != (m.faces[half[1] / 3][half[1] % 3] == low);
      });
  return two;
}
/// Points by chance are in the result where they were in the mesh, once or more often; nothing meets.
void check_union(const SolidMesh& mesh, const SelfUnion& made, Random& random) {
  REQUIRE(made.fault.value_or("") == "");
  const SolidMesh out = result_of(mesh, made);
  CHECK(contacts(out) == 0);
  CHECK(every_edge_has_two_faces(out));
  Double3 low = mesh.points[0], high = low;
  for (const Double3& p : mesh.points)
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  std::vector<Double3> asked;
  for (int i = 0; i < 100; ++i)
    asked.push_back({random.in(low[0], high[0]), random.in(low[1], high[1]), random.in(low[2], high[2])});
  const auto windings = [&](const SolidMesh& m) {
    std::vector<Double3> points = m.points;
    points.insert(points.end(), asked.begin(), asked.end());
    const PointTable table(points);
    const ExactWinding winding(table, m.faces);
    std::vector<int> w;
    for (std::size_t i = 0; i < asked.size(); ++i)
      w.push_back(winding.at(static_cast<std::uint32_t>(m.points.size() + i)));
    return w;
  };
  const std::vector<int> before = windings(mesh), after = windings(out);
  for (std::size_t i = 0; i < before.size(); ++i) CHECK((before[i] > 0) == (after[i] > 0));
}

}  // namespace

TEST_CASE("self union: boxes of a grid in one mesh, and as two that exact booleans unite", "[unit]") {
  Random random(5);
  std::size_t coplanar = 0, united = 0, refused = 0;
  for (int round = 0; round < 250; ++round) {
    const std::uint64_t boxes = 2 + random.below(5);
    SolidMesh mesh;
    std::vector<SolidMesh> each;
    for (std::uint64_t b = 0; b < boxes; ++b) {
      Double3 low, high;
      for (std::size_t k = 0; k < 3; ++k) {
        const double p = static_cast<double>(random.below(5)),
                     q = std::fmod(p + 1.0 + static_cast<double>(random.below(4)), 5.0);
        low[k] = std::min(p, q), high[k] = std::max(p, q);
      }
      each.push_back(test::box_solid(low, high));
      add(mesh, each.back());
    }
    const SelfUnion made = unite_self(mesh, PositionStep::kDouble);
    if (made.fault) {
      const bool is_inside = made.fault->find("the same way round") != std::string::npos;
      CHECK((is_inside || made.fault->find("along an edge") != std::string::npos));
      ++refused;
      continue;
    }
    check_union(mesh, made, random);
    coplanar += made.stats.coplanar_pairs > 0;
    united += made.stats.pairs > 0;
    if (boxes > 2 || made.stats.pairs == 0) continue;
    const BooleanResult both =
        exact_boolean(canonical_solid(each[0]), canonical_solid(each[1]), BooleanJoin::kUnite);
    CHECK(volume(result_of(mesh, made)) == Approx(volume(both.mesh)));
  }
  CHECK(coplanar > 50);
  CHECK(united > 150);
  CHECK(refused < 20);
}

TEST_CASE("self union: boxes turned by chance, with three faces through a point", "[unit]") {
  Random random(8);
  for (int round = 0; round < 25; ++round) {
    SolidMesh mesh;
    for (int b = 0; b < 6; ++b) {
      SolidMesh one = test::box_solid({-1, -1, -1}, {1, 1, 1});
      const Double3 by = {random.in(-1, 1), random.in(-1, 1), random.in(-1, 1)};
      const Double3 u = unit(Double3{random.gaussian(), random.gaussian(), random.gaussian()});
      const Double3 v = unit(cross(u, Double3{random.gaussian(), random.gaussian(), random.gaussian()}));
      const Double3 w = cross(u, v);
      for (Double3& p : one.points) p = u * p[0] + v * p[1] + w * p[2] + by;
      add(mesh, one);
    }
    check_union(mesh, unite_self(mesh, round % 2 == 0 ? PositionStep::kDouble : PositionStep::kFloat),
                random);
  }
}

TEST_CASE("self union: a tube that runs through itself keeps what is off the crossing", "[unit]") {
  constexpr double kPi = 3.14159265358979323846;
  Random random(3);
  // A figure of eight: its arms meet in the middle.
  const SolidMesh eight = tube(120, 12, .3, [](int i) {
    const double a = 2.0 * kPi * i / 120;
    return Double3{2.0 * std::sin(a), std::sin(2.0 * a), .1 * std::cos(a)};
  });
  REQUIRE(contacts(eight) > 20);
  const SelfUnion made = unite_self(eight, PositionStep::kDouble);
  check_union(eight, made, random);
  const SolidMesh out = result_of(eight, made);
  for (std::size_t f = 0; f < eight.faces.size(); ++f)
    if (norm(eight.points[eight.faces[f][0]]) > 1.5) CHECK(made.gone[f] == 0);
  CHECK(made.stats.inner_faces > 10);
  CHECK(made.stats.rounding.left == 0);
  CHECK(volume(out) < volume(eight));
  // Inside out it stays so.
  const SelfUnion other = unite_self(turned_over(eight), PositionStep::kDouble);
  REQUIRE(!other.fault);
  CHECK(volume(result_of(turned_over(eight), other)) == Approx(-volume(out)));
}

TEST_CASE("self union: the order of faces and vertices moves no point", "[unit]") {
  SolidMesh mesh = test::box_solid({0, 0, 0}, {3, 3, 3});
  const test::Icosphere s = test::icosphere(2);
  SolidMesh ball{s.positions, s.faces};
  for (Double3& p : ball.points) p = p * 1.3 + Double3{.2, .1, 2.9};
  add(mesh, ball);
  const auto places = [](const SolidMesh& m) {
    std::multiset<std::multiset<Double3>> all;
    for (const auto& f : m.faces) all.insert({m.points[f[0]], m.points[f[1]], m.points[f[2]]});
    return all;
  };
  const auto all = places(result_of(mesh, unite_self(mesh, PositionStep::kDouble)));
  std::reverse(mesh.faces.begin(), mesh.faces.end());
  CHECK(places(result_of(mesh, unite_self(mesh, PositionStep::kDouble))) == all);
}

TEST_CASE("self union: nothing is touched where nothing meets, and what has no inside is told", "[unit]") {
  SolidMesh apart = test::box_solid({0, 0, 0}, {1, 1, 1});
  add(apart, test::box_solid({2, 0, 0}, {3, 1, 1}));
  add(apart, test::box_solid({-1, -1, -1}, {4, 4, 4}));
  SelfUnion made = unite_self(apart, PositionStep::kDouble);
  CHECK(!made.fault);
  CHECK(made.made.empty());
  CHECK(std::count(made.gone.begin(), made.gone.end(), 1) == 0);
  SolidMesh crossing = apart;
  add(crossing, test::box_solid({.5, .5, .5}, {2.5, .75, .75}));
  made = unite_self(crossing, PositionStep::kDouble);
  CHECK(made.fault.value_or("").find("the same way round") != std::string::npos);
  SolidMesh open = test::box_solid({0, 0, 0}, {1, 1, 1});
  open.faces.pop_back();
  add(open, test::box_solid({.5, .5, .5}, {2, 2, 2}));
  made = unite_self(open, PositionStep::kDouble);
  CHECK(made.fault.value_or("").find("not closed") != std::string::npos);
  CHECK(made.gone.empty());
  // An open sheet beside bodies that cross is none of their business.
  SolidMesh beside = test::box_solid({0, 0, 0}, {1, 1, 1});
  add(beside, test::box_solid({.5, .5, .5}, {2, 2, 2}));
  SolidMesh sheet;
  sheet.points = {{5, 0, 0}, {6, 0, 0}, {5, 1, 0}};
  sheet.faces = {{0, 1, 2}};
  add(beside, sheet);
  made = unite_self(beside, PositionStep::kDouble);
  CHECK(!made.fault);
  CHECK(made.gone.back() == 0);
}

TEST_CASE("self cuts: segments pass each other in one point, whatever faces gave them", "[unit]") {
  // Three squares through the origin, along the planes of the axes.
  SolidMesh mesh;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto first = static_cast<std::uint32_t>(mesh.points.size());
    for (int c = 0; c < 4; ++c) {
      Double3 p = {0, 0, 0};
      p[(k + 1) % 3] = c & 1 ? 2 : -1, p[(k + 2) % 3] = c & 2 ? 2 : -1;
      mesh.points.push_back(p);
    }
    mesh.faces.push_back({first, first + 1, first + 3});
    mesh.faces.push_back({first, first + 3, first + 2});
  }
  std::vector<PointPair> pairs;
  for (std::uint32_t f = 0; f < 6; ++f)
    for (std::uint32_t g = f + 1; g < 6; ++g)
      if (f / 2 != g / 2) pairs.emplace_back(f, g);
  const SelfCuts cuts = find_self_cuts(mesh, pairs);
  std::set<Double3> made;
  for (auto p = static_cast<std::uint32_t>(mesh.points.size()); p < cuts.points.size(); ++p)
    CHECK(made.insert(cuts.points.near(p)).second);
  CHECK(made.count({0, 0, 0}) == 1);
  CHECK(cuts.cut.size() == 6);
}

TEST_CASE("solid fans: of four faces at an edge those with solid between them are neighbours", "[unit]") {
  // Two cubes that share an edge: around it each keeps its own two faces.
  SolidMesh mesh = test::box_solid({0, 0, 0}, {1, 1, 1});
  add(mesh, test::box_solid({1, 1, 0}, {2, 2, 1}));
  const SolidMesh m = canonical_solid(mesh);
  const PointTable points(m.points);
  SolidFans fans(points, m.faces);
  std::size_t fours = 0;
  EdgeFaces(m.points.size(), m.faces)
      .for_each([&](std::uint32_t low, std::uint32_t, std::span<const std::uint32_t> half) {
        CHECK(fans.is_balanced(half, low));
        fours += half.size() == 4;
        fans.join_around(half, low);
      });
  CHECK(fours == 1);
  std::set<std::uint32_t> vertices;
  for (std::uint32_t c = 0; c < 3 * m.faces.size(); ++c) vertices.insert(fans.vertex_of(c));
  CHECK(vertices.size() == 16);
}

}  // namespace tessera::self_union_test
