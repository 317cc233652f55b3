#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "octree/error.h"
#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "tests/helpers/memory_mesh.h"

namespace tessera::mesh_check_test {
namespace {

using test::MemoryMesh;

MeshCheck check(MemoryMesh mesh, std::uint64_t memory_bytes = 64u << 20, bool weld = false) {
  MeshCheckOptions options;
  options.memory_bytes = memory_bytes;
  options.weld = weld;
  return check_mesh(mesh, options);
}

TEST_CASE("check: a tetrahedron is a sound solid", "[unit]") {
  const MeshCheck c = check(test::tetrahedron());
  CHECK(c.vertices == 4);
  CHECK(c.faces == 4);
  CHECK(c.edges == 6);
  CHECK(c.boundary_edges == 0);
  CHECK(c.components == 1);
  CHECK(c.solid());
  CHECK(c.total_genus == 0);
  CHECK(c.largest_components.at(0).euler() == 2);
  CHECK(c.defects().empty());
  CHECK(c.volume == Approx(1.0 / 6));
  CHECK(c.area == Approx(1.5 + std::sqrt(3.0) / 2));
  CHECK(c.min_edge == 1.0);
  CHECK(c.max_edge == Approx(std::sqrt(2.0)));
  CHECK(c.mean_edge == Approx((1 + std::sqrt(2.0)) / 2));
  CHECK(c.min == Double3{0, 0, 0});
  CHECK(c.max == Double3{1, 1, 1});
  CHECK(std::accumulate(c.aspect_histogram.begin(), c.aspect_histogram.end(), 0u) == 4);
  CHECK(c.aspect_histogram[0] == 1);  // the equilateral one; the right-angled have 1.73
}

TEST_CASE("check: turning every face inside out makes the volume negative", "[unit]") {
  auto mesh = test::tetrahedron();
  std::vector<MeshFace> faces = mesh.faces();
  for (MeshFace& f : faces) std::swap(f[0], f[1]);
  const MeshCheck c = check({mesh.points(), faces});
  CHECK(c.solid());
  CHECK(c.volume == Approx(-1.0 / 6));
}

TEST_CASE("check: a torus has genus 1", "[unit]") {
  const MeshCheck c = check(test::torus(40, 20));
  CHECK(c.solid());
  CHECK(c.total_genus == 1);
  CHECK(c.largest_components.at(0).euler() == 0);
  CHECK(c.volume == Approx(2 * 9.8696 * 3).epsilon(0.03));
}

TEST_CASE("check: two tetrahedra that share an edge", "[unit]") {
  const MeshCheck c =
      check({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, -1, 0}, {0, 0, -1}},
             {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 4, 1}, {0, 1, 5}, {1, 4, 5}, {4, 0, 5}}});
  CHECK(c.edges == 11);
  CHECK(c.nonmanifold_edges == 1);
  CHECK(c.nonmanifold_vertices == 2);
  CHECK(c.boundary_edges == 0);
  CHECK(c.components == 1);
  CHECK(c.solid_components == 0);
}

TEST_CASE("check: two tetrahedra that share a vertex", "[unit]") {
  const MeshCheck c =
      check({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
             {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 4, 5}, {0, 6, 4}, {4, 6, 5}, {5, 6, 0}}});
  CHECK(c.nonmanifold_edges == 0);
  CHECK(c.nonmanifold_vertices == 1);
  CHECK(c.boundary_edges == 0);
  CHECK(c.inconsistent_edges == 0);
  CHECK(c.components == 1);
  CHECK_FALSE(c.solid());
}

TEST_CASE("check: a Moebius strip cannot be oriented and has one border", "[unit]") {
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  const std::uint64_t n = 7;
  for (std::uint64_t i = 0; i < n; ++i) {
    points.push_back({static_cast<double>(i), 0, 0});
    points.push_back({static_cast<double>(i), 1, static_cast<double>(i * i)});
    const std::uint64_t a = 2 * i, b = a + 1;
    const std::uint64_t c = i + 1 < n ? a + 2 : 1, d = i + 1 < n ? a + 3 : 0;
    faces.push_back({a, c, b});
    faces.push_back({b, c, d});
  }
  const MeshCheck c = check({points, faces});
  CHECK(c.inconsistent_edges == 1);
  CHECK(c.nonmanifold_edges == 0);
  CHECK(c.nonmanifold_vertices == 0);
  CHECK(c.boundary_edges == 2 * n);
  CHECK(c.boundary_loops == 1);
  CHECK(c.open_loops == 0);
  CHECK(c.largest_components.at(0).euler() == 0);
}

