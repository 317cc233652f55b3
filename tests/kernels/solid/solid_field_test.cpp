#include "kernels/solid/solid_field.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/solid/mesh_solid.h"
#include "octree/portable_math.h"
#include "tests/helpers/mesh_checks.h"

namespace solid_field_test {

using namespace tessera;
using namespace tessera::test;

namespace {

using Faces = std::vector<std::array<std::uint32_t, 3>>;
/// Positions in cells from the lattice origin.
struct Mesh {
  std::vector<Double3> position;
  Faces faces;
};

Mesh box(const Double3& low, const Double3& high) {
  Mesh m;
  for (int c = 0; c < 8; ++c)
    m.position.push_back({c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]});
  m.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
             {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return m;
}

/// A ball whose vertices lie anywhere.
Mesh ball(const Double3& centre, double radius, int rings) {
  Mesh m;
  const int sectors = 2 * rings;
  m.position.push_back(centre + Double3{0, 0, -radius});
  for (int r = 1; r < rings; ++r)
    for (int s = 0; s < sectors; ++s) {
      const SinCos a = sin_cos(kPi * r / rings), b = sin_cos(2.0 * kPi * s / sectors);
      m.position.push_back(centre + Double3{a.sin * b.cos, a.sin * b.sin, -a.cos} * radius);
    }
  m.position.push_back(centre + Double3{0, 0, radius});
  const auto at = [&](int r, int s) {
    return static_cast<std::uint32_t>(1 + (r - 1) * sectors + s % sectors);
  };
  const auto top = static_cast<std::uint32_t>(m.position.size() - 1);
  for (int s = 0; s < sectors; ++s) {
    m.faces.push_back({0, at(1, s + 1), at(1, s)});
    m.faces.push_back({top, at(rings - 1, s), at(rings - 1, s + 1)});
    for (int r = 1; r + 1 < rings; ++r) {
      m.faces.push_back({at(r, s), at(r, s + 1), at(r + 1, s)});
      m.faces.push_back({at(r, s + 1), at(r + 1, s + 1), at(r + 1, s)});
    }
  }
  return m;
}

Mesh together(Mesh a, const Mesh& b) {
  const auto base = static_cast<std::uint32_t>(a.position.size());
  a.position.insert(a.position.end(), b.position.begin(), b.position.end());
  for (const auto& f : b.faces) a.faces.push_back({f[0] + base, f[1] + base, f[2] + base});
  return a;
}

Long3 quantise(const Double3& p) {
  Long3 q;
  for (std::size_t a = 0; a < 3; ++a) q[a] = static_cast<std::int64_t>(std::floor(p[a] * 4096.0 + 0.5));
  return q;
}

QuantisedTriangle triangle(const Mesh& m, const std::array<std::uint32_t, 3>& f) {
  return {quantise(m.position[f[0]]), quantise(m.position[f[1]]), quantise(m.position[f[2]])};
}

/// What the stage "lines" makes of a mesh in cells [0, 256).
MeshSolid make_solid(const Mesh& m) {
  std::map<std::uint64_t, LeafWindings> leaves;
  std::map<std::pair<Long3, Long3>, std::int64_t> edges;
  std::vector<LatticeCrossing> found;
  for (const auto& f : m.faces) {
    const QuantisedTriangle t = triangle(m, f);
    for (std::size_t k = 0; k < 3; ++k) {
      const Long3 &a = t[k], &b = t[(k + 1) % 3];
      if (a < b) ++edges[{a, b}];
      if (b < a) --edges[{b, a}];
    }
    find_crossings(t, {{0, 0, 0}, {256, 256, 256}}, 7, found);
  }
  for (const LatticeCrossing& c : found) {
    LeafWindings& leaf = leaves[leaf_row_key({c.node[0] >> 3, c.node[1] >> 3, c.node[2] >> 3})];
    ++leaf.crossings;
    auto& winding = leaf.winding[static_cast<std::size_t>((c.node[1] & 7) + 8 * (c.node[2] & 7))];
    if (c.axis == 0) winding = static_cast<std::int16_t>(winding + c.winding);
  }
  std::vector<LeafWindings> table;
  for (auto& [key, leaf] : leaves) table.push_back(leaf), table.back().key = key;
  std::vector<BorderEdge> border;
  for (const auto& [ends, count] : edges)
    if (count != 0) border.push_back({ends.first, ends.second, count});
  return MeshSolid(LineWindings(std::move(table)), BorderWinding(std::move(border)));
}

std::vector<SolidCrossing> crossings_of(const Mesh& m, const SolidBlock& block, std::uint8_t operand) {
  std::vector<SolidCrossing> out;
  std::vector<LatticeCrossing> found;
  for (const auto& f : m.faces) {
    found.clear();
    find_crossings(triangle(m, f), block.nodes(), 7, found);
    const Float3 n = narrow(unit(triangle_normal(m.position[f[0]], m.position[f[1]], m.position[f[2]])));
    for (const LatticeCrossing& c : found) out.push_back(block.local_crossing(c, n, operand));
  }
  return out;
}

struct Combination {
  std::vector<Mesh> meshes;
  SolidTree tree;
};

DirectedField make_field(const Combination& c, const SolidBlock& block, SolidFieldReport& report) {
  std::vector<MeshSolid> solids;
  for (const Mesh& m : c.meshes) solids.push_back(make_solid(m));
  std::vector<const SolidOperand*> operands;
  std::vector<SolidCrossing> crossings;
  std::vector<Int3> closing;
  for (std::size_t o = 0; o < solids.size(); ++o) {
    operands.push_back(&solids[o]);
    const auto own = crossings_of(c.meshes[o], block, static_cast<std::uint8_t>(o));
    std::vector<std::uint8_t> occupied(block.slots(), 0);
    for (const SolidCrossing& x : own) occupied[x.edge / 1536] = 1;
    solids[o].membrane_leaves(block, occupied, closing);
    crossings.insert(crossings.end(), own.begin(), own.end());
  }
  return build_solid_field(block, std::move(crossings), operands, c.tree, closing, report);
}

Combination alone(Mesh m) {
  Combination c;
  c.meshes.push_back(std::move(m));
  c.tree.push_operand(0);
  return c;
}

struct Surface {
  IndexedMesh mesh;
  MeshChecks checks;
  SolidFieldReport roots;
};

const SolidBlock kWhole{{64, 64, 64}, {128, 128, 128}};

Surface surface_of(const Combination& c) {
  Surface out;
  std::vector<Patch> patches;
  ExtractOptions options;
  options.in_faces = true;
  extract_surface(make_field(c, kWhole, out.roots), options,
                  [&](Patch&& p) { patches.push_back(std::move(p)); });
  out.mesh = weld(patches);
  out.checks = check_mesh(out.mesh);
  return out;
}

void require_closed(const Surface& s) {
  CHECK(s.mesh.unresolved == 0);
  CHECK(s.checks.defects() == 0);
  CHECK(s.checks.boundary_edges == 0);
}

double volume(const IndexedMesh& m) {
  double sum = 0.0;
  for (const auto& f : m.faces)
    sum += dot(m.position[f[0]] - Double3{128, 128, 128},
               cross(m.position[f[1]] - Double3{128, 128, 128}, m.position[f[2]] - Double3{128, 128, 128}));
  return sum / 6.0;
}

/// Solid angle of all faces over 4 pi: the definition.
double winding_by_definition(const Mesh& m, const Double3& x) {
  double sum = 0.0;
  for (const auto& f : m.faces) {
    const QuantisedTriangle q = triangle(m, f);
    std::array<Double3, 3> p;
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t a = 0; a < 3; ++a) p[c][a] = static_cast<double>(q[c][a]) / 4096.0 - x[a];
    const double la = norm(p[0]), lb = norm(p[1]), lc = norm(p[2]);
    sum += 2.0 * std::atan2(dot(p[0], cross(p[1], p[2])), la * lb * lc + dot(p[0], p[1]) * lc +
                                                              dot(p[1], p[2]) * la + dot(p[0], p[2]) * lb);
  }
  return sum / (4.0 * kPi);
}

}  // namespace

