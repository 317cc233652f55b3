// Decimation is a function of the set of faces: their order does not matter, nor that of corners and vertices. And of how many there may
// be.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/decimate/decimate.h"
#include "octree/portable_math.h"
#include "octree/vector.h"
#include "tests/helpers/block_meshes.h"

namespace decimate_order_test {

namespace {

using namespace tessera;
using namespace tessera::test;

DecimateOptions within(double tolerance) {
  DecimateOptions o;
  o.tolerance = tolerance;
  return o;
}

/// A sphere of radius 1 with waves of height `bump` on it.
MeshBlock bumpy_sphere(int levels, double bump) {
  MeshBlock b = sphere_block(levels);
  for (Double3& q : b.position) {
    const double scale = 1.0 + bump * std::sin(7.0 * q[0]) * std::sin(5.0 * q[1] + 2.0 * q[2]);
    q = q * scale;
  }
  return b;
}

bool same(const MeshBlock& a, const MeshBlock& b) {
  return a.key == b.key && a.position == b.position && a.faces == b.faces && a.face_flags == b.face_flags &&
         a.face_bound == b.face_bound && a.rgba == b.rgba;
}

/// The same faces with vertices, faces and corners in another order.
MeshBlock shuffled(const MeshBlock& b, std::uint64_t seed) {
  const auto random_order = [&](std::size_t n, std::uint64_t salt) {
    std::vector<std::uint32_t> order(n);
    for (std::size_t i = 0; i < n; ++i) order[i] = static_cast<std::uint32_t>(i);
    std::sort(order.begin(), order.end(), [&](std::uint32_t x, std::uint32_t y) {
      return random_bits(seed, salt, x) < random_bits(seed, salt, y);
    });
    return order;
  };
  MeshBlock out;
  std::vector<std::uint32_t> slot(b.key.size());
  for (const std::uint32_t v : random_order(b.key.size(), 1)) {
    slot[v] = static_cast<std::uint32_t>(out.key.size());
    out.key.push_back(b.key[v]);
    out.position.push_back(b.position[v]);
    out.vertex_class.push_back(b.vertex_class[v]);
    if (!b.rgba.empty()) out.rgba.push_back(b.rgba[v]);
  }
  for (const std::uint32_t f : random_order(b.faces.size(), 2)) {
    const std::size_t shift = random_bits(seed, 3, f) % 3;
    std::array<std::uint32_t, 3> t;
    unsigned flags = b.face_flags[f] & unsigned{kFaceSynthetic | kFaceDone};
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t from = (i + shift) % 3;
      t[i] = slot[b.faces[f][from]];
      if (b.face_flags[f] >> from & kFaceBorder01) flags |= unsigned{kFaceBorder01} << i;
      if (b.face_flags[f] & kFaceCrease01 << from) flags |= unsigned{kFaceCrease01} << i;
    }
    out.faces.push_back(t);
    out.face_flags.push_back(static_cast<std::uint8_t>(flags));
  }
  return out;
}

}  // namespace

TEST_CASE("decimate: order of vertices, faces and corners does not matter", "[property]") {
  const MeshBlock original = bumpy_sphere(4, 0.1);
  MeshBlock first = original;
  decimate(first, original, within(0.01));
  MeshBlock itself = original;
  decimate(itself, itself, within(0.01));
  CHECK(same(first, itself));
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    MeshBlock other = shuffled(original, seed);
    decimate(other, original, within(0.01));
    CHECK(same(first, other));
  }
}

TEST_CASE("decimate: order does not matter where edges of faces are creases", "[property]") {
  // An equator that is a crease by its bits alone, and a border around a piece.
  MeshBlock marked = bumpy_sphere(4, 0.05);
  const MeshBlock round = sphere_block(4);
  for (std::size_t f = 0; f < marked.faces.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i)
      if (round.position[marked.faces[f][i]][2] == 0.0 &&
          round.position[marked.faces[f][(i + 1) % 3]][2] == 0.0)
        marked.face_flags[f] = static_cast<std::uint8_t>(marked.face_flags[f] | kFaceCrease01 << i);
  const MeshBlock piece = piece_of(marked, [&](std::uint32_t v) { return round.position[v][0] > -0.5; });
  for (const MeshBlock* original : {&std::as_const(marked), &piece}) {
    MeshBlock first = *original;
    decimate(first, *original, within(0.02));
    MeshBlock smooth = *original;
    for (std::uint8_t& flags : smooth.face_flags)
      flags = static_cast<std::uint8_t>(flags & ~unsigned{kFaceCrease01 | kFaceCrease12 | kFaceCrease20});
    const MeshBlock without = smooth;
    decimate(smooth, without, within(0.02));
    CHECK_FALSE(same(first, smooth));  // creases count
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      MeshBlock other = shuffled(*original, seed);
      decimate(other, *original, within(0.02));
      CHECK(same(first, other));
      MeshBlock itself = shuffled(*original, seed);
      decimate(itself, itself, within(0.02));
      CHECK(same(first, itself));
    }
  }
}

TEST_CASE("decimate: as many faces as their corners can be numbered, and no more", "[unit]") {
  CHECK(fits_collapse_mesh(0, 0));
  const std::size_t maximum = (std::size_t{1} << 30) - 1;
  CHECK(fits_collapse_mesh(maximum / 2, maximum));
  CHECK(4 * (maximum - 1) + 2 < kNoCorner);
  CHECK_FALSE(fits_collapse_mesh(maximum / 2, maximum + 1));
  CHECK_FALSE(fits_collapse_mesh(maximum / 2, kNoCorner / 3));
  CHECK_FALSE(fits_collapse_mesh(kNoCorner, 1));
}

}  // namespace decimate_order_test
