// Crossings in which a risky face takes part, against all pairs one by one.
#include <catch2/catch.hpp>

#include <set>
#include <utility>

#include "kernels/mesh/orientation_sign.h"
#include "kernels/mesh/risky_crossings.h"
#include "tests/helpers/random.h"

namespace risky_crossings_test {

using namespace tessera;

namespace {

using Pairs = std::set<std::pair<std::uint32_t, std::uint32_t>>;

/// \param risky  per face
Pairs found(const std::vector<ContactFace>& faces, const std::vector<std::uint8_t>& risky,
            const ContactCell& core) {
  RiskyMesh mesh;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto first = static_cast<std::uint32_t>(mesh.position.size());
    for (std::size_t i = 0; i < 3; ++i) {
      mesh.position.push_back(faces[f].corner[i]);
      mesh.name.push_back(faces[f].vertex[i]);
      mesh.risky.push_back(risky[f]);
    }
    mesh.faces.push_back({first, first + 1, first + 2});
  }
  Pairs pairs;
  risky_crossings(mesh, core, [&](std::uint32_t i, std::uint32_t j) {
    CHECK(i < j);
    CHECK(pairs.insert({i, j}).second);
  });
  return pairs;
}

/// Faces of about a cell in a cube of 8, a few of them without an area.
std::vector<ContactFace> strewn_faces(std::uint64_t seed, std::size_t count) {
  test::Random random(seed);
  std::vector<ContactFace> faces;
  for (std::size_t f = 0; f < count; ++f) {
    ContactFace& face = faces.emplace_back();
    const Double3 middle = {random.in(0, 8), random.in(0, 8), random.in(0, 8)};
    for (std::size_t i = 0; i < 3; ++i) {
      face.vertex[i] = 3 * f + i;
      for (std::size_t a = 0; a < 3; ++a) face.corner[i][a] = middle[a] + random.in(-0.5, 0.5);
    }
    if (f % 50 == 0) face.corner[2] = face.corner[1];
  }
  return faces;
}

}  // namespace

TEST_CASE("risky crossings: what only touches counts", "[unit]") {
  RiskyMesh mesh;
  mesh.position = {{1, 1, 1}, {2, 1, 1}, {1, 2, 1}, {1.2, 1.2, 1}, {2, 1, 2}, {1, 2, 2}};  // a tip on a face
  mesh.name = {0, 1, 2, 3, 4, 5};
  mesh.risky = {0, 0, 0, 1, 0, 0};
  mesh.faces = {{0, 1, 2}, {3, 4, 5}};
  int pairs = 0;
  const auto count = [&](std::uint32_t, std::uint32_t) { ++pairs; };
  risky_crossings(mesh, {{0, 0, 0}, {8, 8, 8}}, count);
  CHECK(pairs == 1);
}

TEST_CASE("risky crossings: those of all pairs, one by one", "[property]") {
  const ContactCell core = {{0, 0, 0}, {8, 8, 8}};
  std::size_t all = 0;
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const std::vector<ContactFace> faces = strewn_faces(seed, 1000);
    std::vector<std::uint8_t> risky(faces.size());
    test::Random random(seed + 100);
    for (std::uint8_t& r : risky) r = random.unit() < 0.1;
    Pairs expected;
    const auto flat = [](const ContactFace& f) { return collinear(f.corner[0], f.corner[1], f.corner[2]); };
    for (std::uint32_t i = 0; i < faces.size(); ++i)
      for (std::uint32_t j = i + 1; j < faces.size(); ++j) {
        if ((!risky[i] && !risky[j]) || flat(faces[i]) || flat(faces[j])) continue;
        const FaceContact contact = face_contact(faces[i], faces[j]);
        if (contact != FaceContact::kCross && contact != FaceContact::kOverlap) continue;
        bool inside = true;
        for (std::size_t a = 0; a < 3; ++a) {
          const auto low = [&](const ContactFace& f) {
            return std::min({f.corner[0][a], f.corner[1][a], f.corner[2][a]});
          };
          const double first = std::max(low(faces[i]), low(faces[j]));
          inside = inside && first >= core.low[a] && first < core.high[a];
        }
        if (inside) expected.insert({i, j});
      }
    CHECK(found(faces, risky, core) == expected);
    all += expected.size();
  }
  CHECK(all > 100);
}

TEST_CASE("risky crossings: none where no face is risky", "[unit]") {
  const std::vector<ContactFace> faces = strewn_faces(1, 300);
  CHECK(found(faces, std::vector<std::uint8_t>(faces.size()), {{0, 0, 0}, {8, 8, 8}}).empty());
}

}  // namespace risky_crossings_test
