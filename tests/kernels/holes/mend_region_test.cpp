#include "kernels/holes/mend_region.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/mesh/mesh_block_ops.h"
#include "tests/helpers/surfaces.h"

namespace mend_region_test {
namespace {

using namespace tessera;
using namespace tessera::test;
using Faces = std::vector<std::uint32_t>;

/// A flat grid of 10 x 10 squares, without those that `gone` names by their column and row.
template <class Gone>
MeshBlock grid_without(const Gone& gone) {
  const Surface s = height_grid(10, 10, [](double, double) { return 0.0; });
  MeshBlock block;
  for (std::size_t v = 0; v < s.position.size(); ++v) block.key.push_back(v);
  block.position = s.position;
  block.vertex_class.assign(block.key.size(), VertexClass::kSmooth);
  for (std::size_t f = 0; f < s.faces.size(); ++f)
    if (!gone(static_cast<int>(f / 2 % 10), static_cast<int>(f / 20))) block.faces.push_back(s.faces[f]);
  block.face_flags.assign(block.faces.size(), 0);
  return block;
}

Double3 middle(const MeshBlock& block, std::uint32_t f) {
  const auto& c = block.faces[f];
  return (block.position[c[0]] + block.position[c[1]] + block.position[c[2]]) * (1.0 / 3.0);
}

/// Faces whose middle lies in a box.
Faces faces_within(const MeshBlock& block, double left, double right, double low, double high) {
  Faces out;
  for (std::uint32_t f = 0; f < block.faces.size(); ++f) {
    const Double3 p = middle(block, f);
    if (p[0] > left && p[0] < right && p[1] > low && p[1] < high) out.push_back(f);
  }
  return out;
}

/// Of the polygon in the plane of the grid.
double area_of(const MeshBlock& block, const std::vector<std::uint32_t>& loop) {
  double sum = 0.0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Double3 &a = block.position[loop[i]], &b = block.position[loop[(i + 1) % loop.size()]];
    sum += 0.5 * (a[0] * b[1] - a[1] * b[0]);
  }
  return sum;
}

}  // namespace

TEST_CASE("mend region: a disk has its outline, at the border of the mesh too", "[unit]") {
  const MeshBlock block = grid_without([](int, int) { return false; });
  const MendRegion around(block, kAllSpace);
  for (const double left : {0.0, 3.0}) {
    Faces region = faces_within(block, left, left + 2, 4, 6);
    const auto disks = around.disks_of(region, 100, 100);
    REQUIRE(disks.has_value());
    REQUIRE(disks->size() == 1);
    CHECK(disks->front().faces == region);
    CHECK(region.size() == 8);
    CHECK(disks->front().loop.size() == 8);
    CHECK(area_of(block, disks->front().loop) == 4.0);
  }
}

TEST_CASE("mend region: holes of the mesh stay holes, bridged to the outline", "[unit]") {
  const MeshBlock block = grid_without([](int i, int j) { return (i == 4 || i == 6) && j == 5; });
  const MendRegion around(block, kAllSpace);
  Faces region = faces_within(block, 3, 8, 4, 7);
  const Faces given = region;
  const auto disks = around.disks_of(region, 100, 100);
  REQUIRE(disks.has_value());
  REQUIRE(disks->size() == 1);
  CHECK(region == given);
  const auto& loop = disks->front().loop;
  CHECK(loop.size() == 16 + 2 * (4 + 2));
  CHECK(area_of(block, loop) == 13.0);
  std::vector<std::uint32_t> once = loop;
  sort_unique(once);
  CHECK(once.size() == 16 + 2 * 4);
  CHECK_FALSE(around.disks_of(region, 100, 27).has_value());
}

TEST_CASE("mend region: a component that is a ring has its longest loop outside", "[unit]") {
  const MeshBlock block =
      grid_without([](int i, int j) { return i < 2 || i > 4 || j < 2 || j > 4 || (i == 3 && j == 3); });
  const MendRegion around(block, kAllSpace);
  Faces region = faces_within(block, 0, 10, 0, 10);
  const auto disks = around.disks_of(region, 100, 100);
  REQUIRE(disks.has_value());
  REQUIRE(disks->size() == 1);
  CHECK(area_of(block, disks->front().loop) == 8.0);
}