TEST_CASE("lattice crossings: a closed mesh on the nodes themselves turns every line to zero", "[unit]") {
  // Corners, edges and whole faces of these boxes lie on nodes and lines of the lattice.
  for (const Mesh& m : {box({70, 70, 70}, {75, 76, 77}), box({70.5, 70, 71}, {73, 73.25, 79}),
                        together(box({70, 70, 70}, {74, 74, 74}), box({72, 70, 70}, {78, 74, 74}))}) {
    const MeshSolid solid = make_solid(m);
    CHECK(solid.lines().closes());
    CHECK(solid.border().empty());
    // Whatever the axis: turns add up to zero around every lattice face.
    std::map<std::pair<Int3, int>, int> winding;
    std::vector<LatticeCrossing> found;
    for (const auto& f : m.faces) find_crossings(triangle(m, f), {{60, 60, 60}, {90, 90, 90}}, 7, found);
    for (const LatticeCrossing& c : found) winding[{c.node, c.axis}] += c.winding;
    std::size_t wrong = 0;
    Int3 n;
    for (n[2] = 65; n[2] < 85; ++n[2])
      for (n[1] = 65; n[1] < 85; ++n[1])
        for (n[0] = 65; n[0] < 85; ++n[0])
          for (int a = 0; a < 3; ++a) {
            const int b = (a + 1) % 3;
            Int3 na = n, nb = n;
            ++na[static_cast<std::size_t>(a)], ++nb[static_cast<std::size_t>(b)];
            const auto of = [&](const Int3& at, int axis) {
              const auto it = winding.find({at, axis});
              return it == winding.end() ? 0 : it->second;
            };
            wrong += of(n, a) + of(na, b) != of(n, b) + of(nb, a);
          }
    CHECK(wrong == 0);
  }
}

