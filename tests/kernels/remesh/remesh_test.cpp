// The remeshing kernel: what triangles become, what must stay as it is, and what the result may not depend on.
#include "kernels/remesh/remesh.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "kernels/certify/certificate.h"
#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/flat_faces.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/remesh/triangle_quality.h"
#include "octree/error.h"
#include "octree/portable_math.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/remeshed_block.h"

namespace remesh_test {

using namespace tessera;
using namespace tessera::test;

namespace {

double area_of(const MeshBlock& b) {
  double area = 0.0;
  for (const auto& f : b.faces)
    area += 0.5 * norm(triangle_normal(b.position[f[0]], b.position[f[1]], b.position[f[2]]));
  return area;
}

bool same(const MeshBlock& a, const MeshBlock& b) {
  return a.key == b.key && a.position == b.position && a.faces == b.faces && a.face_flags == b.face_flags &&
         a.vertex_class == b.vertex_class;
}

/// The same mesh with vertices and faces in another order, faces turned.
MeshBlock shuffled(const MeshBlock& b, std::uint64_t seed) {
  const auto order_of = [&](std::size_t n, std::uint64_t stream) {
    std::vector<std::uint32_t> order(n);
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t x, std::uint32_t y) {
      return random_bits(seed, stream, x) < random_bits(seed, stream, y);
    });
    return order;
  };
  MeshBlock out;
  std::vector<std::uint32_t> slot(b.key.size());
  for (const std::uint32_t v : order_of(b.key.size(), 1)) {
    slot[v] = static_cast<std::uint32_t>(out.key.size());
    out.key.push_back(b.key[v]);
    out.position.push_back(b.position[v]);
    out.vertex_class.push_back(b.vertex_class[v]);
  }
  for (const std::uint32_t f : order_of(b.faces.size(), 2)) {
    const auto& t = b.faces[f];
    const unsigned bits = b.face_flags[f] & 7u;
    out.faces.push_back({slot[t[1]], slot[t[2]], slot[t[0]]});
    out.face_flags.push_back(static_cast<std::uint8_t>(bits >> 1 | (bits & 1u) << 2));
  }
  return out;
}

}  // namespace

TEST_CASE("remesh: a noisy sphere gets triangles near equilateral, on the sphere it was", "[unit]") {
  MeshBlock sphere = sphere_block(6);
  add_noise(sphere, 0.002, 3);
  for (const double edge : {0.02, 0.033, 0.06}) {
    CAPTURE(edge);
    const MeshBlock out = remeshed(sphere, options_for(edge));
    const MeshChecks checks = checks_of(out);
    CHECK(checks.defects() == 0);
    CHECK(checks.boundary_edges == 0);
    CHECK(checks.euler == 2);
    TriangleQuality q;
    q.add(out, edge);
    const auto faces = static_cast<double>(q.faces);
    CHECK(static_cast<double>(q.angle_off) * 1e-3 / (3.0 * faces) < 8.0);
    CHECK(q.smallest > 28000);
    CHECK(q.mean_cell_deviation() < 0.14);
    CHECK(static_cast<double>(q.length_off) * 1e-6 / (3.0 * faces) < 0.15);
    CHECK(static_cast<double>(q.valences[6]) > 0.83 * static_cast<double>(out.key.size()));
    CHECK(certified(out, sphere, 0.01) < 0.2 * edge);
    const ClosestFaces reference(sphere.position, sphere.faces, {});
    for (const Double3& p : out.position)
      REQUIRE(reference.closest(p, 1e-24, ClosestFaces::kNone).slot != ClosestFaces::kNone);
  }
}

