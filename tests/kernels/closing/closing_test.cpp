#include "kernels/closing/closing.h"

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "kernels/closing/area_weights.h"
#include "kernels/closing/sign_flow.h"
#include "kernels/field/field.h"
#include "octree/morton.h"
#include "tests/helpers/oriented_samples.h"

namespace closing_test {

using namespace tessera;

namespace {

const Int3 kOrigin = {64, 64, 64};
const Int3 kCells = {64, 64, 64};
const Double3 kCentre = {96.2, 95.9, 96.4};
constexpr double kRadius = 20.3;

/// A sphere without its cap above `height` radii.
test::Samples capped_sphere(double height) {
  test::Random random(4);
  test::Samples all, kept;
  test::add_sphere(kCentre, kRadius, 1 / 1.5, random, all);
  for (const test::Sample& s : all)
    if (s.p[2] < kCentre[2] + height * kRadius) kept.push_back(s);
  return kept;
}

struct Closed {
  DirectedField field;
  GrownCells grown;
  std::uint64_t forced = 0;
};

ClosingOptions wide() {
  ClosingOptions options;
  options.high = {192, 192, 192};
  return options;
}

SignSource source(const ClosingField& field, const ClosingOptions& options) {
  return [&field, level = options.level](std::span<const Int3> queries, std::span<float> value) {
    field.evaluate(queries, level, value);
  };
}

/// \param bump  a ball at the rim is forced inside, whatever the fields say
Closed close(const test::Samples& samples, const ClosingOptions& options, bool bump = false) {
  const PointBlock points = test::make_block(samples, kOrigin, kCells, 16);
  const MultipoleTree tree(make_dipoles(points), kLeafBits);
  const ClosingField closing(tree, 3.0f);
  Closed out;
  out.field = evaluate_field(points, {});
  std::vector<BandSigns> signs;
  for (const BandLeaf& leaf : out.field.leaves)
    signs.push_back(
        {{leaf.origin[0] + 64, leaf.origin[1] + 64, leaf.origin[2] + 64}, leaf.valid(), leaf.inside});
  std::vector<Int3> data;
  for (const Dipole& d : tree.dipoles()) data.push_back(d.q);
  std::vector<Int3> seeds = boundary_cells(out.field);
  out.grown = grow_closing(kOrigin, signs, {}, seeds, source(closing, options), data, options);
  if (bump) {
    const Int3 brick = {1, 1, 1};
    SignMap map = flow_region({{brick_key(brick), out.grown.cells}});
    enter_local_signs(signs, map);
    for (auto& [key, leaf] : map) {
      leaf.original = leaf.inside;
      const auto at = morton_decode(key);
      for (int b = 0; b < 512; ++b) {
        const Double3 n = {at[0] * 8.0 + (b & 7), at[1] * 8.0 + (b >> 3 & 7), at[2] * 8.0 + (b >> 6)};
        const Double3 boundary = {kCentre[0] + kRadius * std::sqrt(0.75), kCentre[1],
                                  kCentre[2] + kRadius * 0.5};
        if (std::hypot(n[0] - boundary[0], n[1] - boundary[1], n[2] - boundary[2]) > 5.0) continue;
        leaf.free[static_cast<std::size_t>(b >> 6)] |= std::uint64_t{1} << (b & 63);
        leaf.inside[static_cast<std::size_t>(b >> 6)] |= std::uint64_t{1} << (b & 63);
      }
    }
    for (const Int3& c : forced_cells(map)) seeds.push_back(c);
    out.grown = grow_closing(kOrigin, signs, {}, seeds, source(closing, options), data, options,
                             fixed_around(map, brick));
    out.forced = add_flow_values(flow_values(map, brick), out.grown.cells);
  }
  add_closing(out.field, out.grown.cells, closing, options);
  return out;
}

}  // namespace

TEST_CASE("closing: every crossed edge of a closing cell has a root, every crossed face a cell on both sides",
          "[unit]") {
  const bool bump = GENERATE(false, true);
  const Closed closed = close(capped_sphere(0.5), wide(), bump);
  const DirectedField& field = closed.field;
  REQUIRE(closed.grown.added > 500);
  CHECK((closed.forced > 50) == bump);
  CHECK(closed.grown.leaving.empty());
  std::map<Int3, unsigned> cells;  // all that take part, with the corners inside
  for (const BandLeaf& leaf : field.leaves)
    for (int z = 0; z < 8; ++z)
      for (int b = 0; b < 64; ++b) {
        const Int3 c = {leaf.origin[0] + (b & 7), leaf.origin[1] + (b >> 3), leaf.origin[2] + z};
        bool all = true;
        unsigned inside = 0;
        for (int k = 0; k < 8; ++k) {
          const Int3 n = {c[0] + (k & 1), c[1] + (k >> 1 & 1), c[2] + (k >> 2)};
          if (*std::max_element(n.begin(), n.end()) > 64) {
            all = false;
            continue;
          }
          const BandLeaf* l = field.leaf_at(n[0], n[1], n[2]);
          const auto w = static_cast<std::size_t>(n[2] & 7);
          const int bit = DirectedField::bit(n[0], n[1]);
          all &= l && l->is_valid(BandLeaf::node(n[0], n[1], n[2]));
          if (l && (l->inside[w] >> bit & 1)) inside |= 1u << k;
        }
        const bool closing = leaf.closing[static_cast<std::size_t>(z)] >> b & 1;
        CHECK_FALSE((closing && all));
        if ((closing || all) && inside != 0 && inside != 0xff) cells[c] = inside;
        if (closing) CHECK((inside != 0 && inside != 0xff));
      }
  std::size_t faces = 0;
  for (const auto& [c, inside] : cells) {
    constexpr unsigned kFace[6] = {0x55, 0xaa, 0x33, 0xcc, 0x0f, 0xf0};
    for (std::size_t f = 0; f < 6; ++f) {
      if ((inside & kFace[f]) == 0 || (~inside & kFace[f]) == 0) continue;
      Int3 n = c;
      n[f >> 1] += f & 1 ? 1 : -1;
      REQUIRE(cells.count(n) == 1);
      ++faces;
    }
    for (int axis = 0; axis < 3; ++axis)
      for (int k = 0; k < 8; ++k) {
        if (k >> axis & 1) continue;
        const bool crossed = (inside >> k & 1) != (inside >> (k | 1 << axis) & 1);
        if (!crossed) continue;
        const EdgeRoot* root = field.root_at(c[0] + (k & 1), c[1] + (k >> 1 & 1), c[2] + (k >> 2), axis);
        REQUIRE(root != nullptr);
        REQUIRE((root->t > 0 && root->t < 1));
      }
  }
  CHECK(faces > 5000);
}

TEST_CASE("closing: the missing cap of a sphere comes back, whatever its height", "[unit]") {
  for (const double height : {0.8, 0.5, 0.2, 0.0}) {
    const Closed closed = close(capped_sphere(height), wide());
    REQUIRE(closed.grown.added > 300);
    double worst = 0;
    std::size_t count = 0;
    for (const BandLeaf& leaf : closed.field.leaves)
      for (int z = 0; z < 8; ++z)
        for (std::uint64_t left = leaf.closing[static_cast<std::size_t>(z)]; left; left &= left - 1) {
          const int b = std::countr_zero(left);
          for (int axis = 0; axis < 3; ++axis) {
            Double3 p = {leaf.origin[0] + (b & 7) + 64.0, leaf.origin[1] + (b >> 3) + 64.0,
                         leaf.origin[2] + z + 64.0};
            const EdgeRoot* root = closed.field.root_at(leaf.origin[0] + (b & 7), leaf.origin[1] + (b >> 3),
                                                        leaf.origin[2] + z, axis);
            if (!root) continue;
            p[static_cast<std::size_t>(axis)] += static_cast<double>(root->t);
            worst = std::max(
                worst,
                std::abs(std::hypot(p[0] - kCentre[0], p[1] - kCentre[1], p[2] - kCentre[2]) - kRadius));
            ++count;
          }
        }
    CHECK(count > 200);
    CHECK(worst < 0.05);
  }
}

TEST_CASE("closing: where nothing is missing nothing changes, a limit keeps it near the data", "[unit]") {
  const Closed whole = close(capped_sphere(2.0), wide());
  CHECK(whole.grown.added == 0);
  ClosingOptions options = wide();
  options.limit = 5.0f;
  const Closed closed = close(capped_sphere(0.5), options);
  const Closed all = close(capped_sphere(0.5), wide());
  CHECK(closed.grown.added > 100);
  CHECK(closed.grown.added < all.grown.added);
  CHECK(closed.grown.stopped.size() > 50);
  const double boundary = kRadius * std::sqrt(0.75);
  for (const ClosingLeaf& leaf : closed.grown.cells)
    for (int z = 0; z < 8; ++z)
      for (int b = 0; b < 64; ++b) {
        if (!(leaf.cells[static_cast<std::size_t>(z)] >> b & 1)) continue;
        const double x = leaf.origin[0] + (b & 7) + 0.5 - kCentre[0],
                     y = leaf.origin[1] + (b >> 3) + 0.5 - kCentre[1];
        CHECK(std::hypot(x, y) > boundary - 5.5);
      }
  // What was not finished is taken back, all of it.
  std::map<std::uint64_t, std::vector<ClosingLeaf>> bricks = {{brick_key({1, 1, 1}), closed.grown.cells}};
  CHECK(take_back_unfinished(bricks, closed.grown.stopped) == closed.grown.added);
  CHECK(bricks.begin()->second.empty());
  bricks.begin()->second = all.grown.cells;
  CHECK(take_back_unfinished(bricks, all.grown.stopped) == 0);
  CHECK(bricks.begin()->second.size() == all.grown.cells.size());
}

TEST_CASE("closing: the cells do not depend on the order of growth", "[property]") {
  const test::Samples samples = capped_sphere(0.2);
  const PointBlock points = test::make_block(samples, kOrigin, kCells, 16);
  const MultipoleTree tree(make_dipoles(points), kLeafBits);
  const ClosingField closing(tree, 3.0f);
  const DirectedField field = evaluate_field(points, {});
  const std::vector<BandSigns> signs = signs_of_brick(field, {0, 0, 0});
  std::vector<Int3> seeds = boundary_cells(field);
  REQUIRE(seeds.size() > 50);
  const GrownCells once = grow_closing(kOrigin, signs, {}, seeds, source(closing, wide()), {}, wide());
  GrownCells steps;  // one seed at a time, backwards
  std::reverse(seeds.begin(), seeds.end());
  std::uint64_t added = 0;
  for (std::size_t i = 0; i < seeds.size(); i += seeds.size() / 4) {
    const auto part = std::span(seeds).subspan(i, std::min(seeds.size() / 4, seeds.size() - i));
    steps = grow_closing(kOrigin, signs, steps.cells, part, source(closing, wide()), {}, wide());
    added += steps.added;
  }
  CHECK(added == once.added);
  REQUIRE(steps.cells.size() == once.cells.size());
  for (std::size_t i = 0; i < once.cells.size(); ++i) {
    CHECK(steps.cells[i].origin == once.cells[i].origin);
    CHECK(steps.cells[i].cells == once.cells[i].cells);
  }
}

}  // namespace closing_test
