// Decimation adds no place where the mesh meets itself: the guard against all pairs one by one, and what it leaves.
#include "kernels/decimate/crossing_guard.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <optional>

#include "kernels/decimate/decimate.h"
#include "kernels/mesh/block_contacts.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/random.h"

namespace crossing_guard_test {

using namespace tessera;
using namespace tessera::test;

namespace {

std::size_t contacts(const CollapseMesh& mesh) {
  MeshBlock block;
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) block.position.push_back(mesh.at(v));
  for (const CollapseFace& f : mesh.faces())
    if ((f.state & kStateDead) == 0) block.faces.push_back({f.vertex[0], f.vertex[1], f.vertex[2]});
  return count_contacts(block);
}

bool is_flat(const CollapseMesh& mesh) {
  return std::any_of(mesh.faces().begin(), mesh.faces().end(), [&](const CollapseFace& f) {
    const Double3 &a = mesh.at(f.vertex[0]), &b = mesh.at(f.vertex[1]), &c = mesh.at(f.vertex[2]);
    return (f.state & kStateDead) == 0 && !(norm(cross(b - a, c - a)) > 1e-9);
  });
}

struct RandomCollapse {
  std::uint32_t u = 0;  ///< goes
  std::size_t at = 0;   ///< into that one of its ring
  std::uint32_t v = 0;
};
/// Of a vertex within the mesh whose star may go. \param star  gets it
std::optional<RandomCollapse> random_collapse(const CollapseMesh& mesh, Random& random, Star& star) {
  RandomCollapse c;
  c.u = static_cast<std::uint32_t>(random.below(mesh.vertices()));
  if ((mesh.state(c.u) & kVertexKept) != 0 || !mesh.gather(c.u, star) || !star.closed || star.faces < 4)
    return std::nullopt;
  c.at = random.below(star.faces);
  c.v = star.ring[c.at];
  std::size_t shared = 0;
  mesh.for_each_neighbour(c.v, [&](std::uint32_t w) {
    for (std::size_t i = 0; i < star.faces; ++i) shared += star.ring[i] == w;
  });
  if (shared != 2 || (mesh.state(c.v) & kVertexPinched) != 0) return std::nullopt;
  return c;
}

}  // namespace

TEST_CASE("crossing guard: tells what all pairs of faces tell, edit by edit", "[property]") {
  enum class Edit { kCollapse, kCollapseAndMove, kMove, kFlip };
  const std::uint64_t seed = GENERATE(1u, 2u, 3u);
  const Edit edit = GENERATE(Edit::kCollapse, Edit::kCollapseAndMove, Edit::kMove, Edit::kFlip);
  const MeshBlock block = rough_sheets(10, 3, 0.25, seed);
  CollapseMesh mesh(block, {0, 0, 0});
  CrossingGuard guard(mesh);
  guard.renew(GENERATE(FaceBoxes::Order::kGiven, FaceBoxes::Order::kMorton));
  Random random(seed);
  std::size_t added = 0, harmless = 0;
  Star star, other;
  for (int step = 0; step < 400; ++step) {
    const auto u = static_cast<std::uint32_t>(random.below(mesh.vertices()));
    if ((mesh.state(u) & kVertexKept) != 0 || !mesh.gather(u, star) || !star.closed) continue;
    const std::size_t at = random.below(star.faces);
    const std::uint32_t v = star.ring[at];
    const CollapseMesh before = mesh;
    bool adds = false;
    if (edit == Edit::kMove) {
      const Double3 to = mesh.at(u) * 0.4 + mesh.at(v) * 0.6 + Double3{0, 0, random.in(-0.2, 0.2)};
      adds = guard.move_adds(star, to);
      mesh.node(u).at = to;
    } else if (edit == Edit::kFlip) {
      const std::uint32_t c = star.corner[at], across = mesh.opposite(c);
      if (across == kNoCorner) continue;
      bool exists = false;
      mesh.for_each_neighbour(u, [&](std::uint32_t w) { exists |= w == mesh.vertex(across); });
      if (exists) continue;
      adds = guard.flip_adds(c);
      mesh.flip(c);
    } else {
      // As decimation does: two vertices around both ends, and no more.
      std::size_t shared = 0;
      mesh.for_each_neighbour(v, [&](std::uint32_t w) {
        for (std::size_t i = 0; i < star.faces; ++i) shared += star.ring[i] == w;
      });
      if (shared != 2 || (mesh.state(v) & kVertexPinched) != 0 || star.faces < 4 || !mesh.gather(v, other))
        continue;
      const Double3 to = mesh.at(v) * 0.7 + mesh.at(u) * 0.3;
      adds =
          edit == Edit::kCollapse ? guard.collapse_adds(star, at) : guard.collapse_adds(star, at, other, to);
      if (edit == Edit::kCollapseAndMove) mesh.node(v).at = to;
      mesh.collapse(star, at);
    }
    if (is_flat(mesh)) {  // no face to ask about
      mesh = before;
      continue;
    }
    if (edit == Edit::kCollapse || edit == Edit::kCollapseAndMove)
      guard.accept_collapse(star);
    else
      guard.accept();
    CHECK(adds == (contacts(mesh) > contacts(before)));
    if (adds) CHECK(guard.made_meet());
    if (contacts(mesh) == 0) CHECK_FALSE(guard.made_meet());
    (adds ? added : harmless) += 1;
  }
  CHECK(added > 5);
  CHECK(harmless > 10);
}