TEST_CASE("mend region: islands are taken along, and what is around a vertex where an outline meets itself",
          "[unit]") {
  const MeshBlock block = grid_without([](int, int) { return false; });
  const MendRegion around(block, kAllSpace);
  Faces ring = faces_within(block, 2, 7, 2, 7);
  const Faces whole = ring;
  const Faces island = faces_within(block, 4, 5, 4, 5);
  ring.erase(std::remove_if(ring.begin(), ring.end(),
                            [&](auto f) { return std::binary_search(island.begin(), island.end(), f); }),
             ring.end());
  auto disks = around.disks_of(ring, 100, 100);
  REQUIRE(disks.has_value());
  CHECK(ring == whole);
  // Two squares that share a corner and hang together around another one: the loop meets itself in that corner.
  Faces pinched = faces_within(block, 2, 5, 2, 3);
  for (const Faces& more :
       {faces_within(block, 4, 5, 2, 4), faces_within(block, 3, 5, 4, 5), faces_within(block, 2, 4, 3, 4)})
    pinched.insert(pinched.end(), more.begin(), more.end());
  sort_unique(pinched);
  const Faces corner = faces_within(block, 3, 4, 3, 4);
  pinched.erase(std::remove_if(pinched.begin(), pinched.end(),
                               [&](auto f) { return std::binary_search(corner.begin(), corner.end(), f); }),
                pinched.end());
  const std::size_t before = pinched.size();
  disks = around.disks_of(pinched, 100, 100);
  REQUIRE(disks.has_value());
  CHECK(disks->size() == 1);
  CHECK(pinched.size() > before);
  CHECK(area_of(block, disks->front().loop) == 0.5 * static_cast<double>(pinched.size()));
}

TEST_CASE("mend region: none where it is no disk, too large or torn", "[unit]") {
  const MeshBlock block = grid_without([](int, int) { return false; });
  const MendRegion around(block, kAllSpace);
  Faces region = faces_within(block, 3, 6, 3, 6);
  CHECK_FALSE(around.disks_of(region, 100, 11).has_value());
  CHECK(around.is_known(region));
  const ContactCell part = {{2.5, 2.5, -1}, {5.5, 7, 1}};
  const MendRegion torn(block, part);
  CHECK_FALSE(torn.is_known(region));
  CHECK(torn.is_within({3, 3, 0}));
  // A closed surface has no outline.
  const Surface ball = sphere(1, 1.0);
  MeshBlock closed;
  for (std::size_t v = 0; v < ball.position.size(); ++v) closed.key.push_back(v);
  closed.position = ball.position;
  closed.faces = ball.faces;
  closed.face_flags.assign(ball.faces.size(), 0);
  const MendRegion all(closed, kAllSpace);
  Faces every;
  for (std::uint32_t f = 0; f < closed.faces.size(); ++f) every.push_back(f);
  CHECK_FALSE(all.disks_of(every, 1000, 1000).has_value());
  // A band around it has two outlines. Beyond lie more than 200 faces on both sides, or so few that less stays than goes.
  for (const int levels : {4, 2}) {
    const Surface fine = sphere(levels, 1.0);
    MeshBlock banded;
    for (std::size_t v = 0; v < fine.position.size(); ++v) banded.key.push_back(v);
    banded.position = fine.position;
    banded.faces = fine.faces;
    banded.face_flags.assign(fine.faces.size(), 0);
    Faces band;
    for (std::uint32_t f = 0; f < banded.faces.size(); ++f)
      if (std::abs(middle(banded, f)[2]) < 0.35) band.push_back(f);
    REQUIRE(band.size() > 10);
    CHECK_FALSE(MendRegion(banded, kAllSpace).disks_of(band, 5000, 5000).has_value());
  }
}

}  // namespace mend_region_test