TEST_CASE("lattice crossings: large triangles and small ones agree", "[property]") {
  // The same plane once as two triangles that are wider than 64 bits allow for, once cut into squares.
  std::vector<LatticeCrossing> whole, parts;
  const NodeBox nodes{{1000, 1000, 0}, {1040, 1040, 2000}};
  const auto height = [](double x, double y) { return 0.25 * x + 0.125 * y; };
  const auto corner = [&](double x, double y) { return quantise({x, y, height(x, y)}); };
  find_crossings({corner(0, 0), corner(4096, 0), corner(4096, 4096)}, nodes, 7, whole);
  find_crossings({corner(0, 0), corner(4096, 4096), corner(0, 4096)}, nodes, 7, whole);
  for (int y = 992; y < 1056; y += 8)
    for (int x = 992; x < 1056; x += 8) {
      find_crossings({corner(x, y), corner(x + 8, y), corner(x + 8, y + 8)}, nodes, 7, parts);
      find_crossings({corner(x, y), corner(x + 8, y + 8), corner(x, y + 8)}, nodes, 7, parts);
    }
  const auto order = [](const LatticeCrossing& l, const LatticeCrossing& r) {
    return std::tie(l.axis, l.node) < std::tie(r.axis, r.node);
  };
  std::sort(whole.begin(), whole.end(), order);
  std::sort(parts.begin(), parts.end(), order);
  REQUIRE(whole.size() == parts.size());
  REQUIRE(whole.size() > 1600);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    CHECK(whole[i].node == parts[i].node);
    CHECK(whole[i].t == parts[i].t);
    CHECK(whole[i].winding == parts[i].winding);
  }
}

