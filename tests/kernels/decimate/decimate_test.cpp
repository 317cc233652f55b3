// The decimation kernel on tiny meshes, named by what must not happen, and its promises on larger ones.
#include "kernels/decimate/decimate.h"

#include <malloc.h>

#include <catch2/catch.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <new>
#include <set>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/mesh/closest_face.h"
#include "octree/error.h"
#include "octree/portable_math.h"
#include "octree/vector.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/mesh_checks.h"

namespace {

std::size_t allocated = 0, peak_allocated = 0;

}  // namespace

// Counts what the kernel holds at a time. The compiler cannot see that new and delete here belong together.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
void* operator new(std::size_t bytes) {
  void* p = std::malloc(bytes > 0 ? bytes : 1);
  if (!p) throw std::bad_alloc();
  allocated += ::malloc_usable_size(p);
  peak_allocated = std::max(peak_allocated, allocated);
  return p;
}
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  void* p = std::aligned_alloc(static_cast<std::size_t>(alignment), (bytes + 63) / 64 * 64);
  if (!p) throw std::bad_alloc();
  allocated += ::malloc_usable_size(p);
  peak_allocated = std::max(peak_allocated, allocated);
  return p;
}
void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept {
  void* p = std::malloc(bytes > 0 ? bytes : 1);
  if (p) allocated += ::malloc_usable_size(p);
  return p;
}
void operator delete(void* p) noexcept {
  allocated -= ::malloc_usable_size(p);
  std::free(p);
}
void operator delete(void* p, std::size_t) noexcept {
  operator delete(p);
}
void operator delete(void* p, std::align_val_t) noexcept {
  operator delete(p);
}
void operator delete(void* p, std::size_t, std::align_val_t) noexcept {
  operator delete(p);
}

namespace decimate_test {

namespace {

using namespace tessera;
using namespace tessera::test;

DecimateOptions within(double tolerance) {
  DecimateOptions o;
  o.tolerance = tolerance;
  return o;
}

MeshChecks checks(const MeshBlock& b) {
  IndexedMesh mesh;
  mesh.position = b.position;
  mesh.faces = b.faces;
  return check_mesh(mesh);
}

/// Largest distance from dense samples of a to the surface b.
double sampled_distance(const MeshBlock& a, const MeshBlock& b) {
  const Double3 origin = b.position[0];
  const ClosestFaces closest(b.position, b.faces, origin);
  double worst = 0.0;
  for (const auto& t : a.faces)
    for (int i = 0; i <= 8; ++i)
      for (int j = 0; i + j <= 8; ++j) {
        Double3 p;
        for (std::size_t x = 0; x < 3; ++x)
          p[x] = (a.position[t[0]][x] * i + a.position[t[1]][x] * j + a.position[t[2]][x] * (8 - i - j)) / 8 -
                 origin[x];
        worst = std::max(worst, closest.closest(p, 1e300, ClosestFaces::kNone).square);
      }
  return std::sqrt(worst);
}

/// Every border edge must be flagged and every flag be a border.
void require_flags(const MeshBlock& b) {
  const MeshBlock again = make_block(b.position, b.faces);
  std::vector<std::uint8_t> flags = b.face_flags;
  for (std::uint8_t& f : flags) f = static_cast<std::uint8_t>(f & ~unsigned{kFaceDone});
  CHECK(again.face_flags == flags);
}

/// A sphere of radius 1 with waves of height `bump` on it.
MeshBlock bumpy_sphere(int levels, double bump) {
  MeshBlock b = sphere_block(levels);
  for (Double3& q : b.position) {
    const double scale = 1.0 + bump * std::sin(7.0 * q[0]) * std::sin(5.0 * q[1] + 2.0 * q[2]);
    q = q * scale;
  }
  return b;
}

}  // namespace

TEST_CASE("decimate: a plane becomes two triangles, its four corners stay", "[unit]") {
  MeshBlock b = grid_block(12, 12, [](double, double) { return 3.0; });
  const DecimateReport r = decimate(b, b, within(0.01));
  CHECK(r.faces_in == 288);
  CHECK(r.faces_out == 2);
  CHECK(b.key == std::vector<std::uint64_t>{7, 127, 1567, 1687});
  CHECK(r.bound < 1e-6);
  require_flags(b);
}

TEST_CASE("decimate: link condition, a tetrahedron stays", "[unit]") {
  MeshBlock b =
      make_block({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}});
  const DecimateReport r = decimate(b, b, within(100.0));
  CHECK(r.collapses == 0);
  CHECK(b.faces.size() == 4);
}

