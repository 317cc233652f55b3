// Solids joined by their faces: every way in which boxes of a small grid can lie to each other, turned ones, and round ones.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <set>

#include "kernels/boolean/cut_face.h"
#include "kernels/boolean/exact_boolean.h"
#include "kernels/boolean/settle_rounding.h"
#include "kernels/mesh/orientation_sign.h"
#include "tests/helpers/box_solid.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/random.h"

namespace tessera::exact_boolean_test {
namespace {

using test::Random;

SolidMesh box(const Double3& low, const Double3& high) {
  return canonical_solid(test::box_solid(low, high));
}
SolidMesh ball(int level, const Double3& by) {
  const test::Icosphere s = test::icosphere(level);
  SolidMesh m{s.positions, s.faces};
  for (Double3& p : m.points) p = p + by;
  return canonical_solid(m);
}
SolidMesh turned(SolidMesh m, double about_z, double about_x, const Double3& by) {
  for (Double3& p : m.points) {
    const double x = p[0] * std::cos(about_z) - p[1] * std::sin(about_z),
                 y = p[0] * std::sin(about_z) + p[1] * std::cos(about_z);
    p = Double3{x, y * std::cos(about_x) - p[2] * std::sin(about_x),
                y * std::sin(about_x) + p[2] * std::cos(about_x)} +
        by;
  }
  return canonical_solid(m);
}

double volume(const SolidMesh& m) {
  if (m.faces.empty()) return 0.0;
  const Double3 from = m.points[0];
  double sum = 0.0;
  for (const auto& f : m.faces)
    sum += dot(m.points[f[0]] - from, cross(m.points[f[1]] - from, m.points[f[2]] - from));
  return sum / 6.0;
}

struct AllJoins {
  BooleanResult sum, common, rest;
};
AllJoins join_all(const SolidMesh& a, const SolidMesh& b) {
  AllJoins all{exact_boolean(a, b, BooleanJoin::kUnite), exact_boolean(a, b, BooleanJoin::kIntersect),
               exact_boolean(a, b, BooleanJoin::kSubtract)};
  for (BooleanResult* r : {&all.sum, &all.common, &all.rest})
    CHECK(settle_rounding(*r, PositionStep::kDouble).left == 0);
  return all;
}
/// Results are solids, and their volumes add up.
/// \param margin  what rounding positions may do to a volume
AllJoins check_joins(const SolidMesh& a, const SolidMesh& b, double margin = 1e-13) {
  AllJoins all = join_all(a, b);
  for (const BooleanResult* r : {&all.sum, &all.common, &all.rest})
    if (!r->mesh.faces.empty()) CHECK(solid_fault(canonical_solid(r->mesh)).value_or("") == "");
  const double va = volume(a), vb = volume(b), common = volume(all.common.mesh);
  CHECK(volume(all.sum.mesh) + common == Approx(va + vb).epsilon(1e-12).margin(margin));
  CHECK(volume(all.rest.mesh) + common == Approx(va).epsilon(1e-12).margin(margin));
  return all;
}
/// Lengths that two intervals share.
double shared(const std::array<Double3, 2>& a, const std::array<Double3, 2>& b) {
  double v = 1.0;
  for (std::size_t k = 0; k < 3; ++k)
    v *= std::max(0.0, std::min(a[1][k], b[1][k]) - std::max(a[0][k], b[0][k]));
  return v;
}

}  // namespace

TEST_CASE("exact boolean: boxes of a grid share faces, edges, corners, or all", "[unit]") {
  Random random(11);
  const auto some = [&] {
    std::array<Double3, 2> b;
    for (std::size_t k = 0; k < 3; ++k) {
      const double p = static_cast<double>(random.below(4)),
                   q = std::fmod(p + 1.0 + static_cast<double>(random.below(3)), 4.0);
      b[0][k] = std::min(p, q), b[1][k] = std::max(p, q);
    }
    return b;
  };
  std::size_t coplanar = 0, split = 0;
  for (int round = 0; round < 250; ++round) {
    const auto a = some(), b = some();
    const AllJoins all = check_joins(box(a[0], a[1]), box(b[0], b[1]));
    CHECK(volume(all.common.mesh) == Approx(shared(a, b)).margin(1e-14));
    coplanar += all.sum.stats.coplanar_pairs > 0;
    split += all.sum.stats.split_vertices > 0;
  }
  CHECK(coplanar > 50);
  CHECK(split > 0);
}

TEST_CASE("exact boolean: a solid and itself", "[unit]") {
  const SolidMesh a = ball(2, {0, 0, 0});
  const AllJoins all = check_joins(a, a);
  CHECK(canonical_solid(all.sum.mesh).faces == a.faces);
  CHECK(canonical_solid(all.common.mesh).points == a.points);
  CHECK(all.rest.mesh.faces.empty());
  CHECK(all.sum.stats.made_vertices == 0);
}

TEST_CASE("exact boolean: nested, apart, and inscribed solids", "[unit]") {
  const SolidMesh cube = box({0, 0, 0}, {1, 1, 1});
  AllJoins all = check_joins(cube, box({.25, .25, .25}, {.75, .75, .75}));
  CHECK(all.rest.mesh.faces.size() == 24);
  CHECK(all.sum.mesh.faces.size() == 12);
  all = check_joins(cube, box({2, 0, 0}, {3, 1, 1}));
  CHECK(all.sum.mesh.faces.size() == 24);
  CHECK(all.common.mesh.faces.empty());
  CHECK(all.sum.stats.cut_faces == 0);
  // Every corner in the middle of a face of the cube, or on its diagonal.
  SolidMesh octahedron;
  octahedron.points = {{.5, .5, 0}, {.5, .5, 1}, {0, .5, .5}, {1, .5, .5}, {.5, 0, .5}, {.5, 1, .5}};
  octahedron.faces = {{1, 3, 5}, {1, 5, 2}, {1, 2, 4}, {1, 4, 3}, {0, 5, 3}, {0, 2, 5}, {0, 4, 2}, {0, 3, 4}};
  all = check_joins(cube, canonical_solid(octahedron));
  CHECK(all.common.mesh.faces.size() == 8);
  CHECK(volume(all.common.mesh) == Approx(1.0 / 6.0));
  // The rest touches itself at the six corners, where the surface of the cavity meets the cube's.
  CHECK(all.rest.stats.split_vertices == 6);
}

TEST_CASE("exact boolean: faces away from the cut stay as they are, the others are cut once", "[unit]") {
  const SolidMesh a = ball(4, {0, 0, 0}), b = turned(ball(4, {0, 0, 0}), .3, .2, {.5, .1, .2});
  const AllJoins all = check_joins(a, b);
  for (const BooleanResult* r : {&all.sum, &all.common, &all.rest}) {
    std::set<std::array<Double3, 3>> given;
    for (const SolidMesh* m : {&a, &b})
      for (const auto& f : m->faces) {
        std::array<Double3, 3> c = {m->points[f[0]], m->points[f[1]], m->points[f[2]]};
        std::sort(c.begin(), c.end());
        given.insert(c);
      }
    std::size_t kept = 0;
    for (const auto& f : r->mesh.faces) {
      std::array<Double3, 3> c = {r->mesh.points[f[0]], r->mesh.points[f[1]], r->mesh.points[f[2]]};
      std::sort(c.begin(), c.end());
      kept += given.contains(c);
    }
    CHECK(kept == r->stats.kept_faces);
    CHECK(r->stats.kept_faces + r->stats.made_faces == r->mesh.faces.size());
    CHECK(r->stats.kept_faces > r->stats.made_faces);
    CHECK(r->stats.made_vertices > 50);
  }
}

TEST_CASE("exact boolean: the same result whatever the order of vertices and faces", "[unit]") {
  const SolidMesh a = ball(3, {0, 0, 0});
  const SolidMesh b = turned(box({-1, -1, -.1}, {1, 1, .3}), .4, .7, {.2, 0, 0});
  SolidMesh other;
  Random random(3);
  std::vector<std::uint32_t> place(a.points.size());
  for (std::uint32_t v = 0; v < place.size(); ++v) place[v] = v;
  for (std::size_t v = place.size(); v > 1; --v) std::swap(place[v - 1], place[random.below(v)]);
  other.points.resize(a.points.size());
  for (std::uint32_t v = 0; v < place.size(); ++v) other.points[place[v]] = a.points[v];
  for (auto f = a.faces.rbegin(); f != a.faces.rend(); ++f)
    other.faces.push_back({place[(*f)[1]], place[(*f)[2]], place[(*f)[0]]});
  const BooleanResult one = exact_boolean(a, b, BooleanJoin::kSubtract),
                      two = exact_boolean(canonical_solid(other), b, BooleanJoin::kSubtract);
  CHECK(one.mesh.points == two.mesh.points);
  CHECK(one.mesh.faces == two.mesh.faces);
}

TEST_CASE("exact boolean: turned plates, needles and survey coordinates", "[unit]") {
  Random random(7);
  for (int round = 0; round < 60; ++round) {
    const double thin = round % 3 == 0 ? 1e-9 : 0.2;
    const Double3 by = round % 2 == 0 ? Double3{691600, 5334700, 500} : Double3{0, 0, 0};
    const SolidMesh plate = turned(box({-1, -1, 0}, {1, 1, thin + (by[0] > 0.0 ? 0.1 : 0.0)}),
                                   random.in(0, 3), random.in(0, 3), by);
    const SolidMesh other =
        turned(round % 4 == 0 ? box({-2, -.05, -.05}, {2, .05, .05}) : ball(1, {0, 0, 0}), random.in(0, 3),
               random.in(0, 3), by + Double3{random.in(-.5, .5), random.in(-.5, .5), random.in(-.5, .5)});
    REQUIRE(solid_fault(plate).value_or("") == "");
    check_joins(plate, other, by[0] > 0.0 ? 1e-7 : 1e-13);
  }
}

TEST_CASE("exact boolean: what is no solid is told", "[unit]") {
  const auto fault = [](SolidMesh m) { return solid_fault(canonical_solid(m)).value_or("none"); };
  SolidMesh m = box({0, 0, 0}, {1, 1, 1});
  CHECK(fault(m) == "none");
  SolidMesh open = m;
  open.faces.pop_back();
  CHECK(fault(open).find("not closed") != std::string::npos);
  SolidMesh inward = m;
  for (auto& f : inward.faces) std::swap(f[1], f[2]);
  CHECK(fault(inward).find("inward") != std::string::npos);
  const auto both = [](SolidMesh a, const SolidMesh& b) {
    const auto first = static_cast<std::uint32_t>(a.points.size());
    a.points.insert(a.points.end(), b.points.begin(), b.points.end());
    for (auto f : b.faces) a.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
    return a;
  };
  CHECK(fault(both(m, box({.5, .5, .5}, {2, 2, 2}))).find("cross") != std::string::npos);
  CHECK(fault(both(m, box({.25, .25, .25}, {.5, .5, .5}))).find("same way") != std::string::npos);
  CHECK(fault(both(m, box({2, 0, 0}, {3, 1, 1}))) == "none");
  SolidMesh cavity = box({.25, .25, .25}, {.5, .5, .5});
  for (auto& f : cavity.faces) std::swap(f[1], f[2]);
  CHECK(fault(both(m, cavity)) == "none");
  CHECK(fault({}) == "it has no faces");
}

TEST_CASE("cut face: segments become edges, and the pieces cover the face", "[unit]") {
  Random random(21);
  for (int round = 0; round < 40; ++round) {
    // A polygon around the middle, and points that nothing joins.
    std::vector<Double3> given = {{0, 0, 0}, {16, 1, 3}, {2, 16, -1}};
    std::vector<std::uint32_t> inner;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> segments;
    const auto add = [&](double a, double b) {
      inner.push_back(static_cast<std::uint32_t>(given.size()));
      // In steps of 2^-10, so that all lie in the plane exactly.
      a = std::round(a * 1024) / 1024, b = std::round(b * 1024) / 1024;
      given.push_back((given[1] - given[0]) * a + (given[2] - given[0]) * b);
    };
    const std::uint32_t corners = 3 + static_cast<std::uint32_t>(random.below(60));
    for (std::uint32_t i = 0; i < corners; ++i) {
      const double angle = 6.283185 * i / corners, r = random.in(.05, .2);
      add(.33 + r * std::cos(angle), .33 + r * std::sin(angle));
      segments.emplace_back(3 + i, 3 + (i + 1) % corners);
    }
    for (int i = 1; i < 6; ++i) add(i / 6.0, 0);
    std::set<Double3> different(given.begin(), given.end());
    if (different.size() != given.size()) continue;
    const PointTable points(given);
    const auto pieces = triangulate_cut_face(points, {0, 1, 2}, inner, segments);
    CHECK(pieces.size() == 2 * (given.size() - 8) + 1 + 5);  // those on the edge cost one triangle each
    std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
    double area = 0.0;
    const auto twice = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      return (given[b][0] - given[a][0]) * (given[c][1] - given[a][1]) -
             (given[b][1] - given[a][1]) * (given[c][0] - given[a][0]);
    };
    for (const auto& t : pieces) {
      CHECK(points.orient2d(t[0], t[1], t[2], 0, 1) == 1);
      area += twice(t[0], t[1], t[2]);
      for (std::size_t k = 0; k < 3; ++k) edges.insert(std::minmax(t[k], t[(k + 1) % 3]));
    }
    CHECK(area == Approx(twice(0, 1, 2)));
    for (const auto& s : segments) CHECK(edges.contains(std::minmax(s.first, s.second)));
    std::reverse(segments.begin(), segments.end());
    std::reverse(inner.begin(), inner.end());
    CHECK(triangulate_cut_face(points, {0, 1, 2}, inner, segments) == pieces);
  }
}

