#include "kernels/extract/extended_marching_cubes.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "kernels/extract/cell_loops.h"
#include "octree/vector.h"
#include "tests/helpers/analytic_field.h"
#include "tests/helpers/mesh_checks.h"

namespace extended_marching_cubes_test {

using namespace tessera;
using namespace tessera::test;

namespace {

struct Extracted {
  std::vector<Patch> patches;
  IndexedMesh mesh;
  MeshChecks checks;
  ExtractReport report;
};

Extracted extract(const DirectedField& field, ExtractMethod method = ExtractMethod::kExtendedMarchingCubes) {
  Extracted out;
  ExtractOptions options;
  options.method = method;
  out.report = extract_surface(field, options, [&](Patch&& p) { out.patches.push_back(std::move(p)); });
  out.mesh = weld(out.patches);
  out.checks = check_mesh(out.mesh);
  return out;
}

void require_sound(const Extracted& e) {
  CHECK(e.mesh.unresolved == 0);
  CHECK(e.checks.non_manifold_edges == 0);
  CHECK(e.checks.non_manifold_vertices == 0);
  CHECK(e.checks.misoriented_edges == 0);
  CHECK(e.checks.duplicate_faces == 0);
  CHECK(e.checks.degenerate_faces == 0);
  CHECK(e.checks.unused_vertices == 0);
}

using Normal = Double3;
Normal face_normal(const IndexedMesh& m, const std::array<std::uint32_t, 3>& f) {
  return triangle_normal(m.position[f[0]], m.position[f[1]], m.position[f[2]]);
}

const Int3 kOrigin = {64, 128, 64};

/// Primitive surfaces of a solid, to measure how far a feature vertex is from where they meet.
struct Solid {
  Shape shape;
  std::vector<Shape> surfaces;
};

/// Distance from x to the common points of the `count` surfaces nearest to it, by Newton steps of least norm.
double distance_to_feature(const Solid& solid, const Double3& x, std::size_t count) {
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t s = 0; s < solid.surfaces.size(); ++s)
    order.emplace_back(std::fabs(solid.surfaces[s](x).value), s);
  std::sort(order.begin(), order.end());
  Double3 p = x;
  for (int round = 0; round < 200; ++round) {  // alternating projections: slow but sure
    for (std::size_t c = 0; c < count; ++c) {
      const ShapeSample s = solid.surfaces[order[c].second](p);
      for (std::size_t k = 0; k < 3; ++k) p[k] -= s.value * s.gradient[k];
    }
  }
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) sum += (p[k] - x[k]) * (p[k] - x[k]);
  return std::sqrt(sum);
}

double second_nearest(const Solid& solid, const Double3& x) {
  double first = 1e9, second = 1e9;
  for (const Shape& s : solid.surfaces) {
    const double d = std::fabs(s(x).value);
    if (d < first) {
      second = first;
      first = d;
    } else if (d < second) {
      second = d;
    }
  }
  return second;
}

/// Mean angle between faces within a cell of an edge and the true normal there, weighted by area, in degrees.
double normal_deviation_at_edges(const Solid& solid, const IndexedMesh& m) {
  double sum = 0.0, area = 0.0;
  for (const auto& f : m.faces) {
    Double3 c = {0, 0, 0};
    for (const std::uint32_t v : f)
      for (std::size_t k = 0; k < 3; ++k) c[k] += m.position[v][k] / 3;
    if (second_nearest(solid, c) > 0.7) continue;
    const Double3 n = face_normal(m, f);
    const double length = std::sqrt(dot(n, n));
    const Double3 g = solid.shape(c).gradient;
    const double cosine = dot(n, g) / length / std::sqrt(dot(g, g));
    sum += length * std::acos(std::min(1.0, std::max(-1.0, cosine)));
    area += length;
  }
  REQUIRE(area > 0.0);
  return sum / area * 180.0 / 3.14159265358979;
}

