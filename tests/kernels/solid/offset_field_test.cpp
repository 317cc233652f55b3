#include "kernels/solid/offset_field.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/mesh/patch_mesh.h"
#include "kernels/solid/solid_shape.h"

namespace offset_field_test {

using namespace tessera;

namespace {

const Lattice kLattice = {0.25, {0, 0, 0}};

/// The surface of a shape within the brick (1, 1, 1), as a mesh, and the signs of all nodes.
struct Surface {
  MeshBlock mesh;
  std::vector<LeafSigns> signs;
};
Surface surface_of(const SolidShape& shape) {
  const SolidBlock block = {{64, 64, 64}, {64, 64, 64}};
  const ShapeSolid solid(shape, kLattice);
  std::vector<SolidCrossing> crossings;
  for (int z = 7; z <= 16; ++z)
    for (int y = 7; y <= 16; ++y)
      for (int x = 7; x <= 16; ++x) solid.find_crossings(block, {x, y, z}, 0, crossings);
  SolidTree tree;
  tree.push_operand(0);
  const SolidOperand* operand = &solid;
  SolidFieldReport report;
  const DirectedField field = build_solid_field(block, std::move(crossings), {&operand, 1}, tree, {}, report);
  Surface made;
  append_leaf_signs(field, made.signs);
  ExtractOptions options;
  options.names = true;
  extract_surface(field, options, [&](Patch&& patch) {
    if (!patch.faces.empty()) made.mesh = make_mesh_block(patch, {kLattice, {0, 0, 0}, true, false});
  });
  return made;
}

OffsetSampler sampler_of(const Surface& surface, const Int3& corner, const RowSigns& signs,
                         const OffsetLayer& layer) {
  MeshBlock mesh = surface.mesh;
  quantise_cells(kLattice, corner, mesh);
  return OffsetSampler(std::move(mesh), corner, signs, layer);
}

DirectedField field_of(const Surface& surface, const Int3& corner, const Int3& cells,
                       const OffsetLayer& layer) {
  const RowSigns signs(surface.signs);
  const OffsetSampler sampler = sampler_of(surface, corner, signs, layer);
  const std::vector<Int3> leaves = sampler.leaves(cells);
  return build_sampled_field(corner, cells, leaves, sampler, OffsetSampler::kNear);
}

std::unique_ptr<SolidShape> ball() {
  return make_shape("sphere", {24.1, 23.9, 24.0, 3.0}, {});  // 12 cells about (96.4, 95.6, 96)
}

}  // namespace

TEST_CASE("offset: rows tell the sign of every node, far from the surface too", "[unit]") {
  const auto shape = ball();
  const RowSigns signs(surface_of(*shape).signs);
  std::size_t wrong = 0, inside = 0;
  for (int z = 0; z < 192; z += 3)
    for (int y = 0; y < 192; ++y)
      for (int x = 0; x < 192; ++x) {
        const LeafWords words = signs.at({x >> 3, y >> 3, z >> 3});
        const bool in = (words[static_cast<std::size_t>(z & 7)] >> DirectedField::bit(x, y) & 1) != 0;
        wrong += in != (shape->value({x * 0.25, y * 0.25, z * 0.25}) < 0.0);
        inside += in;
      }
  CHECK(wrong == 0);
  CHECK(inside > 2000);
}

TEST_CASE("offset: values and roots are those of a ball's parallel surfaces", "[unit]") {
  const Surface surface = surface_of(*ball());
  REQUIRE(surface.mesh.faces.size() > 1000);
  const Double3 centre = {96.4, 95.6, 96.0};
  struct Case {
    OffsetLayer layer;
    std::vector<double> radii;
  };
  for (const Case& c : {Case{{-INFINITY, 5.0}, {17.0}}, Case{{-INFINITY, -4.5}, {7.5}},
                        Case{{-3.0, 0.0}, {9.0, 12.0}}, Case{{-1.0, 4.0}, {11.0, 16.0}}}) {
    CAPTURE(c.layer.low, c.layer.high);
    const DirectedField field = field_of(surface, {64, 64, 64}, {64, 64, 64}, c.layer);
    REQUIRE(field.roots.size() > 100);
    double worst = 0.0, tilt = 1.0;
    std::vector<std::size_t> hits(c.radii.size(), 0);
    for (const BandLeaf& leaf : field.leaves)
      for (std::size_t axis = 0; axis < 3; ++axis)
        for (int n = 0; n < 512; ++n) {
          const Int3 at = {leaf.origin[0] + (n & 7), leaf.origin[1] + (n >> 3 & 7),
                           leaf.origin[2] + (n >> 6)};
          const EdgeRoot* root = field.root_at(at[0], at[1], at[2], static_cast<int>(axis));
          if (!root) continue;
          Double3 p = {64.0 + at[0], 64.0 + at[1], 64.0 + at[2]};
          p[axis] += double{root->t} + double{root->offset} / double{root->normal[axis]};
          const Double3 out = p - centre;
          std::size_t best = 0;
          for (std::size_t r = 1; r < c.radii.size(); ++r)
            if (std::fabs(norm(out) - c.radii[r]) < std::fabs(norm(out) - c.radii[best])) best = r;
          ++hits[best];
          worst = std::max(worst, std::fabs(norm(out) - c.radii[best]));
          const bool lower = c.radii.size() > 1 && best == 0;
          tilt = std::min(tilt, dot(wide(root->normal), unit(out)) * (lower ? -1.0 : 1.0));
        }
    CHECK(worst < 0.03);  // a chord of a cell is 0.01 off, and roots keep a 64th off nodes
    CHECK(tilt > 0.99);
    for (const std::size_t h : hits) CHECK(h > 100);
  }
}

TEST_CASE("offset: the same bits in whatever block", "[property]") {
  const Surface surface =
      surface_of(*make_shape("box", {21, 21.3, 22, 27.1, 26.9, 26}, rotation({0, 0, 1}, 20.0)));
  const OffsetLayer layer = {-2.5, 1.5};
  const DirectedField small = field_of(surface, {64, 64, 64}, {64, 64, 64}, layer);
  const DirectedField large = field_of(surface, {0, 0, 0}, {192, 192, 192}, layer);
  std::size_t roots = 0, nodes = 0;
  for (int k = -1; k <= 65; ++k)
    for (int j = -1; j <= 65; ++j)
      for (int i = -1; i <= 65; ++i) {
        const BandLeaf *a = small.leaf_at(i, j, k), *b = large.leaf_at(i + 64, j + 64, k + 64);
        const std::size_t n = BandLeaf::node(i, j, k);
        const bool valid = a && a->is_valid(n);
        REQUIRE(valid == (b && b->is_valid(n)));
        if (!valid) continue;
        ++nodes;
        REQUIRE(a->value(n) == b->value(n));
        for (int axis = 0; axis < 3; ++axis) {
          const EdgeRoot* r = i == 65 || j == 65 || k == 65 ? nullptr : small.root_at(i, j, k, axis);
          if (!r) continue;
          const EdgeRoot* s = large.root_at(i + 64, j + 64, k + 64, axis);
          REQUIRE(s);
          REQUIRE(r->t == s->t);
          REQUIRE(r->normal == s->normal);
          ++roots;
        }
      }
  CHECK(nodes > 3000);
  CHECK(roots > 1000);
}

TEST_CASE("offset: a mitred distance goes on without a step where an edge runs out in a smooth face",
          "[unit]") {
  // A roof whose edge fades from 84 to 180 degrees along x, its triangles a cell wide, cut irregularly.
  constexpr int kLength = 40, kHalf = 12, kMiddle = 16, kTop = 32;
  MeshBlock roof;
  for (int y = -kHalf; y <= kHalf; ++y)
    for (int x = 0; x <= kLength; ++x)
      roof.position.push_back({x + 0.1 * ((x * 7 + y * 3 + 40) % 5 - 2), double{kMiddle} + y,
                               double{kTop} - 1.1 * std::max(0, 30 - x) / 30.0 * std::abs(y)});
  const auto at = [](int x, int y) { return static_cast<std::uint32_t>((y + kHalf) * (kLength + 1) + x); };
  for (int y = -kHalf; y < kHalf; ++y)
    for (int x = 0; x < kLength; ++x) {
      roof.faces.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      roof.faces.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  roof.face_flags.resize(roof.faces.size(), 0);
  const RowSigns outside({});
  const OffsetSampler sampler(std::move(roof), {0, 0, 0}, outside, {-INFINITY, 8.0, 2.0});
  constexpr int kSteps = 64;
  double steepest = 0.0, mitred = 0.0;
  for (int z = 5; z <= 9; ++z)
    for (int y = -4; y <= 4; ++y)
      for (int x = 6; x < kLength - 6; ++x) {
        double before = sampler.at({x, kMiddle + y, kTop + z}, 0, 0.0).value;
        for (int k = 1; k <= kSteps; ++k) {
          const double value = sampler.at({x, kMiddle + y, kTop + z}, 0, double(k) / kSteps).value;
          steepest = std::max(steepest, std::fabs(value - before) * kSteps);
          before = value;
        }
        // Over the edge itself the roof's planes are nearer than the edge is.
        if (y == 0) mitred = std::max(mitred, z - (before + 8.0));
      }
  CHECK(mitred > 1.0);
  CHECK(steepest < 1.5);
}

}  // namespace offset_field_test