TEST_CASE("check: the loops of a cylinder, and of two triangles that touch in a vertex", "[unit]") {
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  for (std::uint64_t i = 0; i < 5; ++i) {
    points.push_back({static_cast<double>(i), static_cast<double>(i * i), 0});
    points.push_back({static_cast<double>(i), static_cast<double>(i * i), 1});
    const std::uint64_t a = 2 * i, b = a + 1, c = (a + 2) % 10, d = (a + 3) % 10;
    faces.push_back({a, c, b});
    faces.push_back({b, c, d});
  }
  const MeshCheck cylinder = check({points, faces});
  CHECK(cylinder.boundary_loops == 2);
  CHECK(cylinder.open_loops == 0);
  CHECK(cylinder.largest_loops == std::vector<BoundaryLoop>{{5, true}, {5, true}});

  const MeshCheck bow =
      check({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}}, {{0, 1, 2}, {0, 3, 4}}});
  CHECK(bow.boundary_loops == 2);
  CHECK(bow.open_loops == 0);
  CHECK(bow.nonmanifold_vertices == 1);
}

TEST_CASE("check: three pages of a book leave open loops at the spine", "[unit]") {
  const MeshCheck c =
      check({{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}}, {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}}});
  CHECK(c.nonmanifold_edges == 1);
  CHECK(c.boundary_edges == 6);
  CHECK(c.boundary_loops == 3);
  CHECK(c.open_loops == 3);
}

TEST_CASE("check: duplicate, degenerate, bad and non-finite elements are counted apart", "[unit]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const MeshCheck c = check({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}, {5, 5, 5}, {nan, 0, 0}, {7, 7, 7}},
                             {{0, 1, 2},     // sound
                              {2, 0, 1},     // the same again
                              {2, 1, 0},     // and reversed
                              {0, 1, 3},     // on a line
                              {0, 0, 4},     // repeats a vertex
                              {0, 1, 99},    // unknown vertex
                              {0, 1, 5}}});  // a corner at nan
  CHECK(c.faces == 7);
  CHECK(c.duplicate_faces == 2);
  CHECK(c.zero_area_faces == 1);
  CHECK(c.degenerate_faces == 1);
  CHECK(c.bad_index_faces == 1);
  CHECK(c.nonfinite_vertices == 1);
  CHECK(c.unreferenced_vertices == 1);  // the last; the fifth is named by the degenerate face
  CHECK(c.defects().size() == 8);       // and the edge of five faces and its vertices
  CHECK(c.max == Double3{7, 7, 7});
}

TEST_CASE("check: extents that cannot be summed give no shape", "[unit]") {
  CHECK_FALSE(check({{{0, 0, 0}, {1e200, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}).has_shape);
  CHECK_FALSE(check({{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 1, 2}}}).has_shape);
  CHECK_FALSE(check({{}, {}}).has_shape);
  CHECK(check({{}, {}}).components == 0);
}

TEST_CASE("check: a soup is welded by position", "[unit]") {
  const MeshCheck c = check(test::soup(test::torus(12, 8)));
  CHECK(c.welded);
  CHECK(c.file_vertices == 12 * 8 * 6);
  CHECK(c.vertices == 12 * 8);
  CHECK(c.total_genus == 1);
  CHECK(c.solid());
  const MeshCheck requested =
      check({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-0.0, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2}, {3, 4, 5}}},
            64u << 20, true);
  CHECK(requested.vertices == 4);
  CHECK(requested.boundary_edges == 4);
}