Solid cube_solid(double size) {
  const Double3 o = {64 + 0.17 * size, 128 + 0.171 * size, 64 + 0.168 * size};
  Solid s;
  const Double3 axes[3] = {{0.90, 0.31, -0.30}, {-0.25, 0.94, 0.22}, {0.35, -0.12, 0.93}};
  const Double3 centre = {o[0] + 0.33 * size, o[1] + 0.33 * size, o[2] + 0.33 * size};
  for (int side = 0; side < 2; ++side) {
    for (const Double3& a : axes) {
      const double sign = side ? 1.0 : -1.0;
      const double length = std::sqrt(dot(a, a));
      Double3 n, p;
      for (std::size_t k = 0; k < 3; ++k) {
        n[k] = sign * a[k] / length;
        p[k] = centre[k] + n[k] * 0.22 * size;
      }
      s.surfaces.push_back(half_space(p, n));
    }
  }
  s.shape = s.surfaces[0];
  for (std::size_t i = 1; i < 6; ++i) s.shape = intersect(s.shape, s.surfaces[i]);
  return s;
}

/// A block with a cylindrical hole through it.
Solid csg_solid(double size) {
  Solid s = cube_solid(size);
  const Shape hole =
      cylinder({64 + 0.5 * size, 128 + 0.5 * size, 64 + 0.49 * size}, {0.35, -0.12, 0.93}, 0.13 * size);
  s.surfaces.push_back(hole);
  s.shape = subtract(s.shape, hole);
  return s;
}

/// Like the fandisk: plane, cylindrical and spherical faces that meet in convex and concave, straight and
/// curved edges of many angles, some of them shallow.
Solid fandisk_solid(double size) {
  const auto at = [&](double x, double y, double z) {
    return Double3{64 + x * size, 128 + y * size, 64 + z * size};
  };
  Solid s;
  const Shape outer = cylinder(at(0.3, 0.3, 0.5), {0.03, 0.02, 1.0}, 0.55 * size);
  const Shape bottom = half_space(at(0.5, 0.5, 0.2), {0.05, 0.02, -1.0});
  const Shape top = half_space(at(0.5, 0.5, 0.75), {0.15, 0.25, 1.0});
  const Shape left = half_space(at(0.18, 0.5, 0.5), {-1.0, 0.08, 0.03});
  const Shape front = half_space(at(0.5, 0.2, 0.5), {0.06, -1.0, 0.05});
  const Shape step_side = half_space(at(0.45, 0.45, 0.5), {-0.7, -0.6, 0.1});
  const Shape step_floor = half_space(at(0.5, 0.5, 0.47), {0.03, 0.04, -1.0});
  const Shape dent = ball(at(0.95, 0.95, -0.5), 0.85 * size);
  s.surfaces = {outer, bottom, top, left, front, step_side, step_floor, dent};
  Shape body = intersect(intersect(outer, intersect(bottom, top)), intersect(left, front));
  body = subtract(body, intersect(step_side, step_floor));
  s.shape = subtract(body, dent);
  return s;
}

/// \param worst_allowed  largest distance of a feature vertex; 99 of 100 are within 0.02 in any case
void check_features(const Solid& solid, int nodes, double worst_allowed) {
  const int cells = nodes > 65 ? 128 : 64;
  AnalyticFieldOptions options;
  options.valid = [&](const Int3& n) {
    for (std::size_t a = 0; a < 3; ++a)
      if (n[a] < kOrigin[a] || n[a] > kOrigin[a] + cells) return false;
    return true;
  };
  const DirectedField field = make_field(solid.shape, kOrigin, {cells, cells, cells}, options);
  const Extracted plain = extract(field, ExtractMethod::kMarchingCubes);
  const Extracted extended = extract(field);
  require_sound(plain);
  require_sound(extended);
  CHECK(plain.checks.boundary_edges == 0);
  CHECK(extended.checks.boundary_edges == 0);
  CHECK(extended.checks.components == 1);
  CHECK(extended.checks.genus == plain.checks.genus);
  REQUIRE(extended.report.crease_samples > 100);

  double worst_crease = 0.0, worst_corner = 0.0;
  std::size_t features = 0, near = 0;
  for (std::size_t v = 0; v < extended.mesh.position.size(); ++v) {
    const VertexClass c = extended.mesh.vertex_class[v];
    const Double3& x = extended.mesh.position[v];
    features += c == VertexClass::kCrease || c == VertexClass::kCorner;
    if (c != VertexClass::kCrease && c != VertexClass::kCorner) continue;
    const double off = distance_to_feature(solid, x, c == VertexClass::kCrease ? 2 : 3);
    double& worst = c == VertexClass::kCrease ? worst_crease : worst_corner;
    worst = std::max(worst, off);
    near += off <= 0.02;
  }
  const double before = normal_deviation_at_edges(solid, plain.mesh);
  const double after = normal_deviation_at_edges(solid, extended.mesh);
  const double more_faces =
      static_cast<double>(extended.mesh.faces.size()) / static_cast<double>(plain.mesh.faces.size());
  CAPTURE(nodes, features, extended.report.rejected_samples, extended.report.flips, before, after,
          more_faces);
  INFO("crease " << worst_crease << " corner " << worst_corner);
  CHECK(worst_crease <= worst_allowed);
  CHECK(worst_corner <= worst_allowed);
  CHECK(near * 100 >= features * 99);
  CHECK(after <= 0.1 * before);
  CHECK(more_faces < 1.15);
}

}  // namespace

