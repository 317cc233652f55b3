#include "kernels/mesh/block_components.h"

#include <catch2/catch.hpp>

#include "kernels/mesh/face_components.h"

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

TEST_CASE("block components: a strip of foil is folded, a plane one is not, and a wide piece is not asked",
          "[unit]") {
  // Three strips, two faces wide: level, in zigzag, in zigzag but told to have few border edges.
  constexpr std::uint32_t kLength = 20;
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint32_t> of_vertex;
  for (std::uint32_t strip = 0; strip < 3; ++strip) {
    const auto first = static_cast<std::uint32_t>(position.size());
    for (std::uint32_t i = 0; i <= kLength; ++i)
      for (std::uint32_t j = 0; j < 2; ++j) {
        position.push_back({double(i), double(j + 10 * strip), strip > 0 && i % 2 == 1 ? 1.0 : 0.0});
        of_vertex.push_back(strip);
      }
    for (std::uint32_t i = 0; i < kLength; ++i) {
      const std::uint32_t a = first + 2 * i;
      faces.push_back({a, a + 2, a + 3});
      faces.push_back({a, a + 3, a + 1});
    }
  }
  const std::vector<std::uint32_t> count(3, 2 * kLength), border = {42, 42, 5};
  CHECK(count_folded<double>(position, faces, of_vertex, count, border) ==
        std::vector<std::uint32_t>{0, 2 * (kLength - 1), 0});
  // Faces at vertices without a position, which others hold, do not count.
  const std::vector<Double3> none;
  CHECK(count_folded<double>(none, faces, of_vertex, count, border) == std::vector<std::uint32_t>(3, 0));
}

TEST_CASE("block components: a component goes with its vertices, the rest keeps keys and flags", "[unit]") {
  const MeshBlock rest = without_vertices(two_pieces(), std::vector<std::uint64_t>{40, 50, 60});
  CHECK(rest.key == std::vector<std::uint64_t>{0, 10, 20, 30});
  CHECK(rest.faces == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {1, 3, 2}});
  CHECK(rest.face_flags == std::vector<std::uint8_t>{0, kFaceSynthetic});
  CHECK(without_vertices(two_pieces(), {}).faces.size() == 3);
}

}  // namespace tessera::block_components_test
