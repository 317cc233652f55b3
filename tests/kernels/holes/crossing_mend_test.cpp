#include "kernels/holes/crossing_mend.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <set>

#include "kernels/holes/border_retreat.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "tests/helpers/surfaces.h"

namespace crossing_mend_test {
namespace {

using namespace tessera;
using namespace tessera::test;

/// Borders where a face has no neighbour; keys ten apart.
MeshBlock block_of(const std::vector<Surface>& parts) {
  MeshBlock block;
  for (const Surface& s : parts) {
    const auto first = static_cast<std::uint32_t>(block.key.size());
    for (const Double3& p : s.position) {
      block.key.push_back(10 * block.key.size());
      block.position.push_back(p);
    }
    for (const auto& f : s.faces) block.faces.push_back({first + f[0], first + f[1], first + f[2]});
  }
  block.vertex_class.assign(block.key.size(), VertexClass::kSmooth);
  std::set<std::array<std::uint32_t, 2>> edges;
  for (const auto& f : block.faces)
    for (std::size_t k = 0; k < 3; ++k) edges.insert({f[k], f[(k + 1) % 3]});
  for (const auto& f : block.faces) {
    unsigned flags = 0;
    for (std::size_t k = 0; k < 3; ++k)
      if (edges.count({f[(k + 1) % 3], f[k]}) == 0) flags |= 1u << k;
    block.face_flags.push_back(static_cast<std::uint8_t>(flags));
  }
  canonicalise(block);
  return block;
}

std::vector<std::uint32_t> crossing_faces(const MeshBlock& block) {
  std::vector<std::uint32_t> number, out;
  const auto faces = contact_faces(block, &number);
  block_contacts(faces, kAllSpace, [&](std::uint32_t i, std::uint32_t j, FaceContact) {
    out.push_back(number[i]), out.push_back(number[j]);
  });
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

MeshBlock mended(const MeshBlock& block, const CrossingMend& mend) {
  std::vector<std::uint8_t> keep(block.faces.size(), 1);
  for (const std::uint32_t f : mend.removed) keep[f] = 0;
  const MeshBlock rest = select_faces(block, keep);
  const MeshBlock* const both[2] = {&rest, &mend.added};
  return merge_blocks(both, {});
}

/// Each edge has two faces that run along it in opposite directions, or one where the flag says that the surface ends.
bool is_sound(const MeshBlock& block) {
  std::set<std::array<std::uint32_t, 2>> edges;
  for (const auto& f : block.faces)
    for (std::size_t k = 0; k < 3; ++k)
      if (!edges.insert({f[k], f[(k + 1) % 3]}).second) return false;
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const bool alone = edges.count({block.faces[f][(k + 1) % 3], block.faces[f][k]}) == 0;
      if (alone != ((block.face_flags[f] & (1u << k)) != 0)) return false;
    }
  return true;
}

CrossingMendOptions options() {
  CrossingMendOptions o;
  o.first_key = 1u << 20;
  return o;
}

/// Two sheets, a unit apart; a vertex of the lower one reaches through the upper one.
std::vector<Surface> poked(int cells = 20) {
  Surface low = height_grid(cells, cells, [](double x, double y) { return 0.02 * x * x - 0.01 * x * y; });
  Surface high = low;
  for (Double3& p : high.position) p[0] += 0.3, p[1] += 0.2, p[2] += 1.0;
  low.position[static_cast<std::size_t>(10 * (cells + 1) + 10)][2] += 2.5;
  return {low, high};
}

/// Two sheets that end beside each other, in walls of different slope: the corners of one border reach a little into the other.
MeshBlock sheets_that_end_together() {
  const Surface left = height_grid(12, 12, [](double x, double y) { return 0.3 * x + 0.05 * std::sin(y); });
  Surface right = left;
  for (Double3& p : right.position) p = {p[0] + 11.9, p[1] + 0.4, p[2] + 3.62 - 0.55 * p[0]};
  return block_of({left, right});
}

}  // namespace

TEST_CASE("crossing mend: a spike through another sheet goes, all else stays", "[unit]") {
  const MeshBlock block = block_of(poked());
  const std::vector<std::uint32_t> crossing = crossing_faces(block);
  REQUIRE(crossing.size() > 4);
  const CrossingMend mend = mend_crossing(block, crossing, kAllSpace, options());
  REQUIRE(mend.mended);
  CHECK_FALSE(mend.torn);
  CHECK(mend.removed.size() < 40);
  const MeshBlock after = mended(block, mend);
  CHECK(crossing_faces(after).empty());
  CHECK(is_sound(after));
  CHECK(std::includes(mend.removed.begin(), mend.removed.end(), crossing.begin(), crossing.end()));
}

TEST_CASE("crossing mend: the same whatever else the block holds, torn where it holds too little",
          "[property]") {
  const MeshBlock block = block_of(poked());
  const CrossingMend whole = mend_crossing(block, crossing_faces(block), kAllSpace, options());
  REQUIRE(whole.mended);
  const auto within = [&](double radius) {
    const ContactCell cell = {{10 - radius, 10 - radius, -9}, {10 + radius, 10 + radius, 9}};
    std::vector<std::uint8_t> keep;
    for (const auto& f : block.faces) {
      double low = 1e9, high = -1e9, left = 1e9, right = -1e9;
      for (const std::uint32_t v : f) {
        left = std::min(left, block.position[v][0]), right = std::max(right, block.position[v][0]);
        low = std::min(low, block.position[v][1]), high = std::max(high, block.position[v][1]);
      }
      keep.push_back(left <= cell.high[0] && right >= cell.low[0] && low <= cell.high[1] &&
                     high >= cell.low[1]);
    }
    const MeshBlock part = select_faces(block, keep);
    return std::make_pair(part, mend_crossing(part, crossing_faces(part), cell, options()));
  };
  const auto [far, wide] = within(7.0);
  REQUIRE(wide.mended);
  CHECK(wide.added.key == whole.added.key);
  CHECK(wide.added.position == whole.added.position);
  CHECK(wide.added.faces == whole.added.faces);
  CHECK(wide.removed.size() == whole.removed.size());
  const auto [near, narrow] = within(1.1);
  CHECK_FALSE(narrow.mended);
  CHECK(narrow.torn);
}

TEST_CASE("crossing mend: a sheet that folds over itself is laid flat", "[unit]") {
  Surface sheet = height_grid(16, 16, [](double, double) { return 0.0; });
  sheet.position[8 * 17 + 8] = {10.3, 8.4, 0.0};  // across its neighbours
  const MeshBlock block = block_of({sheet});
  const auto crossing = crossing_faces(block);
  REQUIRE_FALSE(crossing.empty());
  const CrossingMend mend = mend_crossing(block, crossing, kAllSpace, options());
  REQUIRE(mend.mended);
  const MeshBlock after = mended(block, mend);
  CHECK(crossing_faces(after).empty());
  CHECK(is_sound(after));
}

TEST_CASE("crossing mend: new vertices lie at floats, and faces are apart as they are written", "[unit]") {
  std::vector<Surface> parts = poked();
  CrossingMendOptions o = options();
  o.float_positions = true;
  // Written to steps of an eighth, what lies nearer than that touches.
  o.written = [](const Double3& p) {
    Double3 q = p;
    for (double& x : q) x = std::round(8.0 * x) / 8.0;
    return q;
  };
  MeshBlock block = block_of(parts);
  const auto crossing = crossing_faces(block);
  const CrossingMend mend = mend_crossing(block, crossing, kAllSpace, o);
  REQUIRE(mend.mended);
  REQUIRE(mend.added.key.size() > 2);
  for (std::size_t v = 0; v < mend.added.key.size(); ++v)
    if (mend.added.key[v] >= o.first_key)
      for (const double x : mend.added.position[v]) CHECK(static_cast<double>(static_cast<float>(x)) == x);
  MeshBlock after = mended(block, mend);
  for (Double3& p : after.position) p = o.written(p);
  CHECK(crossing_faces(after).empty());
}

TEST_CASE("crossing mend: what passes through another surface stays, unless it may be cut at its border",
          "[unit]") {
  const Surface sheet = height_grid(20, 20, [](double, double) { return 0.0; });
  Surface wall = height_grid(6, 6, [](double, double) { return 0.0; });
  for (Double3& p : wall.position)
    p = {p[0] + 7.1, 10.05 + 0.01 * p[1], p[1] - 0.4};  // its lower border sticks through
  const MeshBlock block = block_of({sheet, wall});
  const auto crossing = crossing_faces(block);
  REQUIRE(crossing.size() > 10);
  const CrossingMend kept = mend_crossing(block, crossing, kAllSpace, options());
  CHECK_FALSE(kept.mended);
  CHECK(kept.removed.empty());
  CrossingMendOptions o = options();
  o.may_cut = true;
  const CrossingMend cut = mend_crossing(block, crossing, kAllSpace, o);
  REQUIRE(cut.mended);
  const MeshBlock after = mended(block, cut);
  CHECK(crossing_faces(after).empty());
  CHECK(is_sound(after));
  CHECK(after.faces.size() < block.faces.size());
  CHECK(after.faces.size() > block.faces.size() - 60);
}

TEST_CASE("crossing mend: a border that pokes into another one goes back, and nothing is left out",
          "[unit]") {
  const MeshBlock block = sheets_that_end_together();
  const std::vector<std::uint32_t> crossing = crossing_faces(block);
  REQUIRE(crossing.size() > 2);
  REQUIRE(border_vertices(block, crossing).size() > 2);
  const CrossingMend mend = mend_crossing(block, crossing, kAllSpace, options());
  REQUIRE(mend.mended);
  CHECK(mend.removed.size() == mend.added.faces.size());
  const MeshBlock after = mended(block, mend);
  CHECK(after.faces.size() == block.faces.size());
  CHECK(crossing_faces(after).empty());
  CHECK(is_sound(after));
  // No farther than it has to.
  double farthest = 0.0;
  for (const Double3& p : mend.added.position) {
    double nearest = 1e9;
    for (const Double3& q : block.position) nearest = std::min(nearest, norm(p - q));
    farthest = std::max(farthest, nearest);
  }
  CHECK(farthest > 0.0);
  CHECK(farthest < 0.2);
}

TEST_CASE("crossing mend: gently, a border goes back where a filling would take a spike away", "[unit]") {
  Surface low = height_grid(20, 20, [](double, double) { return 0.0; });
  Surface high = height_grid(10, 10, [](double, double) { return 1.0; });
  for (Double3& p : high.position) p[0] += 0.3, p[1] += 0.2;
  const auto apex = std::find_if(low.position.begin(), low.position.end(),
                                 [](const Double3& p) { return p[0] == 11.0 && p[1] == 5.0; });
  REQUIRE(apex != low.position.end());
  (*apex)[2] = 4.0;
  const Double3 spike = *apex;
  const MeshBlock block = block_of({low, high});
  const std::vector<std::uint32_t> crossing = crossing_faces(block);
  REQUIRE(crossing.size() > 1);
  for (const bool gentle : {false, true}) {
    INFO((gentle ? "gentle" : "not"));
    CrossingMendOptions o = options();
    o.gentle = gentle;
    const CrossingMend mend = mend_crossing(block, crossing, kAllSpace, o);
    REQUIRE(mend.mended);
    const MeshBlock after = mended(block, mend);
    CHECK(crossing_faces(after).empty());
    CHECK(is_sound(after));
    CHECK((after.faces.size() == block.faces.size()) == gentle);
    CHECK((std::find(after.position.begin(), after.position.end(), spike) != after.position.end()) == gentle);
  }
}

TEST_CASE("crossing mend: where no wider block comes, what rings need does not stop what needs less",
          "[unit]") {
  const MeshBlock block = sheets_that_end_together();
  const std::vector<std::uint32_t> crossing = crossing_faces(block);
  const ContactCell two_rings = {{9.5, -2, -99}, {14.5, 14, 99}};
  CrossingMendOptions o = options();
  const CrossingMend torn = mend_crossing(block, crossing, two_rings, o);
  CHECK(torn.torn);
  CHECK_FALSE(torn.mended);
  o.last_block = true;
  const CrossingMend mend = mend_crossing(block, crossing, two_rings, o);
  REQUIRE(mend.mended);
  const MeshBlock after = mended(block, mend);
  CHECK(crossing_faces(after).empty());
  CHECK(is_sound(after));
}

TEST_CASE("crossing mend: around a hole of the mesh, which stays", "[unit]") {
  // A square of the lower sheet is missing, and what is around it reaches through the upper sheet.
  Surface low = height_grid(20, 20, [](double x, double y) { return 0.02 * x * x - 0.01 * x * y; });
  Surface high = low;
  for (Double3& p : high.position) p[0] += 0.3, p[1] += 0.2, p[2] += 1.0;
  for (int j = 9; j <= 12; ++j)
    for (int i = 9; i <= 12; ++i)
      if (i == 9 || i == 12 || j == 9 || j == 12)
        low.position[static_cast<std::size_t>(21 * j + i)][2] += 2.5;
  low.faces.erase(low.faces.begin() + 2 * (20 * 10 + 10), low.faces.begin() + 2 * (20 * 10 + 10) + 2);
  const MeshBlock block = block_of({low, high});
  const std::vector<std::uint32_t> crossing = crossing_faces(block);
  REQUIRE(crossing.size() > 20);
  const CrossingMend mend = mend_crossing(block, crossing, kAllSpace, options());
  REQUIRE(mend.mended);
  const MeshBlock after = mended(block, mend);
  CHECK(crossing_faces(after).empty());
  CHECK(is_sound(after));
  const auto borders = [](const MeshBlock& mesh) {
    int edges = 0;
    for (const std::uint8_t flags : mesh.face_flags)
      for (unsigned k = 0; k < 3; ++k) edges += (flags & (1u << k)) != 0;
    return edges;
  };
  CHECK(borders(after) == borders(block));
  for (int k = 0; k < 4; ++k)
    CHECK(std::count(after.position.begin(), after.position.end(),
                     low.position[static_cast<std::size_t>(21 * (10 + k / 2) + 10 + k % 2)]) == 1);
}

TEST_CASE("crossing mend: fans that were taken apart at an edge do not cross", "[unit]") {
  const ContactFace one = {{Double3{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2}};
  const ContactFace copy = {{Double3{0, 0, 0}, {0, 1, 1}, {1, 0, 0}}, {3, 4, 5}};  // stands on its edge
  const ContactFace through = {{Double3{0, 0, 0}, {0, 1, -1}, {1, 1, 1}},
                               {3, 4, 5}};  // and this one goes through it
  CHECK(face_contact(one, copy) == FaceContact::kTouch);
  CHECK(meet_in_copies(one, copy));
  CHECK(face_contact(one, through) == FaceContact::kCross);
  CHECK_FALSE(meet_in_copies(one, through));
}

TEST_CASE("crossing mend: nothing to do, and the bound grows with the faces", "[unit]") {
  const MeshBlock block = block_of({height_grid(4, 4, [](double, double) { return 0.0; })});
  CHECK_FALSE(mend_crossing(block, {}, kAllSpace, options()).mended);
  CHECK(crossing_mend_bytes(2000, options()) > crossing_mend_bytes(1000, options()));
}

}  // namespace crossing_mend_test
