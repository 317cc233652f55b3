// Sharp edges of meshes, cut at the faces of the lattice and followed by extraction: ribs, slots and corners within a cell.
#include "kernels/solid/mesh_creases.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <map>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/mesh/closest_face.h"
#include "kernels/solid/mesh_solid.h"
#include "octree/portable_math.h"
#include "tests/helpers/mesh_checks.h"

namespace mesh_creases_test {

using namespace tessera;
using namespace tessera::test;

namespace {

using Faces = std::vector<std::array<std::uint32_t, 3>>;

/// Positions in cells from the lattice origin.
struct Mesh {
  std::vector<Double3> position;
  Faces faces;
};

/// A prism over a polygon, counter-clockwise from above, turned so that no edge runs along the lattice.
Mesh prism(const std::vector<Double2>& outline, const std::vector<std::array<std::uint32_t, 3>>& cap,
           double height, const Double3& centre) {
  Mesh m;
  const SinCos a = sin_cos(0.4), b = sin_cos(0.7);
  for (const double z : {-0.5 * height, 0.5 * height})
    for (const Double2& p : outline) {
      const Double3 turned = {p[0] * a.cos - p[1] * a.sin, p[0] * a.sin + p[1] * a.cos, z};
      m.position.push_back(centre + Double3{turned[0], turned[1] * b.cos - turned[2] * b.sin,
                                            turned[1] * b.sin + turned[2] * b.cos});
    }
  const auto n = static_cast<std::uint32_t>(outline.size());
  for (const auto& f : cap) {
    m.faces.push_back({f[0], f[2], f[1]});
    m.faces.push_back({n + f[0], n + f[1], n + f[2]});
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t j = i + 1 == n ? 0 : i + 1;
    m.faces.push_back({i, j, n + j});
    m.faces.push_back({i, n + j, n + i});
  }
  return m;
}

/// A plate with a rib on it, little more than a cell wide, whose top is bevelled: cells along it hold two to four edges.
Mesh rib(const Double3& centre) {
  const std::vector<Double2> outline = {{-9, -6},   {9, -6},     {9, 0},      {0.6, 0},  {0.6, 1.3},
                                        {0.2, 1.7}, {-0.2, 1.7}, {-0.6, 1.3}, {-0.6, 0}, {-9, 0}};
  return prism(outline,
               {{0, 1, 3}, {1, 2, 3}, {0, 3, 8}, {0, 8, 9}, {3, 4, 8}, {4, 7, 8}, {4, 5, 7}, {5, 6, 7}}, 14.0,
               centre);
}

/// Sides that bend by 30 degrees, in steps below two cells.
Mesh dodecagon(const Double3& centre) {
  std::vector<Double2> outline;
  std::vector<std::array<std::uint32_t, 3>> cap;
  for (std::uint32_t i = 0; i < 12; ++i) {
    const SinCos t = sin_cos(kPi * i / 6.0);
    outline.push_back({3.1 * t.cos, 3.1 * t.sin});
    if (i >= 2) cap.push_back({0, i - 1, i});
  }
  return prism(outline, cap, 5.0, centre);
}

Long3 quantise(const Double3& p) {
  Long3 q;
  for (std::size_t a = 0; a < 3; ++a) q[a] = static_cast<std::int64_t>(std::floor(p[a] * 4096.0 + 0.5));
  return q;
}

Float3 normal_of(const Mesh& m, const std::array<std::uint32_t, 3>& f) {
  return narrow(unit(triangle_normal(m.position[f[0]], m.position[f[1]], m.position[f[2]])));
}

struct Extracted {
  IndexedMesh mesh;
  ExtractReport report;
  std::map<Int3, std::uint64_t> hash;  ///< per brick
  CreaseLines lines;
};

/// Where sharp edges pass faces of the lattice, cells from the block's corner.
std::vector<Double3> kink_places(const CreaseLines& lines) {
  std::vector<Double3> out;
  const Int3 size = {lines.cells[0] + 2, lines.cells[1] + 2, lines.cells[2] + 2};
  for (const CreaseChain& chain : lines.chains)
    for (std::uint32_t k = chain.first; k < chain.first + chain.count; ++k) {
      const int cell = static_cast<int>(chain.face / 3);
      const Int3 at = {cell % size[0] - 1, cell / size[0] % size[1] - 1, cell / size[0] / size[1] - 1};
      Double3 place;
      for (std::size_t a = 0; a < 3; ++a) place[a] = at[a] + static_cast<double>(lines.kinks[k].at[a]);
      out.push_back(place);
    }
  return out;
}

Extracted extract(const Mesh& m, const SolidBlock& block, bool follow, bool backwards = false) {
  std::map<std::uint64_t, LeafWindings> leaves;
  std::vector<LatticeCrossing> found;
  std::vector<Long3> corner;
  for (const Double3& p : m.position) corner.push_back(quantise(p));
  std::vector<SolidCrossing> crossings;
  Faces faces = m.faces;
  if (backwards) std::reverse(faces.begin(), faces.end());
  std::vector<Float3> normals;
  for (const auto& f : faces) {
    const QuantisedTriangle t = {corner[f[0]], corner[f[1]], corner[f[2]]};
    normals.push_back(normal_of(m, f));
    found.clear();
    find_crossings(t, {{0, 0, 0}, {256, 256, 256}}, 7, found);
    for (const LatticeCrossing& c : found) {
      LeafWindings& leaf = leaves[leaf_row_key({c.node[0] >> 3, c.node[1] >> 3, c.node[2] >> 3})];
      auto& winding = leaf.winding[static_cast<std::size_t>((c.node[1] & 7) + 8 * (c.node[2] & 7))];
      if (c.axis == 0) winding = static_cast<std::int16_t>(winding + c.winding);
    }
    found.clear();
    find_crossings(t, block.nodes(), 7, found);
    for (const LatticeCrossing& c : found) crossings.push_back(block.local_crossing(c, normals.back(), 0));
  }
  std::vector<LeafWindings> table;
  for (auto& [key, leaf] : leaves) table.push_back(leaf), table.back().key = key;
  const MeshSolid solid(LineWindings(std::move(table)), BorderWinding{});
  const std::vector<const SolidOperand*> operands = {&solid};
  SolidFieldReport roots;
  SolidTree tree;
  tree.push_operand(0);
  const DirectedField field = build_solid_field(block, std::move(crossings), operands, tree, {}, roots);
  MeshCreases creases(block, 25.0);
  creases.add(0, corner, faces, normals);
  const CreaseLines lines = creases.lines();
  ExtractOptions options;
  options.in_faces = options.bends = true;
  Extracted out;
  std::vector<Patch> patches;
  out.report = extract_surface(
      field, options,
      [&](Patch&& p) {
        out.hash[p.brick] = patch_hash(p);
        patches.push_back(std::move(p));
      },
      follow ? &lines : nullptr);
  out.mesh = weld(patches);
  out.lines = lines;
  return out;
}

/// Share of points of the sharp edges of the input that lie farther from the result than a fiftieth of a cell.
double share_beyond(const Mesh& m, const IndexedMesh& result) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<Float3>> edges;
  for (const auto& f : m.faces)
    for (std::size_t k = 0; k < 3; ++k) edges[std::minmax(f[k], f[(k + 1) % 3])].push_back(normal_of(m, f));
  const ClosestFaces there(result.position, result.faces, m.position[0]);
  double all = 0.0, beyond = 0.0;
  for (const auto& [edge, normals] : edges) {
    REQUIRE(normals.size() == 2);
    if (dot(normals[0], normals[1]) > 0.9f) continue;
    const Double3 &a = m.position[edge.first], &b = m.position[edge.second];
    const int steps = std::max(1, static_cast<int>(norm(b - a) * 20.0));
    for (int i = 0; i <= steps; ++i) {
      const Double3 p = a + (b - a) * (static_cast<double>(i) / steps) - m.position[0];
      const double off = there.closest(p, std::numeric_limits<double>::max(), ClosestFaces::kNone).square;
      all += 1.0;
      beyond += off > 0.02 * 0.02 ? 1.0 : 0.0;
    }
  }
  return beyond / all;
}

/// Two boxes that touch in a corner of each.
Mesh touching_boxes(const Double3& corner) {
  Mesh m;
  for (const auto& [low, high] : {std::pair{Double3{-6, -12, 0}, Double3{0, 0, 1.2}},
                                  std::pair{Double3{0, 0, -6}, Double3{6, 1.2, 0}}}) {
    const auto first = static_cast<std::uint32_t>(m.position.size());
    for (std::uint32_t c = 0; c < 8; ++c)
      m.position.push_back(
          corner + Double3{c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]});
    for (const auto& f : Faces{{0, 2, 3},
                               {0, 3, 1},
                               {4, 5, 7},
                               {4, 7, 6},
                               {0, 1, 5},
                               {0, 5, 4},
                               {2, 6, 7},
                               {2, 7, 3},
                               {0, 4, 6},
                               {0, 6, 2},
                               {1, 3, 7},
                               {1, 7, 5}})
      m.faces.push_back({first + f[0], first + f[1], first + f[2]});
  }
  return m;
}