/// The same counts by the plainest means, for small meshes.
struct Plain {
  std::uint64_t edges = 0, boundary = 0, nonmanifold = 0, inconsistent = 0, components = 0, duplicates = 0;
};
Plain plain_counts(const MemoryMesh& mesh) {
  Plain p;
  std::vector<std::array<std::uint64_t, 3>> uses;  // low, high, direction
  std::vector<MeshFace> sorted;
  std::vector<std::uint64_t> label(mesh.points().size());
  std::iota(label.begin(), label.end(), 0u);
  const auto root = [&](std::uint64_t v) {
    while (label[v] != v) v = label[v];
    return v;
  };
  std::vector<bool> used(label.size(), false);
  for (MeshFace f : mesh.faces()) {
    if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0]) continue;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint64_t a = f[i], b = f[(i + 1) % 3];
      uses.push_back({std::min(a, b), std::max(a, b), a < b ? 1u : 0u});
      label[std::max(root(a), root(b))] = std::min(root(a), root(b));
      used[a] = true;
    }
    std::sort(f.begin(), f.end());
    sorted.push_back(f);
  }
  std::sort(uses.begin(), uses.end());
  for (std::size_t i = 0; i < uses.size();) {
    std::size_t j = i, up = 0;
    for (; j < uses.size() && uses[j][0] == uses[i][0] && uses[j][1] == uses[i][1]; ++j) up += uses[j][2];
    ++p.edges;
    if (j - i == 1) ++p.boundary;
    if (j - i > 2) ++p.nonmanifold;
    if (j - i == 2 && up != 1) ++p.inconsistent;
    i = j;
  }
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 1; i < sorted.size(); ++i) p.duplicates += sorted[i] == sorted[i - 1] ? 1 : 0;
  for (std::uint64_t v = 0; v < label.size(); ++v) p.components += used[v] && label[v] == v ? 1 : 0;
  return p;
}

TEST_CASE("check: random complexes agree with plain counting at every cap", "[property]") {
  test::Random random;
  for (int round = 0; round < 30; ++round) {
    const std::uint64_t n = 3 + random.below(3000);
    std::vector<Double3> points;
    std::vector<MeshFace> faces;
    for (std::uint64_t i = 0; i < n; ++i) {
      points.push_back({static_cast<double>(random.below(1000)), static_cast<double>(random.below(1000)),
                        static_cast<double>(i)});
    }
    const std::uint64_t range = round % 3 == 0 ? n : 5;  // near in number, or anywhere
    for (std::uint64_t i = 0; i < n; ++i) {
      const std::uint64_t a = random.below(n);
      faces.push_back({a, (a + random.below(range)) % n, (a + random.below(range)) % n});
    }
    const MemoryMesh mesh(points, faces);
    const Plain want = plain_counts(mesh);
    const std::string whole = tessera::dump_json(to_json(check(mesh)));
    const MeshCheck c = check(mesh, 400000);  // many ranges, everything spilled
    CAPTURE(round, n);
    CHECK(tessera::dump_json(to_json(c)) == whole);
    CHECK(c.edges == want.edges);
    CHECK(c.boundary_edges == want.boundary);
    CHECK(c.nonmanifold_edges == want.nonmanifold);
    CHECK(c.inconsistent_edges == want.inconsistent);
    CHECK(c.components == want.components);
    CHECK(c.duplicate_faces == want.duplicates);
  }
}

TEST_CASE("check: the result does not depend on the cap nor on the order of faces", "[property]") {
  const MemoryMesh mesh = test::torus(120, 60, 37);
  const std::string whole = tessera::dump_json(to_json(check(mesh)));
  std::vector<MeshFace> shuffled = mesh.faces();
  test::Random random;
  for (std::size_t i = shuffled.size(); i > 1; --i) std::swap(shuffled[i - 1], shuffled[random.below(i)]);
  for (MeshFace& f : shuffled)
    std::rotate(f.begin(), f.begin() + static_cast<std::ptrdiff_t>(random.below(3)), f.end());
  CHECK(tessera::dump_json(to_json(check({mesh.points(), shuffled}, 300000))) == whole);
  CHECK(tessera::dump_json(to_json(check(mesh, 300000))) == whole);
  const std::string welded = tessera::dump_json(to_json(check(test::soup(mesh))));
  CHECK(tessera::dump_json(to_json(check(test::soup(mesh), 500000))) == welded);
}

TEST_CASE("check: a vertex with more faces than the cap holds is refused by name", "[memory]") {
  std::vector<Double3> points = {{0, 0, 1}};
  std::vector<MeshFace> faces;
  for (std::uint64_t i = 1; i < 40000; ++i) {
    points.push_back({static_cast<double>(i), static_cast<double>(i * i), 0});
    if (i > 1) faces.push_back({0, i - 1, i});
  }
  const MemoryMesh fan(points, faces);
  CHECK_THROWS_AS(check(fan, 1000000), ResourceError);
  CHECK(check(fan).boundary_loops == 1);
}

}  // namespace
}  // namespace tessera::mesh_check_test