TEST_CASE("remesh: the last relaxations make angles alike, or areas", "[unit]") {
  MeshBlock sphere = sphere_block(6);
  add_noise(sphere, 0.002, 3);
  constexpr double kEdge = 0.033;
  const auto quality = [&](double weight, int relaxations, double sines = 0.0, int by_size = 0) {
    RemeshOptions o = options_for(kEdge);
    o.angle_weight = weight;
    o.last_relaxations = relaxations;
    o.sine_weight = sines;
    o.size_relaxations = by_size;
    const MeshBlock out = remeshed(sphere, o);
    CHECK(checks_of(out).defects() == 0);
    TriangleQuality q;
    q.add(out, kEdge);
    CHECK(q.smallest > 25000);
    return q;
  };
  const auto off = [](const TriangleQuality& q) {
    return static_cast<double>(q.angle_off) / static_cast<double>(q.faces);
  };
  const TriangleQuality both = quality(8.0, 2), angles = quality(20.0, 8), areas = quality(0.8, 8);
  CHECK(off(angles) < 0.97 * off(both));
  CHECK(areas.mean_cell_deviation() < 0.5 * both.mean_cell_deviation());
  CHECK(areas.mean_cell_deviation() < 0.06);
  CHECK(off(areas) < 1.7 * off(angles));
  // What is told are means of sizes, not of squares: to ask for these gives both for the same sweeps.
  const TriangleQuality sines = quality(20.0, 3, 1.0, 5), shares = quality(0.8, 4, 0.1, 4);
  CHECK(off(sines) < 0.96 * off(angles));
  CHECK(sines.mean_cell_deviation() < angles.mean_cell_deviation());
  CHECK(off(shares) < 0.98 * off(areas));
  CHECK(shares.mean_cell_deviation() < 0.9 * areas.mean_cell_deviation());
}

TEST_CASE("remesh: dislocations glide along longer strips in iterations that are not the last", "[unit]") {
  MeshBlock sphere = sphere_block(6);
  add_noise(sphere, 0.002, 3);
  RemeshOptions o = options_for(0.033);
  o.iterations = 12;
  const MeshBlock out = remeshed(sphere, o);
  CHECK(checks_of(out).defects() == 0);
  TriangleQuality q;
  q.add(out, o.edge);
  CHECK(static_cast<double>(q.valences[6]) > 0.915 * static_cast<double>(out.key.size()));
}

TEST_CASE("remesh: vertices on the creases of a cube stay exactly on them, its corners stay", "[unit]") {
  for (const double edge : {0.031, 0.08, 0.21}) {
    CAPTURE(edge);
    const MeshBlock out = remeshed(cube_block(20), options_for(edge));
    CHECK(checks_of(out).defects() == 0);
    CHECK(checks_of(out).euler == 2);
    CHECK(area_of(out) == Approx(6.0).epsilon(1e-12));
    std::size_t corners = 0, creases = 0;
    for (std::size_t v = 0; v < out.key.size(); ++v) {
      int ends = 0;
      for (const double x : out.position[v]) ends += x == 0.0 || x == 1.0;
      REQUIRE(ends > 0);
      corners += ends == 3;
      creases += ends == 2;
      CHECK((out.vertex_class[v] == VertexClass::kCorner) == (ends == 3));
      CHECK((out.vertex_class[v] == VertexClass::kCrease) == (ends == 2));
    }
    CHECK(corners == 8);
    // A crease of the length 1 is parted into equal edges near the length asked for.
    CHECK(static_cast<double>(creases) >= 12.0 * (0.75 / edge - 1.0));
    CHECK(static_cast<double>(creases) <= 12.0 * (1.25 / edge - 1.0));
    TriangleQuality q;
    q.add(out, edge);
    CHECK(q.smallest > 20000);
  }
}

TEST_CASE("remesh: borders keep their line, corners of borders their place", "[unit]") {
  const MeshBlock plane = grid_block(30, 20, [](double, double) { return 0.0; });
  const MeshBlock out = remeshed(plane, options_for(1.7));
  CHECK(checks_of(out).defects() == 0);
  CHECK(checks_of(out).boundary_loops == 1);
  CHECK(area_of(out) == Approx(600.0).epsilon(1e-12));
  std::size_t corners = 0;
  for (const VertexClass c : out.vertex_class) corners += c == VertexClass::kCorner;
  CHECK(corners == 4);
  std::size_t flagged = 0;
  for (const std::uint8_t flags : out.face_flags)
    flagged += static_cast<std::size_t>((flags & 1) + (flags >> 1 & 1) + (flags >> 2 & 1));
  CHECK(flagged == checks_of(out).boundary_edges);
}