TEST_CASE("decimate: link condition, a ring of three prisms keeps its hole", "[unit]") {
  // A torus of 3 x 3 vertices has no edge that may go: each would join vertices along a loop of three.
  std::vector<Double3> p;
  std::vector<std::array<std::uint32_t, 3>> f;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const double a = 2.0943951 * i, c = 2.0943951 * j, ring = 3.0 + std::cos(c);
      p.push_back({ring * std::cos(a), ring * std::sin(a), std::sin(c)});
      const auto at = [](int x, int y) { return static_cast<std::uint32_t>(x % 3 * 3 + y % 3); };
      f.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      f.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  MeshBlock b = make_block(p, f);
  const DecimateReport r = decimate(b, b, within(100.0));
  CHECK(r.collapses == 0);
  CHECK(checks(b).euler == 0);
}

TEST_CASE("decimate: flip, a vertex below a notch of its rim stays", "[unit]") {
  // Vertex 0 sees the whole rim, a saw blade of four teeth; no rim vertex does. Their class holds the others.
  std::vector<Double3> p = {{0, 0, 0}};
  std::vector<std::array<std::uint32_t, 3>> f;
  for (std::uint32_t i = 0; i < 8; ++i) {
    const double radius = i % 2 == 0 ? 4.0 : 0.5, angle = 0.78539816 * i + (i % 2 == 0 ? 0.0 : 0.61);
    p.push_back({radius * std::cos(angle), radius * std::sin(angle), 0.0});
    f.push_back({0, i + 1, (i + 1) % 8 + 1});
  }
  MeshBlock b = make_block(p, f);
  for (std::size_t v = 1; v < 9; ++v) b.vertex_class[v] = VertexClass::kCorner;
  const DecimateReport r = decimate(b, b, within(1000.0));
  CHECK(r.collapses == 0);
  CHECK(r.by_fold == 8);
}

TEST_CASE("decimate: border, the outline of a wave stays within tolerance and the hole open", "[unit]") {
  MeshBlock b = grid_block(24, 24, [](double x, double y) { return 0.05 * x * y * 0.1; });
  // A hole in the middle.
  std::vector<std::array<std::uint32_t, 3>> kept;
  for (const auto& t : b.faces) {
    const Double3& q = b.position[t[0]];
    if (std::fabs(q[0] - 12) > 4 || std::fabs(q[1] - 12) > 4) kept.push_back(t);
  }
  b = make_block(b.position, kept);
  const MeshBlock original = b;
  const DecimateReport r = decimate(b, b, within(0.2));
  const MeshChecks c = checks(b);
  CHECK(c.boundary_loops == 2);
  CHECK(c.defects() == 0);
  CHECK(r.faces_out < r.faces_in / 8);
  CHECK(sampled_distance(b, original) <= 0.2);
  CHECK(sampled_distance(original, b) <= 0.2);
  require_flags(b);
}

TEST_CASE("decimate: crease and corner, a cube ends as twelve triangles", "[unit]") {
  MeshBlock b = cube_block(8);
  DecimateOptions o = within(0.06);
  o.feature_angle_deg = 30.0;
  const DecimateReport r = decimate(b, b, o);
  CHECK(r.faces_out == 12);
  CHECK(r.bound < 1e-6);
  std::set<Double3> corners(b.position.begin(), b.position.end());
  for (const double x : {0.0, 1.0})
    for (const double y : {0.0, 1.0})
      for (const double z : {0.0, 1.0}) CHECK(corners.count({x, y, z}) == 1);
}

TEST_CASE("decimate: crease vertices leave along the crease only", "[unit]") {
  // A roof whose ridge is marked by class: slack enough to flatten it, but the ridge may only lose vertices.
  MeshBlock b = grid_block(8, 8, [](double x, double) { return 0.4 * std::fabs(x - 4.0); });
  for (std::size_t v = 0; v < b.key.size(); ++v)
    if (b.position[v][0] == 4.0) b.vertex_class[v] = VertexClass::kCrease;
  decimate(b, b, within(1.0));
  std::size_t on_ridge = 0;
  for (const Double3& q : b.position) on_ridge += q[0] == 4.0;
  CHECK(on_ridge == 2);  // its ends, where it meets the border
}

