// remesh() with max_length_ratio: mean edges of neighbours become alike, within the tolerance, at no sharper angle.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/remesh/triangle_quality.h"
#include "octree/error.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/remeshed_block.h"

namespace remesher_ratios_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// A sphere with dents whose bottoms bend much more than the rest, a little rough.
MeshBlock dented_sphere(std::uint64_t seed) {
  MeshBlock sphere = sphere_block(6);
  for (Double3& p : sphere.position) {
    double height = 1.0;
    for (const Double3& dent : {Double3{1, 0, 0}, Double3{0, 0.6, 0.8}, Double3{-0.6, -0.8, 0}}) {
      const double square = squared_distance(p, dent);
      height -= 0.08 * std::exp(-square / 0.006);
    }
    p = p * height;
  }
  add_noise(sphere, 0.0005, seed);
  canonicalise(sphere);
  return sphere;
}

RemeshOptions adaptive() {
  RemeshOptions o = options_for(0.3);
  o.sizing_tolerance = 0.002;
  o.min_edge = 0.01;
  o.tolerance = 0.0035;
  o.refine_beyond = true;
  o.iterations = 1;
  o.relaxations = 0;
  o.last_relaxations = 0;
  o.feature_angle_deg = 0.0;
  return o;
}

RemeshOptions evening(RemeshOptions o) {
  o.find_creases = false;
  o.max_length_ratio = 1.5;
  o.first_key = std::uint64_t{3} << 62;
  return o;
}

std::size_t count_below(const MeshBlock& block, double degrees) {
  return count_sharp(block, degrees).faces;
}

std::uint64_t smallest_angle(const MeshBlock& block) {
  TriangleQuality quality;
  quality.add(block, 1.0);
  return quality.smallest;
}

}  // namespace

TEST_CASE(
    "remesh: where lengths adapt no edge joins neighbours of uneven edges, at no smaller angle, as near",
    "[property]") {
  const std::uint64_t seed = GENERATE(1u, 2u, 3u);
  const MeshBlock sphere = dented_sphere(seed);
  const MeshBlock before = remeshed(sphere, adaptive());
  const UnevenEdges uneven = find_uneven(before, 1.5);
  REQUIRE(uneven.uneven > 10);
  MeshBlock out = before;
  const RemeshReport report = remesh(out, sphere, evening(adaptive()));
  CHECK(report.uneven_in >= uneven.uneven);
  CHECK(find_uneven(out, 1.5).uneven == 0);
  CHECK(report.uneven_held + report.uneven_at_lines + report.uneven_by_tolerance == 0);
  CHECK(count_below(out, 20.0) <= count_below(before, 20.0));
  CHECK(smallest_angle(out) + 50 >= std::min<std::uint64_t>(smallest_angle(before), 20000));
  CHECK(checks_of(out).defects() == 0);
  CHECK(checks_of(out).euler == 2);
  CHECK(certified(out, sphere, 0.005) < 4.0 / 3.0 * 0.0035);
  CHECK(static_cast<double>(out.faces.size()) < 1.02 * static_cast<double>(before.faces.size()));
  MeshBlock again = before;
  remesh(again, sphere, evening(adaptive()));
  CHECK(again.position == out.position);
  CHECK(again.faces == out.faces);
}

TEST_CASE("remesh: uneven edges beside faces that stay are told, and the faces stay", "[unit]") {
  const MeshBlock sphere = dented_sphere(1);
  const MeshBlock before = remeshed(sphere, adaptive());
  std::vector<std::uint64_t> pinned = before.key;
  MeshBlock out = before;
  const RemeshReport all = remesh(out, sphere, evening(adaptive()), pinned);
  CHECK(all.uneven_in > 10);
  CHECK(all.uneven_held == all.uneven_in);
  CHECK(out.position == before.position);
  CHECK(out.faces == before.faces);
}

TEST_CASE("remesh: seams of a block keep their vertices and the lengths around them", "[unit]") {
  const MeshBlock sphere = dented_sphere(2);
  const MeshBlock before = remeshed(sphere, adaptive());
  const auto side = [&](const MeshBlock& whole, bool left) {
    std::vector<std::uint8_t> is_in(whole.faces.size());
    for (std::size_t f = 0; f < is_in.size(); ++f)
      is_in[f] = (whole.position[whole.faces[f][0]][0] < 0.75) == left;
    return select_faces(whole, is_in);
  };
  MeshBlock half = side(before, true);
  const MeshBlock kept = half;
  const RemeshReport report = remesh(half, sphere, evening(adaptive()));
  CHECK(report.locked_vertices > 0);
  CHECK(report.uneven_in > 0);
  const MeshBlock rest = side(before, false);
  const MeshBlock* const pieces[2] = {&half, &rest};
  const MeshBlock whole = merge_blocks(pieces, {});
  CHECK(checks_of(whole).defects() == 0);
  // Mean edges at the seam are what they were.
  const std::vector<double> old = mean_edges(before), now = mean_edges(whole);
  std::size_t seam = 0;
  for (std::size_t v = 0; v < rest.key.size(); ++v) {
    const auto at = [](const MeshBlock& b, std::uint64_t key) {
      return static_cast<std::size_t>(std::lower_bound(b.key.begin(), b.key.end(), key) - b.key.begin());
    };
    const std::uint64_t key = rest.key[v];
    CHECK(old[at(before, key)] == Approx(now[at(whole, key)]).epsilon(1e-12));
    seam += std::binary_search(kept.key.begin(), kept.key.end(), key);
  }
  CHECK(seam > 20);
}

TEST_CASE("remesh: ratios and angles to be kept that make no sense are refused", "[unit]") {
  const auto refused = [](auto change) {
    RemeshOptions o = evening(adaptive());
    o.validate();
    change(o);
    CHECK_THROWS_AS(o.validate(), UsageError);
  };
  refused([](RemeshOptions& o) { o.max_length_ratio = 1.0; });
  refused([](RemeshOptions& o) { o.max_length_ratio = -2.0; });
  refused([](RemeshOptions& o) { o.kept_angle_deg = 60.0; });
  refused([](RemeshOptions& o) { o.min_angle_deg = 30.0; });
}

}  // namespace remesher_ratios_test