TEST_CASE("crossing guard: of a face alone a collapse leaves nothing to ask about", "[unit]") {
  MeshBlock block;
  block.key = {0, 1, 2};
  block.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  block.vertex_class.assign(3, VertexClass::kSmooth);
  block.faces = {{0, 1, 2}};
  block.face_flags = {kFaceBorder01 | kFaceBorder01 << 1 | kFaceBorder01 << 2};
  CollapseMesh mesh(block, {0, 0, 0});
  CrossingGuard guard(mesh);
  guard.renew(FaceBoxes::Order::kGiven);
  Star star;
  REQUIRE(mesh.gather(0, star));
  CHECK_FALSE(guard.collapse_adds(star, 0));
  mesh.collapse(star, 0);
  guard.accept_collapse(star);
  CHECK_FALSE(guard.made_meet());
}

TEST_CASE("crossing guard: collapses that it is not asked about, before and after it is first asked",
          "[property]") {
  const std::uint64_t seed = GENERATE(4u, 5u, 6u);
  const MeshBlock block = rough_sheets(10, 3, 0.25, seed);
  CollapseMesh mesh(block, {0, 0, 0});
  CrossingGuard guard(mesh);
  guard.renew(FaceBoxes::Order::kGiven);
  if (GENERATE(false, true)) guard.use_sheets();
  Random random(seed);
  std::size_t added = 0, harmless = 0, meeting = 0;
  Star star;
  for (int step = 0; step < 300; ++step) {
    const auto collapse = random_collapse(mesh, random, star);
    if (!collapse) continue;
    const std::size_t at = collapse->at;
    const CollapseMesh before = mesh;
    const bool asked = step > 40 && random.below(3) != 0;
    const bool adds = asked && guard.collapse_adds(star, at);
    mesh.collapse(star, at);
    if (is_flat(mesh)) {
      mesh = before;
      continue;
    }
    if (asked) {
      guard.accept_collapse(star);
      CHECK(adds == (contacts(mesh) > contacts(before)));
      (adds ? added : harmless) += 1;
    } else {
      guard.accept_unasked(star);
    }
  }
  CHECK(added > 5);
  CHECK(harmless > 10);
  // Each face by itself: as often as it is in a pair of all pairs.
  std::vector<ContactFace> faces;
  std::vector<std::uint32_t> number;
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    const CollapseFace& face = mesh.face(f);
    if ((face.state & kStateDead) != 0) continue;
    number.push_back(f);
    faces.push_back({{mesh.at(face.vertex[0]), mesh.at(face.vertex[1]), mesh.at(face.vertex[2])},
                     {face.vertex[0], face.vertex[1], face.vertex[2]}});
  }
  std::vector<bool> in_pair(faces.size(), false);
  block_contacts(faces, kAllSpace, [&](std::uint32_t i, std::uint32_t j, FaceContact) {
    if (!meet_in_copies(faces[i], faces[j])) in_pair[i] = in_pair[j] = true;
  });
  for (std::size_t i = 0; i < faces.size(); ++i) {
    CHECK(guard.meets(number[i]) == in_pair[i]);
    meeting += in_pair[i];
  }
  CHECK(meeting > 5);
  CHECK(meeting < faces.size());
}

TEST_CASE("crossing guard: collapses in a sheet are answered without a search, as all pairs tell",
          "[property]") {
  const std::uint64_t seed = GENERATE(7u, 8u, 9u);
  const int sheets = GENERATE(1, 2);
  MeshBlock block = rough_sheets(24, sheets, 0.25, seed);
  for (Double3& p : block.position)
    if (std::fabs(p[0] - 5.0) < 3.0) p[0] += 2.0 * std::sin(p[1]);  // folds
  CollapseMesh mesh(block, {0, 0, 0});
  CrossingGuard guard(mesh);
  guard.renew(FaceBoxes::Order::kGiven);
  guard.use_sheets();
  Random random(seed);
  std::size_t added = 0, spared = 0;
  Star star, other;
  for (int step = 0; step < 500; ++step) {
    const auto collapse = random_collapse(mesh, random, star);
    if (!collapse || !mesh.gather(collapse->v, other)) continue;
    const auto [u, at, v] = *collapse;
    const CollapseMesh before = mesh;
    const std::uint64_t looked = guard.looked_at();
    const auto kind = step < 20 ? 0 : random.below(10) > 1 ? 2 : random.below(2);
    const Double3 to = mesh.at(v) * 0.7 + mesh.at(u) * 0.3;
    const bool adds = kind == 0   ? false
                      : kind == 1 ? guard.collapse_adds(star, at, other, to)
                                  : guard.collapse_adds(star, at);
    if (kind == 1) mesh.node(v).at = to;
    mesh.collapse(star, at);
    if (is_flat(mesh)) {
      mesh = before;
      continue;
    }
    if (kind == 0) {
      guard.accept_unasked(star);
      continue;
    }
    guard.accept_collapse(star);
    CHECK(adds == (contacts(mesh) > contacts(before)));
    added += adds;
    spared += kind > 1 && guard.looked_at() == looked;
  }
  CHECK(added > 3);
  if (sheets == 1) CHECK(spared > 5);
}