TEST_CASE("decimate: locked seam, vertices without a full star keep every bit", "[unit]") {
  MeshBlock whole = grid_block(16, 16, [](double x, double y) { return 0.01 * x * y + 1.0 / 3.0; });
  MeshBlock half = piece_of(whole, [&](std::uint32_t v) { return whole.position[v][0] <= 8.0; });
  const DecimateReport r = decimate(half, whole, within(0.3));
  CHECK(r.locked_vertices == 17);
  CHECK(r.faces_out < 80);
  std::size_t on_seam = 0;
  for (std::size_t v = 0; v < half.key.size(); ++v)
    if (half.position[v][0] == 8.0) {
      const auto at = static_cast<std::size_t>(half.key[v] / 10);
      CHECK(half.position[v] == whole.position[at]);
      ++on_seam;
    }
  CHECK(on_seam == 17);
  // Seam edges are those of before: one face in the block and no flag.
  std::size_t open = 0;
  const MeshBlock flagged = make_block(half.position, half.faces);
  for (std::size_t f = 0; f < half.faces.size(); ++f)
    open += static_cast<std::size_t>(
        std::popcount(static_cast<unsigned>(flagged.face_flags[f] ^ half.face_flags[f])));
  CHECK(open == 16);
}

TEST_CASE("decimate: the bound holds both ways and the mesh stays closed, in passes too", "[property]") {
  const MeshBlock original = bumpy_sphere(4, 0.15);
  std::map<double, std::size_t> maximum = {{0.003, 2000}, {0.01, 1250}, {0.05, 250}, {0.3, 60}};  // of 2048
  for (const double tolerance : {0.003, 0.01, 0.05, 0.3}) {
    MeshBlock b = original;
    for (int pass = 0; pass < 2; ++pass) {
      const DecimateReport r = decimate(b, original, within(tolerance));
      INFO("tolerance " << tolerance << ", pass " << pass << ", faces " << r.faces_out);
      CHECK(r.bound <= tolerance);
      CHECK(sampled_distance(b, original) <= r.bound);
      CHECK(sampled_distance(original, b) <= r.bound);
      const MeshChecks c = checks(b);
      CHECK(c.defects() == 0);
      CHECK(c.boundary_edges == 0);
      CHECK(c.euler == 2);
    }
    CHECK(b.faces.size() < maximum[tolerance]);
  }
}

TEST_CASE("decimate: a cost class stands for a face count", "[property]") {
  const MeshBlock original = bumpy_sphere(5, 0.1);
  MeshBlock b = original;
  const DecimateReport all = decimate(b, original, DecimateOptions{});
  for (const std::uint64_t target : {3000u, 1500u, 500u}) {
    DecimateOptions o;
    o.max_cost_class = cost_class_for(all.cost_histogram, all.faces_in, target);
    b = original;
    const DecimateReport r = decimate(b, original, o);
    CHECK(r.stop == DecimateStop::kCostLimit);
    CHECK(r.faces_out <= target);
    CHECK(static_cast<double>(r.faces_out) > 0.9 * static_cast<double>(target));
  }
}

TEST_CASE("decimate: degenerate input ends in a result or a clear error", "[unit]") {
  MeshBlock empty;
  CHECK(decimate(empty, empty, within(1.0)).faces_out == 0);

  MeshBlock one = make_block({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  CHECK(decimate(one, one, within(10.0)).faces_out == 1);

  // Faces without area among good ones go, or stay; nothing folds.
  MeshBlock flat = grid_block(6, 6, [](double, double) { return 0.0; });
  for (std::size_t v = 0; v < flat.key.size(); ++v)
    if (flat.position[v][0] == 3.0) flat.position[v][0] = 2.0;
  const MeshBlock flat_before = flat;
  decimate(flat, flat, within(0.01));
  CHECK(flat.faces.size() < 8);
  CHECK(sampled_distance(flat_before, flat) <= 0.01);

  MeshBlock coincident = grid_block(4, 4, [](double, double) { return 0.0; });
  for (Double3& q : coincident.position) q = {1, 1, 1};
  CHECK_NOTHROW(decimate(coincident, coincident, within(1.0)));

  MeshBlock fin =
      make_block({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}}, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}});
  CHECK_THROWS_AS(decimate(fin, fin, within(1.0)), InputError);

  MeshBlock nan = one;
  nan.position[1][2] = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(decimate(nan, nan, within(1.0)), InputError);

  MeshBlock twins = grid_block(2, 2, [](double, double) { return 0.0; });
  twins.key[3] = twins.key[4];
  CHECK_THROWS_AS(decimate(twins, twins, within(1.0)), InputError);

  CHECK_THROWS_AS(decimate(one, one, within(-1.0)), UsageError);
  CHECK_THROWS_AS(decimate(one, one, within(std::numeric_limits<double>::quiet_NaN())), UsageError);
}