TEST_CASE("remesh: creases beside each other yield to sound faces where they turn little, and only there",
          "[unit]") {
  // Two creases a fifth of an edge apart: a bevel, which no face within its width could follow.
  const double angle_deg = GENERATE(30.0, 60.0), edge = 2.0, width = 0.4;
  CAPTURE(angle_deg);
  const double cosine = cosine_of_degrees(angle_deg), slope = std::sqrt(1.0 - cosine * cosine) / cosine;
  const auto across = [&](double x) { return x <= 20.0 ? x : x - 1.0 + width; };
  MeshBlock bevel = grid_block(40, 30, [](double, double) { return 0.0; });
  for (Double3& p : bevel.position) {
    p[0] = across(p[0]);
    p[2] = p[0] <= 20.0 ? 0.0 : slope * std::fmin(p[0] - 20.0, width);
  }
  const MeshBlock out = remeshed(bevel, options_for(edge));
  CHECK(checks_of(out).defects() == 0);
  TriangleQuality q;
  q.add(out, edge);
  std::size_t creases = 0, narrow = 0;
  for (const VertexClass c : out.vertex_class) creases += c == VertexClass::kCrease;
  for (std::size_t i = 0; i < 25; ++i) narrow += q.minimum[i];
  if (angle_deg < 45.0) {
    CHECK(narrow == 0);
  } else {
    CHECK(creases >= 2 * 12);
  }
  CHECK(certified(out, bevel, 0.1) < 0.2 * edge);
}

TEST_CASE("remesh: flat faces between two polylines of one crease leave none", "[unit]") {
  // A roof whose slopes meet at every point of the ridge on one side, at every second one on the other: the faces between
  // have hardly an area, and normals that say nothing. All points of the ridge are corners.
  constexpr std::size_t kLong = 24, kWide = 8;
  MeshBlock roof;
  std::vector<std::vector<std::uint32_t>> left(kWide + 1), right(kWide + 1);
  const auto add_row = [&](std::vector<std::uint32_t>& row, double y, double z, std::size_t step) {
    for (std::size_t i = 0; i <= kLong; i += step) {
      row.push_back(static_cast<std::uint32_t>(roof.key.size()));
      roof.key.push_back(roof.key.size());
      roof.position.push_back({static_cast<double>(i), y, z - (y == 0.0 && i % 2 == 1 ? 0.002 : 0.0)});
      roof.vertex_class.push_back(y == 0.0 ? VertexClass::kCorner : VertexClass::kSmooth);
    }
  };
  add_row(left[0], 0.0, 0.0, 1);
  for (std::size_t i = 0; i <= kLong; i += 2) right[0].push_back(left[0][i]);
  for (std::size_t j = 1; j <= kWide; ++j) {
    const double down = 0.7 * static_cast<double>(j);
    add_row(left[j], -down, -down, 1);
    add_row(right[j], down, -down, 2);
  }
  const auto face = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    roof.faces.push_back({a, b, c});
  };
  for (std::size_t j = 0; j < kWide; ++j) {
    for (std::size_t i = 0; i < kLong; ++i) {
      face(left[j][i], left[j + 1][i], left[j + 1][i + 1]);
      face(left[j][i], left[j + 1][i + 1], left[j][i + 1]);
    }
    for (std::size_t i = 0; i < kLong / 2; ++i) {
      face(right[j][i], right[j][i + 1], right[j + 1][i + 1]);
      face(right[j][i], right[j + 1][i + 1], right[j + 1][i]);
    }
  }
  for (std::size_t i = 0; i < kLong; i += 2) face(left[0][i], left[0][i + 1], left[0][i + 2]);
  const auto edge = [&](const std::array<std::uint32_t, 3>& f, std::size_t e) {
    const std::uint32_t a = f[e], b = f[(e + 1) % 3];
    return std::array<std::uint32_t, 2>{std::min(a, b), std::max(a, b)};
  };
  std::map<std::array<std::uint32_t, 2>, int> sides;
  for (const auto& f : roof.faces)
    for (std::size_t e = 0; e < 3; ++e) ++sides[edge(f, e)];
  for (const auto& f : roof.faces) {
    unsigned flags = 0;
    for (std::size_t e = 0; e < 3; ++e) {
      const auto [a, b] = edge(f, e);
      flags |= sides[{a, b}] == 1 ? 1u << e : b <= kLong ? unsigned{kFaceCrease01} << e : 0u;
    }
    roof.face_flags.push_back(static_cast<std::uint8_t>(flags));
  }
  RemeshOptions o = options_for(2.0);
  o.find_creases = false;
  const MeshBlock out = remeshed(roof, o);
  CHECK(checks_of(out).defects() == 0);
  TriangleQuality q;
  q.add(out, 2.0);
  CHECK(q.smallest > 5000);
  const auto corners = std::count(out.vertex_class.begin(), out.vertex_class.end(), VertexClass::kCorner);
  CHECK(static_cast<std::size_t>(corners) >= kLong + 1);
}

