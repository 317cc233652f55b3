#include "kernels/closing/sign_flow.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <set>

#include "octree/morton.h"

namespace sign_flow_test {

using namespace tessera;

namespace {

using Inside = std::function<bool(const Int3&)>;

constexpr int kLow = 32, kHigh = 104;  ///< closing cells lie between, across the bricks' faces at 64

struct Flowed {
  SignMap signs;
  ClosingMap cells;
};

bool sign_at(const SignMap& signs, const Int3& n) {
  const NodeSigns& leaf =
      signs.at(morton_encode(static_cast<std::uint32_t>(n[0] >> 3), static_cast<std::uint32_t>(n[1] >> 3),
                             static_cast<std::uint32_t>(n[2] >> 3)));
  return leaf.inside[static_cast<std::size_t>(n[2] & 7)] >> ((n[0] & 7) + 8 * (n[1] & 7)) & 1;
}

/// Lets the signs of a shape flow, all of them of the closing field or of the local one.
/// \param shift  multiples of 8: where the shape lies on the lattice
Flowed flow(const Inside& inside, int shift, bool local, const Inside& closing) {
  Flowed out;
  std::vector<BandSigns> signs;
  for (int z = kLow; z < kHigh; z += 8)
    for (int y = kLow; y < kHigh; y += 8)
      for (int x = kLow; x < kHigh; x += 8) {
        ClosingLeaf leaf;
        BandSigns s;
        leaf.origin = s.origin = {x + shift, y + shift, z + shift};
        for (int b = 0; b < 512; ++b) {
          const Int3 n = {x + (b & 7), y + (b >> 3 & 7), z + (b >> 6)};
          const std::uint64_t bit = std::uint64_t{1} << (b & 63);
          const auto w = static_cast<std::size_t>(b >> 6);
          s.valid[w] |= bit;
          if (inside(n)) s.inside[w] |= bit;
          if (closing(n)) leaf.cells[w] |= bit;
        }
        signs.push_back(s);
        const Int3& o = leaf.origin;
        out.cells[brick_key({o[0] >> 6, o[1] >> 6, o[2] >> 6})].push_back(leaf);
      }
  out.signs = flow_region(out.cells);
  if (local) {
    enter_local_signs(signs, out.signs);
  } else {
    SignMap field;
    add_field_signs(signs, field);
    enter_field_signs(field, out.signs);
  }
  std::set<Int3> bricks;  // where leaves are: elsewhere there is nothing to change
  for (const auto& [key, leaf] : out.signs) {
    const auto at = morton_decode(key);
    bricks.insert({static_cast<int>(at[0] >> 3), static_cast<int>(at[1] >> 3), static_cast<int>(at[2] >> 3)});
  }
  const auto step = [&](const auto& change) {
    std::vector<SignChange> changes;
    for (const Int3& brick : bricks) changes.push_back(change(brick));
    bool flows = false;
    for (const SignChange& c : changes)
      for (const auto& [key, leaf] : c) {
        NodeSigns& before = out.signs[key];
        flows |= leaf.inside != before.inside;
        before = leaf;
      }
    return flows;
  };
  step([&](const Int3& brick) { return prepare_flow(out.signs, out.cells, brick); });
  // What a round leaves as it was, the next one does too: it reads nothing but signs.
  for (int round = 0, flows = 1; round < kFlowRounds && flows; ++round)
    flows = step([&](const Int3& brick) { return flow_signs(out.signs, brick); });
  return out;
}

std::uint64_t forced_nodes(const SignMap& signs) {
  std::uint64_t count = 0;
  for (const auto& [key, leaf] : signs)
    for (std::size_t z = 0; z < 8; ++z) count += static_cast<std::uint64_t>(std::popcount(leaf.forced(z)));
  return count;
}

bool everywhere(const Int3&) {
  return true;
}

/// Two solids with a bar between them: one handle.
bool barred(const Int3& n) {
  return n[0] < 50 || n[0] > 76 || std::hypot(n[1] - 66.3, n[2] - 63.8) < 1.6;
}

}  // namespace

TEST_CASE("sign flow: a thin bar and a thin tunnel go, what they hang on stays", "[unit]") {
  for (const bool solid : {true, false}) {
    const Flowed f = flow([&](const Int3& n) { return barred(n) == solid; }, 0, false, everywhere);
    std::size_t left = 0;
    for (int x = 53; x < 74; ++x)
      for (int y = 60; y < 72; ++y)
        for (int z = 58; z < 70; ++z) left += sign_at(f.signs, {x, y, z}) == solid;
    CHECK(left == 0);
    for (const int x : {40, 49, 77, 90}) {
      CHECK(sign_at(f.signs, {x, 50, 50}) == solid);
      CHECK(sign_at(f.signs, {x, 80, 70}) == solid);
    }
    CHECK(sign_at(f.signs, {50, 50, 50}) != solid);
  }
}

TEST_CASE("sign flow: planes and spheres stay, bit for bit", "[unit]") {
  for (const Double3& n : {Double3{0.36, 0.48, 0.8}, Double3{1, 0, 0}, Double3{0.70710678, 0.70710678, 0.0},
                           Double3{0.57735027, 0.57735027, 0.57735027}, Double3{0.995, 0.0998, 0.0}})
    for (const double offset : {0.0, 0.27, 0.49}) {
      const auto plane = [&](const Int3& p) {
        return n[0] * (p[0] - 68) + n[1] * (p[1] - 68) + n[2] * (p[2] - 68) < offset;
      };
      CHECK(forced_nodes(flow(plane, 0, false, [](const Int3& p) {
                           return std::abs(p[0] - 68) < 20 && std::abs(p[1] - 68) < 20 &&
                                  std::abs(p[2] - 68) < 20;
                         }).signs) == 0);
    }
  const auto ball = [](const Int3& p) { return std::hypot(p[0] - 68.3, p[1] - 67.9, p[2] - 68.1) < 26.0; };
  CHECK(forced_nodes(flow(ball, 0, false, everywhere).signs) == 0);
}

TEST_CASE("sign flow: local signs stay away from the closing cells", "[unit]") {
  const auto corner = [](const Int3& n) { return n[0] < 60; };
  const Flowed f = flow(barred, 0, true, corner);
  CHECK(forced_nodes(f.signs) > 10);
  for (int x = 62; x < 77; ++x) CHECK(sign_at(f.signs, {x, 66, 64}));
  CHECK_FALSE(sign_at(f.signs, {55, 66, 64}));
}

TEST_CASE("sign flow: signs do not depend on where the faces of bricks lie", "[property]") {
  const Flowed here = flow(barred, 0, false, everywhere), there = flow(barred, 24, false, everywhere);
  std::size_t differ = 0;
  for (int z = kLow; z < kHigh; ++z)
    for (int y = kLow; y < kHigh; ++y)
      for (int x = kLow; x < kHigh; ++x)
        differ += sign_at(here.signs, {x, y, z}) != sign_at(there.signs, {x + 24, y + 24, z + 24});
  CHECK(differ == 0);
  CHECK(forced_nodes(here.signs) > 100);
}

TEST_CASE("sign flow: forced nodes go to the closing cells with values of their sign", "[unit]") {
  Flowed f = flow(barred, 0, false, everywhere);
  const Int3 brick = {1, 1, 1};
  std::vector<ClosingLeaf>& cells = f.cells[brick_key(brick)];
  const std::size_t leaves = cells.size();
  const std::vector<ClosingLeaf> values = flow_values(f.signs, brick);
  REQUIRE(!values.empty());
  const std::uint64_t forced = add_flow_values(values, cells);
  CHECK(forced > 10);
  CHECK(cells.size() >= leaves);
  std::uint64_t seen = 0;
  for (const ClosingLeaf& leaf : cells)
    for (int b = 0; b < 512; ++b) {
      const auto z = static_cast<std::size_t>(b >> 6);
      const std::uint64_t bit = std::uint64_t{1} << (b & 63);
      if (!(leaf.forced[z] & bit)) continue;
      ++seen;
      CHECK((leaf.near[z] & bit) != 0);
      const bool inside = (leaf.inside[z] & bit) != 0;
      CHECK(inside == (leaf.value[static_cast<std::size_t>(b)] < 0));
    }
  CHECK(seen == forced);
  CHECK(forced_cells(f.signs).size() > 8 * forced);
  const std::vector<FixedSigns> fixed = fixed_around(f.signs, brick);
  CHECK(fixed.size() > values.size());
}

}  // namespace sign_flow_test
