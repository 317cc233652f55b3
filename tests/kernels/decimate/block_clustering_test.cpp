#include "kernels/decimate/block_clustering.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "tests/helpers/random.h"

namespace block_clustering_test {

using namespace tessera;
using tessera::test::Random;

namespace {

using CornerTriple = std::array<Double3, 3>;

MeshBlock block_of(const std::vector<Double3>& points,
                   const std::vector<std::array<std::uint32_t, 3>>& faces) {
  MeshBlock block;
  block.position = points;
  for (std::size_t v = 0; v < points.size(); ++v) block.key.push_back(1000 + v);
  block.vertex_class.assign(points.size(), VertexClass::kSmooth);
  block.faces = faces;
  block.face_flags.assign(faces.size(), 0);
  canonicalise(block);
  return block;
}

/// n x n squares of side 1, each corner at `at(i, j)`.
template <class At>
void add_sheet(std::vector<Double3>& points, std::vector<std::array<std::uint32_t, 3>>& faces, int nx, int ny,
               const At& at) {
  const auto first = static_cast<std::uint32_t>(points.size()), row = static_cast<std::uint32_t>(nx + 1);
  for (int j = 0; j <= ny; ++j)
    for (int i = 0; i <= nx; ++i) points.push_back(at(i, j));
  for (std::uint32_t j = 0; j < static_cast<std::uint32_t>(ny); ++j)
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(nx); ++i) {
      const std::uint32_t a = first + j * row + i;
      faces.push_back({a, a + 1, a + row + 1});
      faces.push_back({a, a + row + 1, a + row});
    }
}

/// What decimation cannot join: islands, strips, two sheets beside each other, needles across all of it, a face without area.
MeshBlock made_litter(std::uint64_t seed) {
  Random random(seed);
  std::vector<Double3> points;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (int k = 0; k < 150; ++k) {
    const Double3 at = {random.in(0, 60), random.in(0, 60), random.in(0, 20)};
    add_sheet(points, faces, 1, 2, [&](int i, int j) {
      return at + Double3{static_cast<double>(i), static_cast<double>(j), random.in(-0.2, 0.2)};
    });
  }
  for (int k = 0; k < 4; ++k)
    add_sheet(points, faces, 60, 1, [&](int i, int j) {
      return Double3{static_cast<double>(i), 15.0 * k + 0.3 * j, -4.0};
    });
  for (int k = 0; k < 2; ++k)
    add_sheet(points, faces, 40, 40, [&](int i, int j) {
      return Double3{1.5 * i, 1.5 * j, 30.0 + 0.4 * k + random.in(-0.1, 0.1)};
    });
  for (int k = 0; k < 20; ++k) {
    const auto v = static_cast<std::uint32_t>(points.size());
    const Double3 a = {random.in(0, 60), random.in(0, 60), random.in(-4, 30)};
    const Double3 b = {random.in(0, 60), random.in(0, 60), random.in(-4, 30)};
    points.insert(points.end(), {a, b, a + Double3{0.01, k % 5 == 0 ? 0.0 : 0.01, 0.0}});
    if (k % 7 == 0) points.back() = a;
    faces.push_back({v, v + 1, v + 2});
  }
  return block_of(points, faces);
}

double farthest(const MeshBlock& from, const MeshBlock& to) {
  const ClosestFaces closest(to.position, to.faces, {0, 0, 0});
  double worst = 0.0;
  for (const auto& f : from.faces)
    for (int i = 0; i <= 6; ++i)
      for (int j = 0; i + j <= 6; ++j) {
        const Double3 p = from.position[f[0]] * ((6 - i - j) / 6.0) + from.position[f[1]] * (i / 6.0) +
                          from.position[f[2]] * (j / 6.0);
        worst = std::max(worst, closest.closest(p, 1e30, ClosestFaces::kNone).square);
      }
  return std::sqrt(worst);
}

std::multiset<CornerTriple> corners_of(const MeshBlock& block) {
  std::multiset<CornerTriple> out;
  for (const auto& f : block.faces) {
    CornerTriple corners = {block.position[f[0]], block.position[f[1]], block.position[f[2]]};
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    out.insert(corners);
  }
  return out;
}

ClusteredBlock cluster_whole(const MeshBlock& block, double cell, bool floats = false) {
  const std::vector<std::uint8_t> core(block.faces.size(), 1);
  return cluster_block(block, core, {{-0.1, -0.1, -4.1}, cell, 1}, floats);
}

}  // namespace