TEST_CASE("remesh: two pieces with a locked seam fit together, whichever is done first", "[unit]") {
  MeshBlock whole = sphere_block(5);
  add_noise(whole, 0.003, 5);
  canonicalise(whole);
  RemeshOptions o = options_for(0.04);
  std::vector<std::uint8_t> left(whole.faces.size()), right(whole.faces.size());
  for (std::size_t f = 0; f < left.size(); ++f) {
    left[f] = whole.position[whole.faces[f][0]][0] < 0.1;
    right[f] = !left[f];
  }
  MeshBlock a = select_faces(whole, left), b = select_faces(whole, right);
  const MeshBlock seam = a;
  RemeshReport report = remesh(a, whole, o);
  CHECK(report.locked_vertices > 0);
  o.first_key += std::uint64_t{1} << 32;
  remesh(b, whole, o);
  const MeshBlock* const pieces[2] = {&a, &b};
  const MeshBlock joined = merge_blocks(pieces, {});
  CHECK(checks_of(joined).defects() == 0);
  CHECK(checks_of(joined).boundary_edges == 0);
  CHECK(checks_of(joined).euler == 2);
  const std::vector<std::uint8_t> complete = complete_stars(seam);
  for (std::size_t v = 0; v < seam.key.size(); ++v) {
    if (complete[v]) continue;
    const auto at = std::lower_bound(a.key.begin(), a.key.end(), seam.key[v]);
    REQUIRE((at != a.key.end() && *at == seam.key[v]));
    CHECK(a.position[static_cast<std::size_t>(at - a.key.begin())] == seam.position[v]);
  }
}

TEST_CASE("remesh: the order of the input leaves no trace", "[property]") {
  MeshBlock sphere = sphere_block(5);
  add_noise(sphere, 0.004, 7);
  const MeshBlock cube = cube_block(12);
  for (const auto& [mesh, edge] : {std::pair<const MeshBlock*, double>{&sphere, 0.045}, {&cube, 0.11}}) {
    RemeshOptions o = options_for(edge);
    o.tolerance = 0.1 * edge;
    o.refine_beyond = true;
    const MeshBlock out = remeshed(*mesh, o);
    MeshBlock reference = *mesh;
    canonicalise(reference);
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
      MeshBlock other = shuffled(*mesh, seed);
      CHECK(other.position != mesh->position);
      remesh(other, reference, o);
      CHECK(same(other, out));
    }
  }
}