TEST_CASE("winding numbers: lines and border against the sum of solid angles", "[property]") {
  Mesh open = ball({128.3, 127.9, 128.1}, 21.7, 14);
  open.faces.resize(open.faces.size() - 40);  // a gap
  Mesh two = together(open, box({120.3, 120.4, 120.6}, {140.1, 140.2, 140.7}));
  two.faces.pop_back();
  for (const Mesh& mesh : {open, two}) {
    const MeshSolid solid = make_solid(mesh);
    CHECK(solid.border().size() > 4);
    double worst = 0.0;
    std::size_t wrong = 0, checked = 0;
    for (int k = 10; k < 22; ++k)
      for (int j = 10; j < 22; ++j)
        for (int i = 10; i < 22; ++i) {
          const SolidBlock block{{i * 8 & ~63, j * 8 & ~63, k * 8 & ~63}, {64, 64, 64}};
          std::vector<SolidCrossing> own;
          for (const SolidCrossing& c : crossings_of(mesh, block, 0))
            if (c.edge / 1536 == block.slot({i & 7, j & 7, k & 7})) own.push_back(c);
          std::vector<float> w(512);
          if ((i + j + k) % 5 != 0) continue;
          BorderRegions regions;
          solid.windings({i, j, k}, own, w, regions);
          for (std::size_t n = 0; n < 512; n += 37) {
            const Double3 x = {8.0 * i + static_cast<double>(n & 7),
                               8.0 * j + static_cast<double>(n >> 3 & 7),
                               8.0 * k + static_cast<double>(n >> 6)};
            const double truth = winding_by_definition(mesh, x);
            wrong += (truth > 0.5) != (w[n] > 0.5f) && std::fabs(truth - 0.5) > 1e-3;
            // Far from 1/2 a leaf may take its corner's value.
            if (std::fabs(truth - 0.5) < 0.1) worst = std::max(worst, std::fabs(truth - double{w[n]}));
            ++checked;
          }
        }
    CHECK(checked > 3000);
    CHECK(wrong == 0);
    CHECK(worst < 2e-3);
  }
}

TEST_CASE("winding numbers: a million nodes are on the side that exact ray parity tells", "[property]") {
  __extension__ using Wide = __int128;
  constexpr int kFirst = 64, kEnd = 192;
  // Anywhere, and through nodes: there the same moved node decides (lattice_crossings.h).
  for (const Mesh& mesh : {ball({128.3, 127.9, 128.1}, 57.7, 30), ball({128, 128, 128}, 56, 8),
                           box({80, 81, 82}, {170, 175, 180})}) {
    std::vector<QuantisedTriangle> faces;
    for (const auto& f : mesh.faces) faces.push_back(triangle(mesh, f));
    std::vector<std::uint8_t> truth(128 * 128 * 128, 0);
    for (int y = kFirst; y < kEnd; ++y)
      for (int x = kFirst; x < kEnd; ++x)
        for (const QuantisedTriangle& t : faces) {
          // A line along z through (x, y): on which side of the triangle's edges it passes.
          int inner = 0, outer = 0;
          for (std::size_t e = 0; e < 3; ++e) {
            const Long3 &p = t[e], &q = t[(e + 1) % 3];
            const std::int64_t du = q[0] - p[0], dv = q[1] - p[1];
            std::int64_t side = du * (y * kSolidQuanta - p[1]) - dv * (x * kSolidQuanta - p[0]);
            if (side == 0) side = dv != 0 ? -dv : du;
            (side > 0 ? inner : outer) += 1;
          }
          if (inner != 3 && outer != 3) continue;
          std::array<Wide, 3> b, c, n;
          for (std::size_t k = 0; k < 3; ++k) b[k] = t[1][k] - t[0][k], c[k] = t[2][k] - t[0][k];
          for (std::size_t k = 0; k < 3; ++k)
            n[k] = b[(k + 1) % 3] * c[(k + 2) % 3] - b[(k + 2) % 3] * c[(k + 1) % 3];
          for (int z = kFirst; z < kEnd; ++z) {
            Wide above = n[0] * (x * kSolidQuanta - t[0][0]) + n[1] * (y * kSolidQuanta - t[0][1]) +
                         n[2] * (z * kSolidQuanta - t[0][2]);
            for (std::size_t k = 0; k < 3 && above == 0; ++k) above = n[k];
            if ((above < 0) == (n[2] > 0))
              truth[static_cast<std::size_t>(x - kFirst + 128 * (y - kFirst + 128 * (z - kFirst)))] ^= 1;
          }
        }
    const MeshSolid solid = make_solid(mesh);
    REQUIRE(solid.border().empty());
    std::size_t wrong = 0, checked = 0, inside = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const SolidBlock block{{64 + 64 * (corner & 1), 64 + 64 * (corner >> 1 & 1), 64 + 64 * (corner >> 2)},
                             {64, 64, 64}};
      std::vector<std::vector<SolidCrossing>> own(block.slots());
      for (const SolidCrossing& c : crossings_of(mesh, block, 0)) own[c.edge / 1536].push_back(c);
      std::vector<float> w(512);
      BorderRegions regions;
      for (std::size_t s = 0; s < block.slots(); ++s) {
        const Int3 leaf = block.leaf(s);
        if (*std::min_element(leaf.begin(), leaf.end()) < 0 ||
            *std::max_element(leaf.begin(), leaf.end()) > 7)
          continue;
        const Int3 global = {leaf[0] + block.origin[0] / 8, leaf[1] + block.origin[1] / 8,
                             leaf[2] + block.origin[2] / 8};
        solid.windings(global, own[s], w, regions);
        for (std::size_t i = 0; i < 512; ++i, ++checked) {
          const Int3 node = {8 * global[0] + static_cast<int>(i & 7),
                             8 * global[1] + static_cast<int>(i >> 3 & 7),
                             8 * global[2] + static_cast<int>(i >> 6)};
          const bool in = truth[static_cast<std::size_t>(
                              node[0] - kFirst + 128 * (node[1] - kFirst + 128 * (node[2] - kFirst)))] != 0;
          wrong += in != (w[i] > 0.5f);
          inside += in;
        }
      }
    }
    CHECK(checked == 128 * 128 * 128);
    CHECK(inside > 500'000);
    CHECK(wrong == 0);
  }
}

