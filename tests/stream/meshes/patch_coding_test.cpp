// Compact vertices: the same bits come back, also of those that stand elsewhere than their names say.
#include "stream/meshes/patch_coding.h"

#include <catch2/catch.hpp>
#include <map>

#include "kernels/mesh/patch_mesh.h"
#include "stream/meshes/mesh_store.h"
#include "tests/helpers/random.h"

namespace patch_coding_test {

using namespace tessera;

TEST_CASE("patch coding: vertices on lattice edges take few bytes, those beside them come back too",
          "[unit]") {
  const bool doubles = GENERATE(false, true);
  const std::size_t one_in = GENERATE(1, 3, 40, 100000);
  MeshStoreInfo info;
  info.lattice.h = 0.25;
  info.double_positions = doubles;
  test::Random random(4);
  std::map<std::uint64_t, Double3> vertices;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const std::uint32_t x = 64 + i / 50, z = 64 + i % 50;
    Double3 cells = {static_cast<double>(x), 70.0 + static_cast<double>(random.below(65536)) / 65536.0,
                     static_cast<double>(z)};
    if (i % one_in == 0)
      for (double& c : cells) c += 0.01 * random.unit() - 0.02;
    Double3& p = vertices[mesh_key(make_vertex_key(x, 70, z, 1))];
    for (std::size_t a = 0; a < 3; ++a) {
      p[a] = info.lattice.h * cells[a];
      if (!doubles) p[a] = static_cast<double>(static_cast<float>(p[a]));
    }
  }
  MeshBlock block;
  for (const auto& [key, p] : vertices) {
    block.key.push_back(key);
    block.position.push_back(p);
    block.vertex_class.push_back(VertexClass::kSmooth);
  }
  std::vector<char> bytes;
  encode_vertices(block, info, bytes);
  MeshBlock back;
  REQUIRE(decode_vertices(bytes, block.key.size(), info, back));
  CHECK(back.key == block.key);
  CHECK(back.position == block.position);
  CAPTURE(doubles, one_in, bytes.size());
  if (one_in >= 40) CHECK(bytes.size() < 8 * block.key.size());
  bytes.resize(bytes.size() / 2);
  CHECK_FALSE(decode_vertices(bytes, block.key.size(), info, back));
}

TEST_CASE("patch coding: a fraction of a size that there is none of is told, not read", "[fault]") {
  MeshStoreInfo info;
  info.lattice.h = 0.25;
  for (int size = 1; size < 256; ++size) {
    bool read = false;
    // One vertex: its key, the size of fractions, none elsewhere, then as many bytes as it may take.
    for (std::size_t more = 0; more < 32; ++more) {
      std::vector<char> bytes = {5, static_cast<char>(size), 0};
      bytes.resize(bytes.size() + more, 1);
      MeshBlock block;
      read = read || decode_vertices(bytes, 1, info, block);
    }
    CAPTURE(size);
    CHECK(read == (size >= 2 && size <= 4));
  }
}

}  // namespace patch_coding_test