TEST_CASE("decimate: every priority and placement keeps the bound and the topology", "[property]") {
  const MeshBlock original = bumpy_sphere(4, 0.1);
  for (const auto priority :
       {DecimatePriority::kQuadric, DecimatePriority::kProbabilistic, DecimatePriority::kSampleDistance,
        DecimatePriority::kNormalDeviation, DecimatePriority::kMeanRatio, DecimatePriority::kEdgeLength})
    for (const auto placement : {DecimatePlacement::kEndpoint, DecimatePlacement::kOptimal}) {
      DecimateOptions o = within(0.02);
      o.priority = priority;
      o.placement = placement;
      MeshBlock b = original;
      for (int pass = 0; pass < 2; ++pass) {
        const DecimateReport r = decimate(b, original, o);
        INFO("priority " << static_cast<int>(priority) << ", placement " << static_cast<int>(placement));
        CHECK(r.faces_out < 900);
        CHECK(r.bound <= 0.02);
        CHECK(sampled_distance(b, original) <= r.bound);
        CHECK(sampled_distance(original, b) <= r.bound);
        CHECK(checks(b).defects() == 0);
        CHECK(checks(b).euler == 2);
        for (const Double3& q : b.position)
          for (const double c : q)
            if (placement == DecimatePlacement::kEndpoint) {
              CHECK(std::find(original.position.begin(), original.position.end(), q) !=
                    original.position.end());
              break;
            } else {
              CHECK((std::find(original.position.begin(), original.position.end(), q) !=
                         original.position.end() ||
                     static_cast<double>(static_cast<float>(c)) == c));
            }
      }
    }
}

TEST_CASE("decimate: normals turn no more than asked", "[property]") {
  const MeshBlock original = bumpy_sphere(5, 0.1);
  std::size_t free_faces = 0;
  for (const double degrees : {0.0, 20.0, 8.0}) {
    DecimateOptions o = within(0.03);
    o.max_normal_deviation_deg = degrees;
    MeshBlock b = original;
    const DecimateReport r = decimate(b, original, o);
    if (degrees == 0.0) {
      free_faces = r.faces_out;
      continue;
    }
    CHECK(r.faces_out > free_faces);
    CHECK(r.faces_out < original.faces.size() / 2);
    // The face of the result closest to the middle of an original face stands for it, or a neighbour does.
    const auto normal = [](const MeshBlock& m, std::size_t f) {
      const auto p = [&](std::size_t i) {
        const Double3& q = m.position[m.faces[f][i]];
        return Double3{q[0], q[1], q[2]};
      };
      return unit(cross(p(1) - p(0), p(2) - p(0)));
    };
    const ClosestFaces closest(b.position, b.faces, {0, 0, 0});
    const double limit = sin_cos((degrees + 1.0) * kPi / 180.0).cos;
    std::size_t exceeding = 0;
    for (std::size_t f = 0; f < original.faces.size(); ++f) {
      Double3 middle{};
      for (const std::uint32_t v : original.faces[f])
        for (std::size_t a = 0; a < 3; ++a) middle[a] += original.position[v][a] / 3.0;
      const std::uint32_t at = closest.face(closest.closest(middle, 1e300, ClosestFaces::kNone).slot);
      exceeding += dot(normal(original, f), normal(b, at)) < limit;
    }
    CHECK(exceeding == 0);
  }
}