TEST_CASE("winding numbers: a sheet is told from a solid with holes by a sample of the leaves", "[unit]") {
  Mesh sheet;
  constexpr std::uint32_t kSide = 40;
  for (std::uint32_t j = 0; j <= kSide; ++j)
    for (std::uint32_t i = 0; i <= kSide; ++i)
      sheet.position.push_back(
          {48.3 + 4.0 * i, 48.1 + 4.0 * j, 128.0 + 15.0 * sin_cos(0.2 * i + 0.15 * j).sin});
  for (std::uint32_t j = 0; j < kSide; ++j)
    for (std::uint32_t i = 0; i < kSide; ++i) {
      const std::uint32_t a = i + (kSide + 1) * j, b = a + kSide + 1;
      sheet.faces.push_back({a, a + 1, b + 1});
      sheet.faces.push_back({a, b + 1, b});
    }
  CHECK(make_solid(sheet).shares(500).half > 0.8);
  // Two of them 20 cells apart, without sides: most of what lies between them is inside, whichever way all faces show.
  Mesh plate = sheet;
  for (const Double3& p : sheet.position) plate.position.push_back(p - Double3{0.0, 0.0, 20.0});
  const auto below = static_cast<std::uint32_t>(sheet.position.size());
  for (const auto& f : sheet.faces) plate.faces.push_back({f[0] + below, f[2] + below, f[1] + below});
  const MeshSolid::Shares outwards = make_solid(plate).shares(500);
  CHECK(outwards.half < 0.5);
  CHECK(outwards.inside > 0.2);
  CHECK(outwards.turned == 0.0);
  for (auto& f : plate.faces) std::swap(f[1], f[2]);
  const MeshSolid::Shares inwards = make_solid(plate).shares(500);
  CHECK(inwards.inside == 0.0);
  CHECK(inwards.turned > 0.2);
  Mesh solid = ball({128.3, 127.9, 128.1}, 57.7, 30);
  CHECK(make_solid(solid).shares(500).half == 0.0);
  solid.faces.resize(solid.faces.size() - 40);
  CHECK(make_solid(solid).shares(500).half < 0.1);
  CHECK(make_solid(solid).shares(0).half == 0.0);
}

