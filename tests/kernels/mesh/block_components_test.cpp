#include "kernels/mesh/block_components.h"

#include <catch2/catch.hpp>

namespace tessera::block_components_test {

namespace {

/// Two triangles that share an edge (vertices 0 to 3), and one apart (4 to 6); keys are 10 times the index.
MeshBlock two_pieces() {
  MeshBlock block;
  for (std::uint64_t v = 0; v < 7; ++v) block.key.push_back(10 * v);
  block.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {5, 0, 0}, {6, 0, 0}, {5, 1, 0}};
  block.vertex_class.resize(7);
  block.faces = {{0, 1, 2}, {1, 3, 2}, {4, 5, 6}};
  block.face_flags = {0, kFaceSynthetic, 0};
  return block;
}

}  // namespace

TEST_CASE("block components: numbered by their first vertex, open where a star goes on", "[unit]") {
  const std::vector<std::uint8_t> complete = {1, 1, 1, 1, 1, 0, 1};
  const BlockComponents found = find_components(two_pieces(), complete);
  CHECK(found.of_vertex == std::vector<std::uint32_t>{0, 0, 0, 0, 1, 1, 1});
  CHECK(found.faces == std::vector<std::uint32_t>{2, 1});
  CHECK(found.open == std::vector<std::uint8_t>{0, 1});
}

TEST_CASE("block components: a component goes with its vertices, the rest keeps keys and flags", "[unit]") {
  const MeshBlock rest = without_vertices(two_pieces(), std::vector<std::uint64_t>{40, 50, 60});
  CHECK(rest.key == std::vector<std::uint64_t>{0, 10, 20, 30});
  CHECK(rest.faces == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {1, 3, 2}});
  CHECK(rest.face_flags == std::vector<std::uint8_t>{0, kFaceSynthetic});
  CHECK(without_vertices(two_pieces(), {}).faces.size() == 3);
}

}  // namespace tessera::block_components_test
