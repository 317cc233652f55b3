// A block's band that was evaluated in parts is the one that was evaluated whole.
#include "kernels/field/field_parts.h"

#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>
#include <vector>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/field/field.h"
#include "tests/helpers/oriented_samples.h"

namespace field_parts_test {

using namespace tessera;

namespace {

const Int3 kOrigin = {64, 128, 64};
const Int3 kSize = {64, 64, 64};

/// A box with sharp edges, a sheet that ends within the block, and a ball; all cross its sides.
test::Samples scene(double noise) {
  test::Random random(5);
  test::Samples samples;
  test::add_box({70, 120, 70}, {101.3, 170.2, 140.1}, 0.7, random, samples);
  test::add_face({104, 120, 100.3}, {40, 0, 6}, {0, 50, -4}, {-0.147, 0.078, 0.986}, 0.7, {}, random,
                 samples);
  test::add_sphere({120, 180, 82}, 15.2, 0.7, random, samples);
  if (noise > 0.0) test::add_noise(noise, random, samples);
  for (test::Sample& s : samples)
    s.rgba = 0xff000000u | static_cast<std::uint32_t>(s.p[0]) << 8 | static_cast<std::uint32_t>(s.p[1]);
  return samples;
}

DirectedField part_of(const test::Samples& samples, const FieldOptions& options, const Int3& origin,
                      const Int3& cells) {
  return evaluate_field(test::make_block(samples, origin, cells, field_halo_cells(options), true), options);
}

DirectedField joined(const test::Samples& samples, const FieldOptions& options, int edge, bool backwards) {
  std::vector<Int3> corners;
  for (int z = 0; z < kSize[2]; z += edge)
    for (int y = 0; y < kSize[1]; y += edge)
      for (int x = 0; x < kSize[0]; x += edge) corners.push_back({x, y, z});
  if (backwards) std::reverse(corners.begin(), corners.end());
  FieldParts parts(kOrigin, kSize);
  for (const Int3& c : corners)
    parts.add(part_of(samples, options, {kOrigin[0] + c[0], kOrigin[1] + c[1], kOrigin[2] + c[2]},
                      {edge, edge, edge}));
  return std::move(parts).take();
}

std::vector<std::uint32_t> bits(const Float3& v) {
  return {std::bit_cast<std::uint32_t>(v[0]), std::bit_cast<std::uint32_t>(v[1]),
          std::bit_cast<std::uint32_t>(v[2])};
}

void check_same(const DirectedField& got, const DirectedField& want) {
  REQUIRE(got.leaf_index == want.leaf_index);
  REQUIRE(got.leaves.size() == want.leaves.size());
  for (std::size_t l = 0; l < want.leaves.size(); ++l) {
    const BandLeaf &a = got.leaves[l], &b = want.leaves[l];
    REQUIRE(a.origin == b.origin);
    REQUIRE(a.valid() == b.valid());
    REQUIRE(a.inside == b.inside);
    REQUIRE(a.crossing == b.crossing);
    REQUIRE(a.first_root == b.first_root);
    REQUIRE(a.moving == b.moving);
    REQUIRE(a.unseen == b.unseen);
    for (std::size_t n = 0; n < 512; ++n)
      REQUIRE(std::bit_cast<std::uint32_t>(a.value(n)) == std::bit_cast<std::uint32_t>(b.value(n)));
  }
  REQUIRE(got.roots.size() == want.roots.size());
  for (std::size_t r = 0; r < want.roots.size(); ++r) {
    const EdgeRoot &a = got.roots[r], &b = want.roots[r];
    REQUIRE(std::bit_cast<std::uint32_t>(a.t) == std::bit_cast<std::uint32_t>(b.t));
    REQUIRE(bits(a.normal) == bits(b.normal));
    REQUIRE(std::bit_cast<std::uint32_t>(a.offset) == std::bit_cast<std::uint32_t>(b.offset));
    REQUIRE(a.rgba == b.rgba);
    REQUIRE(a.slides == b.slides);
  }
  CHECK(got.creased == want.creased);
  REQUIRE(got.moves.size() == want.moves.size());
  for (std::size_t m = 0; m < want.moves.size(); ++m) {
    REQUIRE(got.moves[m].root == want.moves[m].root);
    REQUIRE(bits(got.moves[m].by) == bits(want.moves[m].by));
  }
}

/// Positions and faces of all patches.
std::pair<std::vector<std::uint32_t>, std::vector<std::uint32_t>> surface_of(const DirectedField& field) {
  std::pair<std::vector<std::uint32_t>, std::vector<std::uint32_t>> out;
  static_cast<void>(extract_surface(field, {}, [&](Patch&& patch) {
    for (const Float3& p : patch.position)
      for (const std::uint32_t word : bits(p)) out.first.push_back(word);
    for (const auto& face : patch.faces) out.second.insert(out.second.end(), face.begin(), face.end());
  }));
  return out;
}

}  // namespace

TEST_CASE("field parts: what parts of a block make is what the block makes", "[unit]") {
  const double noise = GENERATE(0.0, 0.2);
  const bool firm = GENERATE(false, true);
  CAPTURE(noise, firm);
  const test::Samples samples = scene(noise);
  FieldOptions options;
  options.noise_cells = noise;
  options.firm_boundary = firm;
  const DirectedField whole = part_of(samples, options, kOrigin, kSize);
  REQUIRE(whole.roots.size() > 10'000);
  REQUIRE(whole.moves.empty() == firm);
  const auto surface = surface_of(whole);
  REQUIRE(surface.second.size() > 30'000);
  for (const int edge : {32, 16, 8}) {
    CAPTURE(edge);
    const DirectedField parts = joined(samples, options, edge, edge == 16);
    check_same(parts, whole);
    CHECK(surface_of(parts) == surface);
  }
}

TEST_CASE("field parts: a block without samples has no band", "[unit]") {
  const test::Samples samples = {{{10, 10, 10}, {0, 0, 1}, 0}};
  CHECK(joined(samples, {}, 32, false).leaves.empty());
}

}  // namespace field_parts_test