TEST_CASE("winding numbers: a node in the shadow of several border edges at once", "[unit]") {
  // A fan whose border zigzags within the plane y = 100: along x every edge from it casts its shadow on the same nodes.
  Mesh fan;
  fan.position.push_back({110, 130.3, 104.2});
  for (int i = 0; i <= 8; ++i) fan.position.push_back({100.0 + 3 * i, 100, i % 2 == 0 ? 100.0 : 108.0});
  for (std::uint32_t i = 1; i <= 8; ++i) fan.faces.push_back({0, i, i + 1});
  const MeshSolid solid = make_solid(fan);
  const SolidBlock block{{64, 64, 64}, {128, 128, 64}};
  const auto crossings = crossings_of(fan, block, 0);
  std::vector<float> w(512);
  BorderRegions regions;
  for (int i = 16; i < 18; ++i) {  // beyond the fan
    const Int3 leaf = {i, 12, 12};
    std::vector<SolidCrossing> own;
    for (const SolidCrossing& c : crossings)
      if (c.edge / 1536 == block.slot({leaf[0] - 8, leaf[1] - 8, leaf[2] - 8})) own.push_back(c);
    solid.windings(leaf, own, w, regions);
    for (std::size_t n = 0; n < 512; ++n) {
      const Double3 x = {8.0 * leaf[0] + static_cast<double>(n & 7),
                         8.0 * leaf[1] + static_cast<double>(n >> 3 & 7),
                         8.0 * leaf[2] + static_cast<double>(n >> 6)};
      CHECK(std::fabs(double{w[n]} - winding_by_definition(fan, x)) < 0.1);
    }
  }
}

TEST_CASE("solid field: a box comes out as it is, edges and corners sharp", "[property]") {
  for (const Double3& low : {Double3{90.3, 91.4, 92.45}, Double3{90, 91, 92}}) {
    const Double3 high = {150.6, 140.7, 139.2};
    const Surface s = surface_of(alone(box(low, high)));
    require_closed(s);
    CHECK(s.checks.components == 1);
    CHECK(s.checks.genus == 0);
    const double truth = (high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2]);
    CHECK(volume(s.mesh) == Approx(truth).epsilon(5e-4));
    double worst = 0.0;
    for (const Double3& p : s.mesh.position) {
      double out = 0.0, in = 1e9;
      for (std::size_t a = 0; a < 3; ++a) {
        out = std::max({out, low[a] - p[a], p[a] - high[a]});
        in = std::min({in, std::fabs(p[a] - low[a]), std::fabs(high[a] - p[a])});
      }
      worst = std::max(worst, std::max(out, in));
    }
    CHECK(worst < 0.02);
  }
}

TEST_CASE("solid field: a box on the lattice keeps its corners", "[property]") {
  // Faces through nodes, and within what roots are kept off them.
  for (const double shift : {0.0, 0x1p-10, -0x1p-10, 0x1p-7, -0x1p-7, 0.3})
    for (const double other : {0.0, 0.4, -0x1p-8}) {
      CAPTURE(shift, other);
      const Double3 low = {90 + shift, 91 + shift, 92 + other},
                    high = {110 + shift, 120 + other, 115 - shift};
      const Surface s = surface_of(alone(box(low, high)));
      require_closed(s);
      for (int c = 0; c < 8; ++c) {
        const Double3 corner = {c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]};
        double nearest = 1e9;
        for (const Double3& p : s.mesh.position) nearest = std::min(nearest, norm(p - corner));
        CHECK(nearest < 0.01);
      }
      for (const Double3& p : s.mesh.position) {
        double out = 0.0;
        for (std::size_t a = 0; a < 3; ++a) out = std::max({out, low[a] - p[a], p[a] - high[a]});
        CHECK(out < 0.02);
      }
    }
}

TEST_CASE("solid field: doubled walls, overlaps and turned parts have one outside", "[property]") {
  Mesh doubled = together(box({90, 90, 90}, {140, 140, 140}), box({90.2, 90.2, 90.2}, {139.8, 139.8, 139.8}));
  Mesh overlap =
      together(box({90, 90, 90}, {130, 130, 130}), box({110.5, 110.5, 110.5}, {150.2, 150.2, 150.2}));
  const Surface one = surface_of(alone(doubled));
  require_closed(one);
  CHECK(one.checks.components == 1);
  CHECK(volume(one.mesh) == Approx(125000.0).epsilon(1e-3));
  const Surface two = surface_of(alone(overlap));
  require_closed(two);
  CHECK(volume(two.mesh) == Approx(64000.0 + 39.7 * 39.7 * 39.7 - 19.5 * 19.5 * 19.5).epsilon(1e-3));
}

