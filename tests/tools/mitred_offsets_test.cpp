// tessera resurface with mitres, against the exact offsets of ten solids.
#include <catch2/catch.hpp>

#include <cmath>
#include <cstdio>
#include <numbers>

#include "octree/placement.h"
#include "tests/helpers/solid_command.h"
#include "tests/helpers/temp_folder.h"

namespace mitred_offsets_test {

namespace {

using namespace tessera;
using namespace tessera::test;

constexpr double kOffset = 0.3;

struct Size {
  double volume = 0.0;
  double area = 0.0;
};

struct Solid {
  std::string name;
  WholeMesh mesh;
  Size offset;  ///< of its exact mitred offset
  double limit = 2.0;
};

using Outline = std::vector<std::array<double, 2>>;  // counter-clockwise
using Triangles = std::vector<std::array<std::uint64_t, 3>>;

Size size_of(const WholeMesh& m) {
  Size size = {volume(m), 0.0};
  for (const MeshFace& f : m.faces)
    size.area += 0.5 * norm(triangle_normal(m.points[f[0]], m.points[f[1]], m.points[f[2]]));
  return size;
}

/// A solid whose faces all touch a ball about the origin.
Solid circumscribed(const std::string& name, WholeMesh mesh, double radius, double limit = 2.0) {
  const Size size = size_of(mesh);
  const double scale = (radius + kOffset) / radius;
  return {name, std::move(mesh), {size.volume * scale * scale * scale, size.area * scale * scale}, limit};
}

/// The convex hull of points, faces all those planes of three of them that have none beyond.
WholeMesh hull(const std::vector<Double3>& points) {
  WholeMesh mesh;
  mesh.points = points;
  for (std::uint64_t a = 0; a < points.size(); ++a)
    for (std::uint64_t b = 0; b < points.size(); ++b)
      for (std::uint64_t c = 0; c < points.size(); ++c) {
        if (b == a || c == a || c == b) continue;
        const Double3 normal = unit_or_zero(triangle_normal(points[a], points[b], points[c]));
        if (!(norm(normal) > 0.5)) continue;
        // Of a face with more corners a fan about its first one, each triangle between neighbours on its rim.
        bool is_face = true;
        for (std::uint64_t d = 0; d < points.size() && is_face; ++d) {
          const double above = dot(points[d] - points[a], normal);
          is_face = above < 1e-9;
          if (!is_face || above < -1e-9) continue;
          is_face = d >= a && (d == b || d == c ||
                               dot(cross(points[c] - points[b], points[d] - points[b]), normal) > 0);
        }
        if (is_face) mesh.faces.push_back({a, b, c});
      }
  return mesh;
}

/// \param cap  triangles of the outline
Solid prism(const std::string& name, const Outline& outline, double height, const Triangles& cap,
            double limit = 2.0) {
  Solid solid{name, {}, {}, limit};
  const std::size_t n = outline.size();
  for (const double z : {-0.5 * height, 0.5 * height})
    for (const auto& p : outline) solid.mesh.points.push_back({p[0], p[1], z});
  double area = 0.0, rim = 0.0, turns = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = (i + 1) % n, k = (i + 2) % n;
    solid.mesh.faces.push_back({i, j, n + j});
    solid.mesh.faces.push_back({i, n + j, n + i});
    const double ux = outline[j][0] - outline[i][0], uy = outline[j][1] - outline[i][1];
    const double vx = outline[k][0] - outline[j][0], vy = outline[k][1] - outline[j][1];
    area += 0.5 * (outline[i][0] * outline[j][1] - outline[i][1] * outline[j][0]);
    rim += std::hypot(ux, uy);
    turns += std::tan(0.5 * std::atan2(ux * vy - uy * vx, ux * vx + uy * vy));
  }
  for (const auto& t : cap) {
    solid.mesh.faces.push_back({t[0], t[2], t[1]});
    solid.mesh.faces.push_back({n + t[0], n + t[1], n + t[2]});
  }
  area += kOffset * rim + kOffset * kOffset * turns;
  rim += 2.0 * kOffset * turns;
  const double tall = height + 2.0 * kOffset;
  solid.offset = {area * tall, 2.0 * area + rim * tall};
  return solid;
}

Triangles fan(std::uint64_t n) {
  Triangles cap;
  for (std::uint64_t i = 1; i + 1 < n; ++i) cap.push_back({0, i, i + 1});
  return cap;
}

Outline circle(std::size_t n, double outer, double inner) {
  Outline outline;
  for (std::size_t k = 0; k < n; ++k) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(n),
                 r = k % 2 == 0 ? outer : inner;
    outline.push_back({r * std::cos(angle), r * std::sin(angle)});
  }
  return outline;
}

Solid star() {
  Triangles cap;
  for (std::uint64_t k = 0; k < 10; k += 2) cap.push_back({(k + 9) % 10, k, k + 1});
  for (const std::uint64_t k : {3, 5, 7}) cap.push_back({1, k, k + 2});
  return prism("star", circle(10, 1.5, 0.9), 1.2, cap, 3.0);
}