TEST_CASE("crossing guard: fans that hang together in copies of a vertex may not cross for that", "[unit]") {
  // Two pyramids tip to tip, the tip twice.
  const MeshBlock block =
      make_block({{0, 0, 0},
                  {1, 0, -1},
                  {0, 1, -1},
                  {-1, 0, -1},
                  {0, -1, -1},
                  {0, 0, 0},
                  {1, 0, 1},
                  {0, 1, 1},
                  {-1, 0, 1},
                  {0, -1, 1}},
                 {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}, {5, 7, 6}, {5, 8, 7}, {5, 9, 8}, {5, 6, 9}});
  CHECK(count_contacts(block) == 0);
  const CollapseMesh mesh(block, {0, 0, 0});
  CrossingGuard guard(mesh);
  guard.renew(FaceBoxes::Order::kGiven);
  Star star;
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) {
    if (mesh.at(v) != Double3{0, 0, 0}) continue;
    REQUIRE(mesh.gather(v, star));
    REQUIRE(star.closed);
    const double out = mesh.at(star.ring[0])[2];  // towards its own base
    CHECK_FALSE(guard.move_adds(star, {0.1, 0.05, 0.3 * out}));
    CHECK(guard.move_adds(star, {0.1, 0.05, -0.7 * out}));
  }
}

TEST_CASE("crossing guard: no vertex is put onto another, which would make it a copy", "[unit]") {
  // Two pyramids tip to tip, not quite.
  const MeshBlock block =
      make_block({{0, 0, -0.25},
                  {1, 0, -1},
                  {0, 1, -1},
                  {-1, 0, -1},
                  {0, -1, -1},
                  {0, 0, 0.25},
                  {1, 0, 1},
                  {0, 1, 1},
                  {-1, 0, 1},
                  {0, -1, 1}},
                 {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}, {5, 7, 6}, {5, 8, 7}, {5, 9, 8}, {5, 6, 9}});
  CollapseMesh mesh(block, {0, 0, 0});
  CrossingGuard guard(mesh);
  guard.renew(FaceBoxes::Order::kGiven);
  Star star;
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) {
    const Double3 at = mesh.at(v);
    if (at[0] != 0.0 || at[1] != 0.0) continue;
    REQUIRE(mesh.gather(v, star));
    REQUIRE(star.closed);
    const Double3 other = {0, 0, -at[2]};
    CHECK(guard.move_adds(star, other));
    CHECK_FALSE(guard.move_adds(star, {0, 0, 0}));
    CHECK_FALSE(guard.move_adds(star, at));
  }
  // Where it was put all the same, it is a copy as any other.
  MeshBlock touching = block;
  touching.position[0] = touching.position[5];
  CHECK(count_contacts(touching) == 0);
}

TEST_CASE("decimate: a mesh that does not meet itself does not afterwards, one that does no more often",
          "[property]") {
  const auto placement = GENERATE(DecimatePlacement::kEndpoint, DecimatePlacement::kOptimal);
  const double roughness = GENERATE(0.1, 0.3);
  const MeshBlock original = rough_sheets(40, 3, roughness, 5);
  const std::size_t before = count_contacts(original);
  CHECK((before == 0) == (roughness < 0.2));
  DecimateOptions options;
  options.tolerance = 0.4;
  options.placement = placement;
  MeshBlock kept = original, free = original;
  const DecimateReport report = decimate(kept, original, options);
  options.allow_crossings = true;
  decimate(free, original, options);
  CHECK(count_contacts(kept) <= before);
  CHECK(count_contacts(free) > count_contacts(kept));
  CHECK(report.by_crossing > 0);
  CHECK(kept.faces.size() < original.faces.size() / 3);
  CHECK(report.bound <= 0.4);
  // Without tolerance as well.
  MeshBlock plain = original;
  options = {};
  options.placement = placement;
  options.max_cost_class = 900;
  decimate(plain, original, options);
  CHECK(count_contacts(plain) <= before);
}

}  // namespace crossing_guard_test