TEST_CASE("solid field: gaps are closed by membranes, and said to be", "[property]") {
  Mesh open = ball({128.3, 127.9, 128.1}, 31.7, 20);
  open.faces.resize(open.faces.size() - 240);
  const Surface s = surface_of(alone(open));
  require_closed(s);
  CHECK(s.checks.components == 1);
  CHECK(s.checks.genus == 0);
  CHECK(s.roots.membrane_roots > 100);
  CHECK(s.roots.missing_nodes == 0);
  CHECK(s.roots.shallow_roots * 10 < s.roots.roots);
  // A cap is missing: less than the ball, more than half of it.
  const double all = 4.0 / 3.0 * kPi * 31.7 * 31.7 * 31.7;
  CHECK(volume(s.mesh) < all);
  CHECK(volume(s.mesh) > 0.7 * all);
}

TEST_CASE("solid field: booleans are exact along new edges", "[property]") {
  using Join = SolidTree::Join;
  const Double3 low = {90.3, 91.4, 92.45}, high = {150.6, 140.7, 139.2};
  const Double3 low2 = {120.15, 110.2, 100.7}, high2 = {170.1, 160.3, 120.9};
  const double v1 = (high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2]);
  const double v2 = (high2[0] - low2[0]) * (high2[1] - low2[1]) * (high2[2] - low2[2]);
  const double common = (high[0] - low2[0]) * (high[1] - low2[1]) * (high2[2] - low2[2]);
  for (const auto& [join, truth] :
       {std::pair{Join::kUnite, v1 + v2 - common}, std::pair{Join::kSubtract, v1 - common},
        std::pair{Join::kIntersect, common}}) {
    Combination c;
    c.meshes = {box(low, high), box(low2, high2)};
    c.tree.push_operand(0);
    c.tree.push_operand(1);
    c.tree.push_join(join);
    REQUIRE(c.tree.is_complete(2));
    const Surface s = surface_of(c);
    require_closed(s);
    CHECK(s.checks.components == 1);
    CHECK(s.checks.genus == 0);
    CHECK(volume(s.mesh) == Approx(truth).epsilon(1e-3));
    // Every vertex on a face of a box, those at new edges on one of each.
    double worst = 0.0;
    for (const Double3& p : s.mesh.position) {
      double near = 1e9;
      for (std::size_t a = 0; a < 3; ++a)
        for (const double plane : {low[a], high[a], low2[a], high2[a]})
          near = std::min(near, std::fabs(p[a] - plane));
      worst = std::max(worst, near);
    }
    CHECK(worst < 0.02);
  }
}

TEST_CASE("solid field: the same patches from any block", "[property]") {
  Mesh open = ball({128.3, 127.9, 128.1}, 31.7, 20);
  open.faces.resize(open.faces.size() - 240);
  const Combination c = alone(open);
  std::map<std::uint64_t, std::uint64_t> whole, single;
  SolidFieldReport report;
  extract_surface(make_field(c, kWhole, report), {},
                  [&](Patch&& p) { whole[brick_key(p.brick)] = patch_hash(p); });
  for (int b = 0; b < 8; ++b) {
    const SolidBlock block{{64 + 64 * (b & 1), 64 + 64 * (b >> 1 & 1), 64 + 64 * (b >> 2)}, {64, 64, 64}};
    extract_surface(make_field(c, block, report), {},
                    [&](Patch&& p) { single[brick_key(p.brick)] = patch_hash(p); });
  }
  CHECK(whole.size() == 8);
  CHECK(whole == single);
}

TEST_CASE("solid tree: programs that are none are told", "[unit]") {
  SolidTree tree;
  CHECK_FALSE(tree.is_complete(1));
  tree.push_operand(0);
  CHECK(tree.is_complete(1));
  CHECK_FALSE(tree.is_complete(0));
  tree.push_join(SolidTree::Join::kUnite);
  CHECK_FALSE(tree.is_complete(1));
}

}  // namespace solid_field_test
