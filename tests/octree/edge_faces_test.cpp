#include "octree/edge_faces.h"

#include <map>

#include <catch2/catch.hpp>

#include "tests/helpers/random.h"

namespace tessera::edge_faces_test {
namespace {

using Faces = std::vector<EdgeFaces::Face>;
using Edges = std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::uint32_t>>;

Edges found(std::size_t vertices, const Faces& faces) {
  Edges out;
  std::pair<std::uint32_t, std::uint32_t> last = {0, 0};
  EdgeFaces(vertices, faces)
      .for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
        CHECK((out.empty() || last < std::pair(low, high)));
        last = {low, high};
        out[last].assign(half.begin(), half.end());
      });
  return out;
}

Edges expected(const Faces& faces) {
  Edges out;
  for (std::uint32_t f = 0; f < faces.size(); ++f)
    for (std::uint32_t k = 0; k < 3; ++k)
      out[std::minmax(faces[f][k], faces[f][(k + 1) % 3])].push_back(3 * f + k);
  return out;
}

TEST_CASE("edge faces: of random faces, with hubs and repeated corners, what a map says", "[unit]") {
  test::Random random(5);
  for (const std::size_t vertices : {3, 7, 40, 400}) {
    Faces faces;
    for (std::size_t f = 0; f < 3 * vertices; ++f) {
      const auto any = [&] { return static_cast<std::uint32_t>(random.below(vertices)); };
      faces.push_back({f % 2 == 0 ? 0u : any(), any(), any()});  // every other face has corner 0
    }
    CHECK(found(vertices, faces) == expected(faces));
  }
  CHECK(found(0, {}).empty());
}

TEST_CASE("edge faces: neighbours are the two faces of an edge, whichever way they run", "[unit]") {
  const Faces faces = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {2, 1, 5}, {2, 0, 6}};  // three at 0 1
  const std::vector<std::uint32_t> opposite = opposite_half_edges(7, faces);
  std::vector<std::uint32_t> want(15, kNoHalfEdge);
  want[1] = 9, want[9] = 1;    // 1 2
  want[2] = 12, want[12] = 2;  // 2 0, in the same direction
  CHECK(opposite == want);
}

TEST_CASE("edge faces: half-edges that are not kept take no part", "[unit]") {
  const Faces faces = {{0, 1, 2}, {1, 0, 3}};
  std::size_t edges = 0;
  EdgeFaces(4, faces, [](std::uint32_t half) {
    return half < 3;
  }).for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
    ++edges;
    CHECK(half.size() == 1);
  });
  CHECK(edges == 3);
}

}  // namespace
}  // namespace tessera::edge_faces_test