/// A pyramid of many sides whose top is cut off: its profile moves in the plane through the middle of a side.
Solid frustum() {
  constexpr std::uint64_t kSides = 192;
  constexpr double kBottom = 1.2, kTop = 0.6, kHeight = 1.4;
  Solid solid{"frustum", {}, {}, 2.5};
  for (const auto& [r, z] : {std::pair{kBottom, 0.0}, std::pair{kTop, kHeight}})
    for (const auto& p : circle(kSides, r, r)) solid.mesh.points.push_back({p[0], p[1], z});
  for (std::uint64_t i = 0; i < kSides; ++i) {
    const std::uint64_t j = (i + 1) % kSides;
    solid.mesh.faces.push_back({i, j, kSides + j});
    solid.mesh.faces.push_back({i, kSides + j, kSides + i});
  }
  for (const auto& t : fan(kSides)) {
    solid.mesh.faces.push_back({t[0], t[2], t[1]});
    solid.mesh.faces.push_back({kSides + t[0], kSides + t[1], kSides + t[2]});
  }
  const double half = std::numbers::pi / double{kSides}, a = kBottom * std::cos(half),
               b = kTop * std::cos(half);
  const double slope = (a - b) / kHeight, out = kOffset * std::hypot(1.0, slope);
  const double below = a + out + slope * kOffset, above = b + out - slope * kOffset;
  const double tall = kHeight + 2.0 * kOffset, sides = double{kSides} * std::tan(half);
  solid.offset = {
      sides * tall * (below * below + below * above + above * above) / 3.0,
      sides * (below * below + above * above + (below + above) * std::hypot(below - above, tall))};
  return solid;
}

std::vector<Solid> ten_solids() {
  const double golden = std::numbers::phi, third = 1.0 / std::sqrt(3.0);
  std::vector<Double3> cube, pentagons;
  for (int c = 0; c < 8; ++c) cube.push_back({c & 1 ? 1.0 : -1.0, c & 2 ? 1.0 : -1.0, c & 4 ? 1.0 : -1.0});
  pentagons = cube;
  for (const double a : {-1.0 / golden, 1.0 / golden})
    for (const double b : {-golden, golden}) {
      pentagons.push_back({0, a, b});
      pentagons.push_back({a, b, 0});
      pentagons.push_back({b, 0, a});
    }
  std::vector<Double3> octahedron;
  for (std::size_t k = 0; k < 3; ++k)
    for (const double x : {-1.5, 1.5}) {
      octahedron.push_back({0, 0, 0});
      octahedron.back()[k] = x;
    }
  return {circumscribed("cube", hull(cube), 1.0),
          circumscribed("octahedron", hull(octahedron), 1.5 * third),
          circumscribed("tetrahedron", hull({{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}), third, 3.5),
          circumscribed("dodecahedron", hull(pentagons), golden * golden / std::sqrt(1.0 + golden * golden)),
          prism("hexagon", circle(6, 1.0, 1.0), 1.5, fan(6)),
          prism("L", {{-1, -1}, {1, -1}, {1, 0}, {0, 0}, {0, 1}, {-1, 1}}, 1.5,
                {{0, 1, 3}, {1, 2, 3}, {0, 3, 5}, {3, 4, 5}}),
          prism("cylinder", circle(192, 1.0, 1.0), 1.5, fan(192)),
          star(),
          prism("wedge", {{0, 0}, {2, 0}, {0, 1.5}}, 1.5, fan(3), 4.0),
          frustum()};
}

}  // namespace

TEST_CASE("resurface: mitred offsets of ten solids have the volumes and areas of exact ones", "[pipeline]") {
  const TempFolder folder;
  const Placement placement = rotation(unit(Double3{1, 2, 3}), 33.0);
  const std::string out = (folder / "out.ply").string();
  const std::vector<Solid> solids = ten_solids();
  CHECK(solids.size() == 10);
  for (const Solid& solid : solids) {
    CAPTURE(solid.name);
    WholeMesh mesh = solid.mesh;
    REQUIRE(is_closed(mesh));
    REQUIRE(volume(mesh) > 1.0);
    for (Double3& p : mesh.points) p = placement.apply(p);
    mesh.header.vertices = mesh.points.size(), mesh.header.faces = mesh.faces.size();
    mesh.header.double_positions = true;
    write_whole(folder / "in.ply", mesh);
    const CommandResult r =
        solid_command({"resurface", (folder / "in.ply").string(), "-o", out, "--resolution", "0.07",
                       "--offset", std::to_string(kOffset), "--corners", "mitre", "--mitre-limit",
                       std::to_string(solid.limit), "--force"});
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    const WholeMesh offset = read_whole(out);
    CHECK(is_closed(offset));
    const Size size = size_of(offset);
    std::printf("%s: volume %+.3f %%, area %+.3f %%\n", solid.name.c_str(),
                100.0 * (size.volume / solid.offset.volume - 1.0),
                100.0 * (size.area / solid.offset.area - 1.0));
    CHECK(size.volume == Approx(solid.offset.volume).epsilon(1e-3));
    CHECK(size.area == Approx(solid.offset.area).epsilon(2e-3));
  }
}

}  // namespace mitred_offsets_test