TEST_CASE("decimate: the normal of a sliver that noise turns is not asked, that of a thin strip is",
          "[unit]") {
  DecimateOptions o = within(0.06);
  o.max_normal_deviation_deg = 3.0;
  // In a plane, pairs of vertices that nearly meet, one of them a little above: the faces between turn by 31 degrees.
  MeshBlock plane = grid_block(20, 20, [](double, double) { return 0.0; });
  for (Double3& q : plane.position)
    if (std::fmod(q[0], 4.0) == 2.0 && std::fmod(q[1], 4.0) == 2.0) q = {q[0] + 0.98, q[1], 0.012};
  const MeshBlock original = plane;
  decimate(plane, original, o);
  CHECK(plane.faces.size() < 40);
  // Facets of a cylinder, as design programs write them: ten degrees from one to the next, however thin.
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (std::uint32_t i = 0; i < 36; ++i) {
    const SinCos angle = sin_cos(i * kPi / 18.0);
    for (const double z : {0.0, 10.0}) position.push_back({angle.cos, angle.sin, z});
    const std::uint32_t at = 2 * i, next = 2 * ((i + 1) % 36);
    faces.push_back({at, next, next + 1});
    faces.push_back({at, next + 1, at + 1});
  }
  o.tolerance = 0.5;
  MeshBlock cylinder = make_block(position, faces);
  const MeshBlock before = cylinder;
  decimate(cylinder, before, o);
  CHECK(cylinder.faces.size() == 72);
  o.max_normal_deviation_deg = 0.0;
  cylinder = before;
  decimate(cylinder, before, o);
  CHECK(cylinder.faces.size() < 72);
}

TEST_CASE("decimate: a colour edge in a plane is kept when colour counts", "[unit]") {
  MeshBlock b = grid_block(20, 20, [](double, double) { return 0.0; });
  for (const Double3& q : b.position) b.rgba.push_back(q[0] + q[1] < 17.0 ? 0xff0000ffu : 0xffff0000u);
  DecimateOptions o;
  o.colour_weight = 1.0;
  o.max_cost_class = 2047;
  const MeshBlock original = b;
  // The class below which flat pieces of one colour vanish, but no vertex at the edge of colours.
  const DecimateReport all = decimate(b, original, o);
  o.max_cost_class = cost_class_for(all.cost_histogram, all.faces_in, 200);
  b = original;
  decimate(b, original, o);
  double worst = 0.0;  // distance of a face of two colours from the edge
  for (const auto& t : b.faces)
    for (const std::uint32_t v : t)
      if (b.rgba[v] != b.rgba[t[0]])
        worst = std::max(worst, std::fabs(b.position[v][0] + b.position[v][1] - 17.0));
  CHECK(worst <= 3.0);
  CHECK(b.rgba.size() == b.key.size());
}