TEST_CASE("cell loops: every pattern uses each crossed edge once, and neighbours see reversed segments",
          "[unit]") {
  for (unsigned pattern = 1; pattern < 255; ++pattern) {
    for (unsigned joined = 0; joined < 64; ++joined) {
      if (joined & ~ambiguous_faces(pattern)) continue;
      const CellLoops loops = trace_loops(pattern, joined);
      unsigned used = 0, crossed = 0;
      std::size_t first = 0;
      for (std::size_t l = 0; l < loops.count; ++l) {
        REQUIRE(loops.length[l] >= 3);
        for (std::size_t i = 0; i < loops.length[l]; ++i) {
          const int e = loops.edge[first + i];
          REQUIRE((used >> e & 1) == 0);
          used |= 1u << e;
          REQUIRE(common_face(e, loops.edge[first + (i + 1) % loops.length[l]]) < 6);
        }
        first += loops.length[l];
      }
      for (int e = 0; e < kCellEdges; ++e) {
        const int a = e >> 2;
        unsigned corner = 0;
        for (int k = 0; k < 3; ++k) corner |= static_cast<unsigned>(edge_offset(e, k)) << k;
        if ((pattern >> corner & 1) != (pattern >> (corner | 1u << a) & 1)) crossed |= 1u << e;
      }
      CHECK(used == crossed);
    }
  }
}

TEST_CASE("extract: a plane in general position is one flat disc", "[unit]") {
  const Shape plane = half_space({96.3, 160.2, 95.7}, {0.2, -0.1, 1.0});
  AnalyticFieldOptions options;
  options.valid = [](const Int3& n) {
    for (std::size_t a = 0; a < 3; ++a)
      if (n[a] < kOrigin[a] + 5 || n[a] > kOrigin[a] + 59) return false;
    return true;
  };
  const Extracted e = extract(make_field(plane, kOrigin, {64, 64, 64}, options));
  require_sound(e);
  CHECK(e.checks.components == 1);
  CHECK(e.checks.boundary_loops == 1);
  CHECK(e.checks.euler == 1);
  CHECK(e.report.crease_samples + e.report.corner_samples == 0);
  const Double3 g = plane({0, 0, 0}).gradient;
  for (const auto& f : e.mesh.faces) {
    const Double3 n = face_normal(e.mesh, f);
    REQUIRE(dot(n, g) > 0.99999 * std::sqrt(dot(n, n)));
  }
  for (const Double3& x : e.mesh.position) REQUIRE(std::fabs(plane(x).value) < 1e-5);
}

TEST_CASE("extract: sphere and torus are closed, oriented outward, of the right genus", "[unit]") {
  const auto closed = [](const Shape& shape, std::int64_t euler) {
    const auto method = GENERATE(ExtractMethod::kMarchingCubes, ExtractMethod::kExtendedMarchingCubes);
    const Extracted e = extract(make_field(shape, kOrigin, {64, 64, 64}), method);
    require_sound(e);
    CHECK(e.checks.boundary_edges == 0);
    CHECK(e.checks.components == 1);
    CHECK(e.checks.euler == euler);
    for (const auto& f : e.mesh.faces) {
      const Double3 n = face_normal(e.mesh, f);
      REQUIRE(dot(n, shape(e.mesh.position[f[0]]).gradient) > 0.0);
    }
  };
  SECTION("sphere") {
    closed(ball({96.3, 160.1, 95.8}, 21.37), 2);
  }
  SECTION("torus") {
    closed(torus({96.3, 160.1, 95.8}, 18.2, 7.3), 0);
  }
}