TEST_CASE("remesh: faces at held vertices stay as they are", "[unit]") {
  MeshBlock sphere = sphere_block(5);
  add_noise(sphere, 0.003, 9);
  canonicalise(sphere);
  std::vector<std::uint64_t> pinned;
  for (std::size_t v = 0; v < sphere.key.size(); ++v)
    if (sphere.position[v][2] > 0.6) pinned.push_back(sphere.key[v]);
  const MeshBlock out = remeshed(sphere, options_for(0.05), nullptr, pinned);
  std::map<std::array<std::uint64_t, 3>, int> faces;
  for (const auto& f : out.faces) ++faces[{out.key[f[0]], out.key[f[1]], out.key[f[2]]}];
  std::size_t found = 0, expected = 0;
  for (const auto& f : sphere.faces) {
    bool any = false;
    for (const std::uint32_t v : f) any |= std::binary_search(pinned.begin(), pinned.end(), sphere.key[v]);
    if (!any) continue;
    ++expected;
    found += faces.count({sphere.key[f[0]], sphere.key[f[1]], sphere.key[f[2]]});
  }
  CHECK(expected > 100);
  CHECK(found == expected);
  CHECK(checks_of(out).defects() == 0);
}

TEST_CASE("remesh: with a tolerance faces get smaller where the surface asks for it", "[unit]") {
  const MeshBlock hills = grid_block(80, 80, [](double x, double y) {
    const double r = std::sqrt((x - 40) * (x - 40) + (y - 40) * (y - 40));
    return r < 12.0 ? 6.0 * (1.0 - r * r / 144.0) * (1.0 - r * r / 144.0) : 0.0;
  });
  RemeshOptions o = options_for(5.0);
  const double loose = certified(remeshed(hills, o), hills, 0.1);
  o.tolerance = 0.05;
  o.refine_beyond = true;
  const MeshBlock out = remeshed(hills, o);
  CHECK(checks_of(out).defects() == 0);
  const double tight = certified(out, hills, 0.1);
  CHECK(loose > 0.2);
  CHECK(tight < 0.075);
  CHECK(out.faces.size() < hills.faces.size() / 4);
}

TEST_CASE("remesh: with a tolerance no tip of the reference is missed, however narrow", "[unit]") {
  const MeshBlock tips = grid_block(60, 60, [](double x, double y) {
    const bool tip = static_cast<int>(x) % 15 == 7 && static_cast<int>(y) % 15 == 7;
    return tip ? 0.2 : 0.0;
  });
  RemeshOptions o = options_for(6.0);
  CHECK(certified(remeshed(tips, o), tips, 0.1) > 0.15);
  o.tolerance = 0.1;
  CHECK(certified(remeshed(tips, o), tips, 0.1) > 0.12);
  o.refine_beyond = true;
  const MeshBlock out = remeshed(tips, o);
  CHECK(certified(out, tips, 0.1) < 0.12);
  CHECK(out.faces.size() < tips.faces.size() / 4);
}

TEST_CASE("remesh: vertices that leave their line look for faces from nowhere", "[unit]") {
  // Crumpled sheets are all creases, whose ends merge; there are more segments of lines than faces.
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u, 6u}) {
    MeshBlock sheet = grid_block(20, 20, [](double, double) { return 0.0; });
    add_noise(sheet, 6.0, seed);
    RemeshOptions o = options_for(4.0);
    o.tolerance = 0.2;
    o.refine_beyond = true;
    const MeshBlock out = remeshed(sheet, o);
    CHECK(out.faces.size() > 100);
    CHECK(checks_of(out).non_manifold_edges == 0);
  }
}

TEST_CASE("remesh: seams of long edges get no slivers along them", "[unit]") {
  MeshBlock whole = sphere_block(2);
  canonicalise(whole);
  std::vector<std::uint8_t> left(whole.faces.size());
  for (std::size_t f = 0; f < left.size(); ++f) left[f] = whole.position[whole.faces[f][0]][0] < 0.1;
  MeshBlock half = select_faces(whole, left);
  RemeshReport report = remesh(half, whole, options_for(0.05));  // a sixth of the edges
  CHECK(report.locked_vertices > 0);
  CHECK(half.faces.size() > 2000);
  TriangleQuality quality;
  quality.add(half, 0.05);
  CHECK(quality.smallest > 5000);
}

