// The corner table of decimation: what is across every edge, and what it refuses.
#include "kernels/decimate/collapse_mesh.h"

#include <catch2/catch.hpp>

#include <map>
#include <utility>

#include "octree/error.h"
#include "tests/helpers/collapse_fixture.h"
#include "tests/helpers/random.h"

namespace tessera::collapse_mesh_test {
namespace {

using Faces = std::vector<std::array<std::uint32_t, 3>>;

const std::vector<Double3> kPlaces = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 0, 1}, {2, 0, 1}};

/// Corners whose faces have the edge across them, but in the other direction.
void check_opposites(const CollapseMesh& mesh) {
  const auto corners = static_cast<std::uint32_t>(4 * mesh.faces().size());
  const auto edge = [&](std::uint32_t c) {
    return std::pair(mesh.vertex(next_corner(c)), mesh.vertex(prev_corner(c)));
  };
  std::vector<std::uint32_t> across(corners, kNoCorner);
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> corner_of;
  for (std::uint32_t c = 0; c < corners; ++c)
    if ((c & 3u) != 3u) corner_of[edge(c)] = c;
  std::size_t inner = 0;
  for (const auto& [ends, c] : corner_of) {
    const auto other = corner_of.find({ends.second, ends.first});
    CHECK(mesh.opposite(c) == (other == corner_of.end() ? kNoCorner : other->second));
    inner += other != corner_of.end();
  }
  CHECK(inner > 0);
}

TEST_CASE("collapse mesh: across each edge lies the face of the other direction", "[unit]") {
  MeshBlock block = test::grid_block(9, 7, [](double x, double y) { return 0.1 * x * y; });
  check_opposites(CollapseMesh(block, Double3{}));
  check_opposites(CollapseMesh(block, Double3{}, CollapseMesh::Order::kNearEnough));
  // Full of holes, so that edges come back to a vertex that none leaves.
  test::Random random(3);
  std::erase_if(block.faces, [&](const auto&) { return random.below(3) == 0; });
  block.face_flags.resize(block.faces.size());
  check_opposites(CollapseMesh(block, Double3{}));
  check_opposites(CollapseMesh(block, Double3{}, CollapseMesh::Order::kNearEnough));
}

TEST_CASE("collapse mesh: edges of more than two faces or of one direction are refused", "[unit]") {
  const auto made = [](const Faces& faces) { CollapseMesh(test::make_block(kPlaces, faces), Double3{}); };
  CHECK_NOTHROW(made({{0, 1, 2}, {1, 0, 4}}));
  CHECK_THROWS_AS(made({{0, 1, 2}, {1, 0, 4}, {0, 1, 5}}),
                  InputError);  // another that leaves the smaller end
  CHECK_THROWS_AS(made({{0, 1, 2}, {1, 0, 4}, {1, 0, 5}}), InputError);  // another that comes to it
  CHECK_THROWS_AS(made({{0, 1, 2}, {0, 1, 4}}), InputError);
  CHECK_THROWS_AS(made({{1, 0, 2}, {1, 0, 4}}), InputError);
  CHECK_THROWS_AS(made({{0, 2, 3}, {1, 2, 3}}), InputError);  // the edges across the first corners
  CHECK_THROWS_AS(made({{0, 3, 2}, {1, 3, 2}}), InputError);
}

}  // namespace
}  // namespace tessera::collapse_mesh_test