TEST_CASE("settle rounding: faces that rounding made meet are drawn apart", "[unit]") {
  // A vertex that was rounded to below a face that it stood above.
  const SolidMesh a = box({0, 0, 0}, {1, 1, 1});
  SolidMesh tip;
  tip.points = {{.5, .5, 1 - 0x1p-53}, {.25, .25, 2}, {.75, .25, 2}, {.5, .75, 2}};
  tip.faces = {{0, 2, 1}, {0, 3, 2}, {0, 1, 3}, {1, 2, 3}};
  BooleanResult both;
  both.mesh = a;
  const auto first = static_cast<std::uint32_t>(a.points.size());
  both.mesh.points.insert(both.mesh.points.end(), tip.points.begin(), tip.points.end());
  for (const auto& f : tip.faces) both.mesh.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
  both.made.assign(both.mesh.points.size(), 0);
  REQUIRE(solid_fault(canonical_solid(both.mesh)).has_value());
  SECTION("where a vertex may move") {
    both.made[first] = 1;
    const RoundingStats stats = settle_rounding(both, PositionStep::kDouble);
    CHECK(stats.met == 3);
    CHECK(stats.left == 0);
    CHECK(stats.moved == 1);
    CHECK(stats.farthest < 1e-15);
    CHECK(both.mesh.points[first][2] > 1.0);
    CHECK(solid_fault(canonical_solid(both.mesh)).value_or("") == "");
  }
  SECTION("where none may, it is told") {
    both.made[first + 3] = 1;
    const RoundingStats stats = settle_rounding(both, PositionStep::kDouble);
    CHECK(stats.left > 0);
    CHECK(stats.where.has_value());
  }
}

}  // namespace tessera::exact_boolean_test