constexpr Double3 kCentre = {128.31, 127.73, 96.42};  // on the sides of four bricks
const SolidBlock kWhole = {{64, 64, 64}, {128, 128, 64}};

}  // namespace

TEST_CASE("mesh creases: edges within a cell of each other, and bends of a few degrees, are met", "[unit]") {
  for (const Mesh& m : {rib(kCentre), dodecagon(kCentre)}) {
    const Extracted before = extract(m, kWhole, false), now = extract(m, kWhole, true);
    const MeshChecks checks = check_mesh(now.mesh);
    CHECK(checks.defects() == 0);
    CHECK(checks.boundary_edges == 0);
    CHECK(checks.genus == 0);
    CHECK(now.mesh.unresolved == 0);
    CHECK(now.report.crease_loops > 50);
    CAPTURE(now.report.unfollowed_loops, now.report.crease_loops);
    CHECK(4 * now.report.unfollowed_loops < now.report.crease_loops);
    const double off = share_beyond(m, now.mesh), was = share_beyond(m, before.mesh);
    CHECK(was > 0.03);
    CHECK(off < 0.3 * was);
  }
}

TEST_CASE("mesh creases: bricks are the same bytes in any block, faces in any order", "[property]") {
  const Mesh m = rib(kCentre);
  const Extracted whole = extract(m, kWhole, true);
  REQUIRE(whole.hash.size() == 4);
  CHECK(extract(m, kWhole, true, true).hash == whole.hash);
  std::map<Int3, std::uint64_t> alone;
  for (const Int3& brick : {Int3{64, 64, 64}, {128, 64, 64}, {64, 128, 64}, {128, 128, 64}})
    for (const auto& [at, hash] : extract(m, {brick, {64, 64, 64}}, true).hash) alone[at] = hash;
  CHECK(alone == whole.hash);
}

