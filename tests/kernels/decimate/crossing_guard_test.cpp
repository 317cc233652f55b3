// Decimation adds no place where the mesh meets itself: the guard against all pairs one by one, and what it leaves.
#include "kernels/decimate/crossing_guard.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <limits>

#include "kernels/decimate/decimate.h"
#include "kernels/mesh/block_contacts.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/random.h"

namespace crossing_guard_test {

using namespace tessera;
using namespace tessera::test;

namespace {

std::size_t contacts(const std::vector<ContactFace>& faces) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  std::size_t found = 0;
  block_contacts(faces, {{-kFar, -kFar, -kFar}, {kFar, kFar, kFar}},
                 [&](std::uint32_t, std::uint32_t, FaceContact) { ++found; });
  return found;
}

std::size_t contacts(const MeshBlock& block) {
  std::vector<ContactFace> faces;
  for (const auto& f : block.faces)
    faces.push_back({{block.position[f[0]], block.position[f[1]], block.position[f[2]]}, {f[0], f[1], f[2]}});
  return contacts(faces);
}

std::vector<ContactFace> faces_of(const CollapseMesh& mesh, const CrossingGuard& guard) {
  std::vector<ContactFace> faces;
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f)
    if ((mesh.face(f).state & kStateDead) == 0) faces.push_back(guard.contact_face(f));
  return faces;
}

/// Sheets above each other, each as rough as it is far from the next: they hardly meet, their coarser versions do.
MeshBlock rough_sheets(int edge, int sheets, double roughness, std::uint64_t seed) {
  Random random(seed);
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  const int row = edge + 1;
  for (int s = 0; s < sheets; ++s) {
    const auto first = static_cast<std::uint32_t>(position.size());
    for (int j = 0; j < row; ++j)
      for (int i = 0; i < row; ++i)
        position.push_back(
            {i + random.in(-0.1, 0.1), j + random.in(-0.1, 0.1),
             0.2 * s + 0.8 * std::sin(0.5 * i) * std::cos(0.4 * j) + roughness * random.in(-0.5, 0.5)});
    for (int j = 0; j < edge; ++j)
      for (int i = 0; i < edge; ++i) {
        const auto at = [&](int x, int y) { return first + static_cast<std::uint32_t>(y * row + x); };
        faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  }
  return make_block(position, faces);
}

}  // namespace

TEST_CASE("crossing guard: tells what all pairs of faces tell, collapse by collapse", "[property]") {
  const std::uint64_t seed = GENERATE(1u, 2u, 3u, 4u);
  const bool moves = GENERATE(false, true);
  const MeshBlock block = rough_sheets(10, 3, 0.25, seed);
  CollapseMesh mesh(block, {0, 0, 0});
  CrossingGuard guard(mesh);
  guard.build();
  Random random(seed);
  std::size_t added = 0, harmless = 0;
  Star star;
  for (int step = 0; step < 500; ++step) {
    const auto u = static_cast<std::uint32_t>(random.below(mesh.vertices()));
    if ((mesh.state(u) & kVertexKept) != 0 || !mesh.gather(u, star) || !star.closed) continue;
    const std::size_t at = random.below(star.faces);
    const std::uint32_t v = star.ring[at];
    // As decimation does: two vertices around both ends, and nothing but shared ones.
    std::size_t shared = 0;
    mesh.for_each_neighbour(v, [&](std::uint32_t w) {
      for (std::size_t i = 0; i < star.faces; ++i) shared += star.ring[i] == w;
    });
    if (shared != 2 || (mesh.state(v) & kVertexPinched) != 0 || star.faces < 4) continue;
    std::vector<std::uint32_t> gone;
    std::vector<ContactFace> made;
    // A vertex that moves takes the outline with it: what is known of that holds no more.
    const Double3 to = moves ? mesh.at(v) * 0.7 + mesh.at(u) * 0.3 : mesh.at(v);
    for (std::size_t i = 0; i < star.faces; ++i) {
      gone.push_back(star.corner[i] >> 2);
      const std::uint32_t a = star.ring[i], b = star.ring[(i + 1) % star.faces];
      if (a != v && b != v) made.push_back({{to, mesh.at(a), mesh.at(b)}, {v, a, b}});
    }
    if (moves) {
      Star other;
      if (!mesh.gather(v, other)) continue;
      for (std::size_t i = 0; i < other.faces; ++i) {
        const std::uint32_t f = other.corner[i] >> 2, a = mesh.vertex(next_corner(other.corner[i])),
                            b = mesh.vertex(prev_corner(other.corner[i]));
        if (a == u || b == u) continue;
        gone.push_back(f);
        made.push_back({{to, mesh.at(a), mesh.at(b)}, {v, a, b}});
      }
    }
    const bool flat = std::any_of(made.begin(), made.end(), [](const ContactFace& f) {
      return !(norm(cross(f.corner[1] - f.corner[0], f.corner[2] - f.corner[0])) > 1e-9);
    });
    if (flat) continue;
    const std::size_t before = contacts(faces_of(mesh, guard));
    const bool adds = guard.adds_contact(
        gone, made, moves ? std::span<const std::uint32_t>{} : std::span(star.ring.data(), star.ring_size()));
    if (moves) mesh.node(v).at = to;
    mesh.collapse(star, at);
    guard.update(gone);
    const std::size_t after = contacts(faces_of(mesh, guard));
    CHECK(adds == (after > before));
    (adds ? added : harmless) += 1;
  }
  CHECK(added > 10);
  CHECK(harmless > 10);
}

TEST_CASE("decimate: a mesh that does not meet itself does not afterwards, one that does no more often",
          "[property]") {
  const auto placement = GENERATE(DecimatePlacement::kEndpoint, DecimatePlacement::kOptimal);
  const double roughness = GENERATE(0.1, 0.3);
  const MeshBlock original = rough_sheets(40, 3, roughness, 5);
  const std::size_t before = contacts(original);
  CHECK((before == 0) == (roughness < 0.2));
  DecimateOptions options;
  options.tolerance = 0.4;
  options.placement = placement;
  MeshBlock kept = original, free = original;
  const DecimateReport report = decimate(kept, original, options);
  options.allow_crossings = true;
  decimate(free, original, options);
  CHECK(contacts(kept) <= before);
  CHECK(contacts(free) > contacts(kept));
  CHECK(report.by_crossing > 0);
  CHECK(kept.faces.size() < original.faces.size() / 3);
  CHECK(report.bound <= 0.4);
  // Without tolerance as well.
  MeshBlock plain = original;
  options = {};
  options.placement = placement;
  options.max_cost_class = 900;
  decimate(plain, original, options);
  CHECK(contacts(plain) <= before);
}

}  // namespace crossing_guard_test