TEST_CASE("remesh: edges whose nearest places are all but their own ends are split in the middle", "[unit]") {
  // Faces across a slot whose walls are hardly askew: from the middle of their edges the nearest wall is at an end.
  const auto wall = [](double x, double y) { return 1e-7 * (x + y - 8.0); };
  MeshBlock walls = grid_block(8, 8, wall);
  std::vector<Double3> position = walls.position;
  std::vector<std::array<std::uint32_t, 3>> faces = walls.faces;
  for (const Double3& p : walls.position) position.push_back({p[0], p[1], 9.0 - p[2]});
  for (const auto& f : walls.faces) faces.push_back({81 + f[2], 81 + f[1], 81 + f[0]});
  walls = make_block(position, faces);
  canonicalise(walls);
  MeshBlock block = grid_block(8, 1, [](double, double y) { return 9.0 * y; });
  for (Double3& p : block.position) p[1] = 4.0, p[2] = p[2] > 0.0 ? 9.0 - wall(p[0], 4.0) : wall(p[0], 4.0);
  RemeshOptions o = options_for(1.0);
  o.iterations = 0;
  o.tolerance = 0.25;
  o.refine_beyond = true;
  o.find_creases = false;
  remesh(block, walls, o);
  CHECK(block.faces.size() > 50);
  double shortest = 1e300;
  for (const auto& f : block.faces)
    for (std::size_t k = 0; k < 3; ++k)
      shortest = std::min(shortest, norm(block.position[f[k]] - block.position[f[(k + 1) % 3]]));
  CHECK(shortest > 0.01);
}

namespace {

/// Remeshed, and then with its smallest angles raised.
MeshBlock raised(const MeshBlock& from, RemeshOptions o, double degrees, RemeshReport* report = nullptr) {
  MeshBlock reference = from;
  canonicalise(reference);
  MeshBlock out = remeshed(from, o);
  o.find_creases = false;
  o.min_angle_deg = degrees;
  o.first_key = std::uint64_t{3} << 62;
  RemeshReport r = remesh(out, reference, o);
  if (report) *report = r;
  return out;
}

}  // namespace

TEST_CASE("remesh: no face of a smooth closed shape is left below the angle asked for", "[property]") {
  for (const std::uint64_t seed : {3u, 4u, 5u}) {
    CAPTURE(seed);
    MeshBlock sphere = sphere_block(6);
    add_noise(sphere, 0.004, seed);
    RemeshOptions o = options_for(0.033);
    o.iterations = 1;
    o.relaxations = o.last_relaxations = 0;
    o.feature_angle_deg = 0.0;
    o.tolerance = 0.006;
    const MeshBlock before = remeshed(sphere, o);
    RemeshReport report;
    const MeshBlock out = raised(sphere, o, 33.0, &report);
    CHECK(count_sharp(before, 33.0).faces > 20);
    CHECK(report.sharp_in == count_sharp(before, 33.0).faces);
    CHECK(count_sharp(out, 33.0).faces == 0);
    CHECK(checks_of(out).defects() == 0);
    CHECK(checks_of(out).euler == 2);
    CHECK(certified(out, sphere, 0.01) <= std::max(certified(before, sphere, 0.01), 0.008));
    CHECK(static_cast<double>(out.faces.size()) < 1.02 * static_cast<double>(before.faces.size()));
  }
}

TEST_CASE("remesh: angles of the input that are sharper stay and are told", "[unit]") {
  MeshBlock rhomb = grid_block(40, 40, [](double, double) { return 0.0; });
  for (Double3& p : rhomb.position) p = {p[0] + 0.97 * p[1], 0.243 * p[1], 0.0};  // corners of 14 degrees
  RemeshReport report;
  const MeshBlock out = raised(rhomb, options_for(1.0), 30.0, &report);
  const SharpFaces left = count_sharp(out, 30.0);
  CHECK(left.faces == 2);
  CHECK(left.faces == left.between_lines);
  CHECK(checks_of(out).defects() == 0);
}