TEST_CASE("extract: features of a cube", "[unit]") {
  const int nodes = GENERATE(65, 129);
  check_features(cube_solid(nodes - 1), nodes, 1e-4);
}
TEST_CASE("extract: features of a block with a cylinder cut through", "[unit]") {
  const int nodes = GENERATE(65, 129);
  check_features(csg_solid(nodes - 1), nodes, 0.02);
}
TEST_CASE("extract: features of a fandisk-like solid", "[unit]") {
  const int nodes = GENERATE(65, 129);
  // Where a sheet has one root in the cell nothing tells its curvature: d^2 / 2r at distance d for radius r,
  // more at shallow angles. At 65 nodes the curved faces have radii of 35 and 54 cells.
  check_features(fandisk_solid(nodes - 1), nodes, nodes == 65 ? 0.04 : 0.02);
}

TEST_CASE("extract: an axis-parallel cube has exactly eight corners and straight edges", "[unit]") {
  // On nodes (clamped roots) and between them; twelve edges of 20 cells.
  const double shift = GENERATE(0.0, 0.5, 0.3);
  const Double3 lo = {80 + shift, 150 + shift, 80 + shift}, hi = {100 + shift, 170 + shift, 100 + shift};
  const Extracted e = extract(make_field(box(lo, hi), kOrigin, {64, 64, 64}));
  require_sound(e);
  CHECK(e.checks.boundary_edges == 0);
  CHECK(e.checks.euler == 2);
  CHECK(e.report.corner_samples == 8);
  CAPTURE(shift, e.report.crease_samples, e.report.rejected_samples);
  CHECK(e.report.rejected_samples == 0);
  for (std::size_t v = 0; v < e.mesh.position.size(); ++v) {
    if (e.mesh.vertex_class[v] == VertexClass::kSmooth) continue;
    int on_faces = 0;
    for (std::size_t k = 0; k < 3; ++k)
      on_faces +=
          std::fabs(e.mesh.position[v][k] - lo[k]) < 1e-4 || std::fabs(e.mesh.position[v][k] - hi[k]) < 1e-4;
    REQUIRE(on_faces == (e.mesh.vertex_class[v] == VertexClass::kCorner ? 3 : 2));
  }
}

TEST_CASE("extract: of noisy samples only roots beside creases tell of features", "[unit]") {
  DirectedField field = make_field(cube_solid(64).shape, kOrigin, {64, 64, 64});
  const Extracted all = extract(field);
  REQUIRE(all.report.crease_samples > 100);
  field.creased.assign(field.roots.size(), 1);
  const Extracted marked = extract(field);  // less room than exact samples have
  require_sound(marked);
  CHECK(10 * marked.report.crease_samples > 9 * all.report.crease_samples);
  CHECK(marked.report.crease_samples <= all.report.crease_samples);
  field.creased.assign(field.roots.size(), 0);
  const Extracted none = extract(field);
  require_sound(none);
  CHECK(none.report.crease_samples + none.report.corner_samples == 0);
  CHECK(none.mesh.position == extract(field, ExtractMethod::kMarchingCubes).mesh.position);
}

TEST_CASE("extract: colours are carried, and averaged at centres", "[unit]") {
  AnalyticFieldOptions options;
  SECTION("constant") {
    options.rgba = [](const Double3&) { return 0xff102030u; };
    const Extracted e = extract(make_field(cube_solid(64).shape, kOrigin, {64, 64, 64}, options));
    REQUIRE(e.mesh.rgba.size() == e.mesh.position.size());
    for (const std::uint32_t c : e.mesh.rgba) REQUIRE(c == 0xff102030u);
  }
  SECTION("none") {
    const Extracted e = extract(make_field(cube_solid(64).shape, kOrigin, {64, 64, 64}, options));
    CHECK(e.mesh.rgba.empty());
  }
}