TEST_CASE("decimate: seams that one pass locks are freed in the next, and blocks may run in any order",
          "[property]") {
  const MeshBlock whole =
      grid_block(32, 32, [](double x, double y) { return std::sin(0.2 * x) * std::cos(0.15 * y); });
  const auto column = [&](const MeshBlock& m, std::size_t f) {
    double x = 0.0;
    for (const std::uint32_t v : m.faces[f]) x += m.position[v][0] / 3.0;
    return x;
  };
  const double tolerance = 0.05;
  // Faces whose middle lies in [from, to) of a mesh whose borders are flagged.
  const auto cut = [&](const MeshBlock& m, double from, double to) {
    MeshBlock part;
    part.key = m.key, part.position = m.position, part.vertex_class = m.vertex_class;
    for (std::size_t f = 0; f < m.faces.size(); ++f)
      if (column(m, f) >= from && column(m, f) < to) {
        part.faces.push_back(m.faces[f]);
        part.face_flags.push_back(m.face_flags[f]);
        part.face_bound.push_back(m.face_bound.empty() ? 0.0f : m.face_bound[f]);
      }
    return part;
  };
  const auto join = [&](const std::vector<MeshBlock>& parts) {
    MeshBlock m;
    std::map<std::uint64_t, std::uint32_t> index;
    for (const MeshBlock& p : parts)
      for (std::size_t v = 0; v < p.key.size(); ++v)
        if (index.emplace(p.key[v], static_cast<std::uint32_t>(m.key.size())).second) {
          m.key.push_back(p.key[v]);
          m.position.push_back(p.position[v]);
          m.vertex_class.push_back(p.vertex_class[v]);
        } else {
          CHECK(m.position[index[p.key[v]]] == p.position[v]);
        }
    for (const MeshBlock& p : parts)
      for (std::size_t f = 0; f < p.faces.size(); ++f) {
        m.faces.push_back(
            {index[p.key[p.faces[f][0]]], index[p.key[p.faces[f][1]]], index[p.key[p.faces[f][2]]]});
        m.face_flags.push_back(p.face_flags[f]);
        m.face_bound.push_back(p.face_bound[f]);
      }
    return m;
  };
  const auto on_seam = [](const MeshBlock& m, double x) {
    return std::count_if(m.position.begin(), m.position.end(), [&](const Double3& q) { return q[0] == x; });
  };
  MeshBlock left = cut(whole, 0, 16), right = cut(whole, 16, 32);
  decimate(right, whole, within(tolerance));
  decimate(left, whole, within(tolerance));
  MeshBlock one = join({left, right});
  CHECK(on_seam(one, 16.0) == 33);
  MeshBlock a = cut(one, 0, 8), b = cut(one, 8, 24), c = cut(one, 24, 32);
  for (MeshBlock* m : {&b, &a, &c}) decimate(*m, whole, within(tolerance));
  const MeshBlock two = join({a, b, c});
  CHECK(on_seam(two, 16.0) < 12);
  CHECK(two.faces.size() < one.faces.size());
  CHECK(sampled_distance(two, whole) <= tolerance);
  CHECK(sampled_distance(whole, two) <= tolerance);
  CHECK(checks(two).defects() == 0);
  CHECK(checks(two).boundary_loops == 1);
}

TEST_CASE("decimate: memory stays below what was promised", "[memory]") {
  const MeshBlock original = sphere_block(7);  // 131,072 faces
  MeshBlock coarse = original;
  decimate(coarse, coarse, within(0.001));
  const auto check = [&](const MeshBlock& block, bool apart) {
    MeshBlock b = block;
    DecimateOptions o = within(0.001);
    o.feature_angle_deg = 30.0;
    const std::size_t before = allocated;
    peak_allocated = allocated;
    decimate(b, apart ? original : b, o);
    const std::size_t used = peak_allocated - before;
    const std::size_t promised = decimate_bytes(block.faces.size(), apart ? original.faces.size() : 0);
    INFO(block.faces.size() << " faces, " << apart << ": used " << used << " of " << promised);
    CHECK(used <= promised);
    CHECK(used > promised / 2);
  };
  check(original, false);
  check(original, true);
  check(coarse, true);
}

TEST_CASE("decimate: what a pass has settled stays, another begins at what was locked", "[unit]") {
  const MeshBlock original = bumpy_sphere(4, 0.1);
  MeshBlock done = original;
  const DecimateReport first = decimate(done, original, within(0.02));
  REQUIRE(first.collapses > 100);
  for (const std::uint8_t f : done.face_flags) CHECK((f & kFaceDone) != 0);
  MeshBlock again = done;
  CHECK(decimate(again, original, within(0.02)).candidates == 0);
  CHECK(again.faces == done.faces);
  // Its own reference: a first pass, with a tolerance of its own.
  CHECK(decimate(again, again, within(0.2)).faces_out < done.faces.size() / 2);

  // Held vertices leave something to do, there alone.
  MeshBlock part = original;
  const std::vector<std::uint64_t> pinned(original.key.begin(), original.key.begin() + 40);
  const DecimateReport with_pinned = decimate(part, original, within(0.02), pinned);
  std::size_t open = 0;
  for (std::size_t f = 0; f < part.faces.size(); ++f) {
    bool at_pinned = false;
    for (const std::uint32_t v : part.faces[f])
      at_pinned = at_pinned || std::binary_search(pinned.begin(), pinned.end(), part.key[v]);
    CHECK(((part.face_flags[f] & kFaceDone) == 0) == at_pinned);
    open += at_pinned;
  }
  REQUIRE(open > 0);
  const DecimateReport rest = decimate(part, original, within(0.02));
  CHECK(rest.collapses > 0);
  CHECK(rest.candidates < with_pinned.candidates / 2);
  for (const std::uint8_t f : part.face_flags) CHECK((f & kFaceDone) != 0);
}

}  // namespace decimate_test