TEST_CASE("remesh: no more faces than there is room for, and options that make no sense are refused",
          "[unit]") {
  RemeshOptions o = options_for(0.01);
  o.max_faces = 3000;
  RemeshReport report;
  const MeshBlock out = remeshed(sphere_block(4), o, &report);
  CHECK(out.faces.size() <= 3000);
  CHECK(report.by_capacity > 0);
  CHECK(checks_of(out).defects() == 0);
  o.edge = 0.0;
  CHECK_THROWS_AS(remeshed(sphere_block(2), o), UsageError);
  o.edge = 0.1;
  o.tolerance = -1.0;
  CHECK_THROWS_AS(remeshed(sphere_block(2), o), UsageError);
  o.tolerance = 0.0;
  o.angle_weight = 0.0;
  CHECK_THROWS_AS(remeshed(sphere_block(2), o), UsageError);
  o.angle_weight = 1.0;
  o.sine_weight = -1.0;
  CHECK_THROWS_AS(remeshed(sphere_block(2), o), UsageError);
  o.sine_weight = 0.2;
  o.refine_within = -1.0;
  CHECK_THROWS_AS(remeshed(sphere_block(2), o), UsageError);
}

TEST_CASE("remesh: what comes out with more faces than are of use is not done again for what meets in it",
          "[unit]") {
  const MeshBlock sheets = rough_sheets(24, 3, 0.1, 5);
  RemeshOptions o = options_for(5.0);
  RemeshReport again, once;
  const MeshBlock apart = remeshed(sheets, o, &again);
  REQUIRE(again.by_crossing > 0);
  o.useless_faces = 10;
  CHECK(count_contacts(remeshed(sheets, o, &once)) > 0);
  CHECK(once.by_crossing == 0);
  o.useless_faces = 2 * apart.faces.size();
  CHECK(same(remeshed(sheets, o), apart));
}

TEST_CASE("remesh: a block that does not meet itself does not afterwards", "[property]") {
  const std::uint64_t seed = GENERATE(5u, 6u, 7u);
  const double tolerance = GENERATE(0.0, 0.6);
  const MeshBlock sheets = rough_sheets(24, 3, 0.1, seed);
  REQUIRE(count_contacts(sheets) == 0);
  RemeshOptions o = options_for(5.0);
  o.tolerance = tolerance;
  RemeshReport report;
  const MeshBlock b = remeshed(sheets, o, &report);
  CHECK(report.by_crossing > 0);  // it was done with the guard: without, sheets met
  CHECK(count_contacts(b) == 0);
  CHECK(b.faces.size() < sheets.faces.size());
  CHECK(checks_of(b).defects() == 0);
}

TEST_CASE("remesh: sheets a few floats apart do not meet in what is written", "[property]") {
  const std::uint64_t seed = GENERATE(5u, 6u, 7u);
  // Floats there are a 16th apart, the sheets a fifth: what is put between two of them passes through a sheet as near as that once it is rounded.
  MeshBlock sheets = rough_sheets(24, 3, 0.01, seed);
  for (Double3& p : sheets.position) p = wide(narrow(p + Double3{0x1p19, 0x1p19, 0x1p19}));
  REQUIRE(count_contacts(sheets) == 0);
  RemeshOptions o = options_for(5.0);
  o.float_positions = true;
  RemeshReport report;
  const MeshBlock b = remeshed(sheets, o, &report);
  CHECK(report.by_crossing > 0);
  CHECK(report.moves > 0);
  CHECK(count_contacts(b) == 0);
  for (const Double3& p : b.position) CHECK(p == wide(narrow(p)));
  CHECK(checks_of(b).defects() == 0);
}

}  // namespace remesh_test