TEST_CASE("extract: noise fields have no defects, and borders only where valid cells meet invalid ones",
          "[property]") {
  const auto method = GENERATE(ExtractMethod::kMarchingCubes, ExtractMethod::kExtendedMarchingCubes);
  const double probability = GENERATE(1.0, 0.98, 0.9, 0.75);
  const auto seed = static_cast<std::uint64_t>(GENERATE(1, 2));
  NoiseOptions noise;
  noise.seed = seed;
  noise.valid_probability = probability;
  noise.domain_min = {108, 171, 100};  // across the corner of eight bricks
  noise.domain_max = {146, 210, 139};
  noise.inside_probability = seed == 1 ? 0.5 : 0.35;
  const DirectedField field = make_noise_field(noise, kOrigin, {128, 128, 128});
  const Extracted e = extract(field, method);
  CAPTURE(probability, seed);
  require_sound(e);
  REQUIRE(e.mesh.faces.size() > 100);

  const auto valid_cell = [&](int i, int j, int k) {
    for (int c = 0; c < 8; ++c) {
      const int x = i + (c & 1), y = j + (c >> 1 & 1), z = k + (c >> 2);
      const BandLeaf* leaf = field.leaf_at(x, y, z);
      if (!leaf || !leaf->is_valid(BandLeaf::node(x, y, z))) return false;
    }
    return true;
  };
  const auto crossed = [&](int i, int j, int k, int axis) { return field.root_at(i, j, k, axis) != nullptr; };
  std::size_t border_segments = 0;
  for (int k = 0; k < 127; ++k)
    for (int j = 0; j < 127; ++j)
      for (int i = 0; i < 127; ++i)
        for (int a = 0; a < 3; ++a) {
          Int3 below = {i, j, k};
          below[static_cast<std::size_t>(a)] -= 1;
          if (valid_cell(i, j, k) == valid_cell(below[0], below[1], below[2])) continue;
          const int u = (a + 1) % 3, v = (a + 2) % 3;
          Int3 pu = {i, j, k}, pv = {i, j, k};
          ++pu[static_cast<std::size_t>(u)];
          ++pv[static_cast<std::size_t>(v)];
          const int crossings = crossed(i, j, k, u) + crossed(i, j, k, v) + crossed(pu[0], pu[1], pu[2], v) +
                                crossed(pv[0], pv[1], pv[2], u);
          border_segments += static_cast<std::size_t>(crossings) / 2;
        }
  CHECK(e.checks.boundary_edges == border_segments);
  std::size_t border_vertices = 0;
  for (const VertexClass c : e.mesh.vertex_class) border_vertices += c == VertexClass::kBorder;
  CHECK(border_vertices == e.checks.boundary_edges);  // every border vertex has exactly two border edges
}

TEST_CASE("extract: a patch is the same in any block that holds its brick", "[property]") {
  const auto method = GENERATE(ExtractMethod::kMarchingCubes, ExtractMethod::kExtendedMarchingCubes);
  NoiseOptions noise;
  noise.seed = 7;
  noise.valid_probability = 0.97;
  noise.domain_min = {95, 160, 100};
  noise.domain_max = {157, 216, 150};
  const Shape solid = csg_solid(128).shape;
  const bool use_noise = GENERATE(true, false);
  const auto field = [&](const Int3& origin, const Int3& cells) {
    return use_noise ? make_noise_field(noise, origin, cells) : make_field(solid, origin, cells);
  };
  std::map<Int3, std::uint64_t> whole;
  std::size_t faces = 0;
  for (const Patch& p : extract(field(kOrigin, {128, 128, 128}), method).patches) {
    whole[p.brick] = patch_hash(p);
    faces += p.faces.size();
  }
  REQUIRE(faces > 1000);
  REQUIRE(whole.size() >= 7);
  std::map<Int3, std::uint64_t> single, slabs;
  for (int b = 0; b < 8; ++b) {
    const Int3 origin = {kOrigin[0] + 64 * (b & 1), kOrigin[1] + 64 * (b >> 1 & 1),
                         kOrigin[2] + 64 * (b >> 2)};
    for (const Patch& p : extract(field(origin, {64, 64, 64}), method).patches)
      single[p.brick] = patch_hash(p);
  }
  for (int b = 0; b < 2; ++b) {
    const Int3 origin = {kOrigin[0], kOrigin[1] + 64 * b, kOrigin[2]};
    for (const Patch& p : extract(field(origin, {128, 64, 128}), method).patches)
      slabs[p.brick] = patch_hash(p);
  }
  CHECK(single == whole);
  CHECK(slabs == whole);
}

}  // namespace extended_marching_cubes_test