TEST_CASE("mesh creases: bodies that touch in a point of a lattice edge do not get it twice, in any block",
          "[property]") {
  // Edges of both begin there and pass different faces of the lattice at one place, beside the faces of bricks, too.
  for (const double y : {126.0, 127.0, 128.0, 129.0, 130.0}) {
    CAPTURE(y);
    const Mesh m = touching_boxes({126.3, y, 96.0});
    const Extracted whole = extract(m, kWhole, true);
    CHECK(whole.report.crease_loops > 20);
    const MeshChecks checks = check_mesh(whole.mesh);
    CHECK(checks.defects() == 0);
    CHECK(checks.boundary_edges == 0);
    std::vector<Double3> places = kink_places(whole.lines);
    CHECK(places.size() > 20);
    std::sort(places.begin(), places.end());
    CHECK(std::adjacent_find(places.begin(), places.end()) == places.end());
    std::map<Int3, std::uint64_t> alone;
    for (const Int3& brick : {Int3{64, 64, 64}, {128, 64, 64}, {64, 128, 64}, {128, 128, 64}})
      for (const auto& [at, hash] : extract(m, {brick, {64, 64, 64}}, true).hash) alone[at] = hash;
    CHECK(alone == whole.hash);
  }
}

TEST_CASE("mesh creases: edges of three faces, and holes, are left to the roots", "[unit]") {
  Mesh m = dodecagon(kCentre);
  m.faces.push_back(m.faces.back());  // a face twice: its edges have three
  const Extracted now = extract(m, kWhole, true);
  CHECK(check_mesh(now.mesh).defects() == 0);
}

}  // namespace mesh_creases_test