TEST_CASE("block clustering: an even sheet shrinks to a quarter, stays flat and faces up", "[unit]") {
  std::vector<Double3> points;
  std::vector<std::array<std::uint32_t, 3>> faces;
  add_sheet(points, faces, 64, 64, [](int i, int j) {
    return Double3{static_cast<double>(i), static_cast<double>(j), 0.5};
  });
  const ClusteredBlock out = cluster_whole(block_of(points, faces), 2.0);
  CHECK(out.block.faces.size() == 2 * 32 * 32);
  CHECK(out.faces_kept == 0);
  CHECK(out.bound <= 2.0);
  std::size_t borders = 0;
  for (std::size_t f = 0; f < out.block.faces.size(); ++f) {
    const auto& v = out.block.faces[f];
    const Double3 wide = cross(out.block.position[v[1]] - out.block.position[v[0]],
                               out.block.position[v[2]] - out.block.position[v[0]]);
    REQUIRE(wide[2] > 0.0);
    REQUIRE(std::abs(out.block.position[v[0]][2] - 0.5) < 1e-9);
    for (const auto bit : {kFaceBorder01, kFaceBorder12, kFaceBorder20})
      borders += (out.block.face_flags[f] & bit) != 0;
  }
  CHECK(borders == 4 * 32);
}

TEST_CASE("block clustering: nothing is farther than the bound, either way, whatever collapses",
          "[property]") {
  for (std::uint64_t seed = 1; seed <= 2; ++seed)
    for (const double cell : {0.7, 3.0, 11.0, 80.0}) {
      const MeshBlock block = made_litter(seed);
      const ClusteredBlock out = cluster_whole(block, cell, seed % 2 == 0);
      INFO("seed " << seed << ", cell " << cell << ": " << out.block.faces.size() << " faces, bound "
                   << out.bound);
      REQUIRE_FALSE(out.block.faces.empty());
      CHECK(farthest(block, out.block) <= out.bound + 1e-9);
      CHECK(farthest(out.block, block) <= out.bound + 1e-9);
      if (cell > 1.0) CHECK(out.block.faces.size() < block.faces.size());
    }
}

TEST_CASE("block clustering: blocks agree, and together they are the whole", "[property]") {
  const MeshBlock block = made_litter(7);
  constexpr double kCell = 5.0;
  const ClusteredBlock whole = cluster_whole(block, kCell);
  std::multiset<CornerTriple> together;
  double bound = 0.0;
  for (int part = 0; part < 4; ++part) {
    std::vector<std::uint8_t> core, keep;
    Double3 low = {1e9, 1e9, 1e9}, high = {-1e9, -1e9, -1e9};
    for (const auto& f : block.faces) {
      const Double3 p = block.position[f[0]];
      core.push_back((p[0] < 25.0 ? 0 : 1) + (p[1] < 33.0 ? 0 : 2) == part);
      for (const std::uint32_t v : f)
        for (std::size_t k = 0; core.back() != 0 && k < 3; ++k) {
          low[k] = std::min(low[k], block.position[v][k]);
          high[k] = std::max(high[k], block.position[v][k]);
        }
    }
    // No more around than is promised.
    std::vector<std::uint8_t> core_near;
    for (std::size_t f = 0; f < block.faces.size(); ++f) {
      bool apart = false;
      for (std::size_t k = 0; k < 3; ++k) {
        double least = 1e9, most = -1e9;
        for (const std::uint32_t v : block.faces[f]) {
          least = std::min(least, block.position[v][k]);
          most = std::max(most, block.position[v][k]);
        }
        apart = apart || least > high[k] + kCell || most < low[k] - kCell;
      }
      keep.push_back(!apart);
      if (!apart) core_near.push_back(core[f]);
    }
    const MeshBlock near = select_faces(block, keep);
    const ClusteredBlock out = cluster_block(near, core_near, {{-0.1, -0.1, -4.1}, kCell, 1}, false);
    together.merge(corners_of(out.block));
    bound = std::max(bound, out.bound);
  }
  CHECK((together == corners_of(whole.block)));
  CHECK(whole.bound <= bound + 1e-12);
  CHECK(bound <= 2.0 * std::sqrt(3.0) * kCell);
}

TEST_CASE("block clustering: colours are means by area, vertices have names of their own", "[unit]") {
  std::vector<Double3> points;
  std::vector<std::array<std::uint32_t, 3>> faces;
  add_sheet(points, faces, 40, 40, [](int i, int j) { return Double3{0.1 * i, 0.1 * j, 0.0}; });
  MeshBlock block = block_of(points, faces);
  for (const Double3& p : block.position) block.rgba.push_back(p[0] + p[1] > 3.9 ? 0xff0000ffu : 0xff00ff00u);
  const ClusteredBlock out = cluster_whole(block, 1.0);
  REQUIRE(out.block.rgba.size() == out.block.key.size());
  for (std::size_t v = 0; v < out.block.key.size(); ++v) {
    CHECK(out.block.key[v] >> 60 == 1);
    const std::uint32_t red = out.block.rgba[v] & 255u, green = out.block.rgba[v] >> 8 & 255u;
    CHECK(red + green >= 253);  // a mean of both, rounded down
    const Double3& p = out.block.position[v];
    if (p[0] + p[1] < 2.0) CHECK(red == 0);
    if (p[0] + p[1] > 6.0) CHECK(green == 0);
  }
}

}  // namespace block_clustering_test
