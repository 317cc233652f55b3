#include "kernels/decimate/mean_colours.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <cstdlib>

#include "kernels/mesh/mesh_block_ops.h"

namespace mean_colours_test {

using namespace tessera;

namespace {

/// The square [0, 1]^2 at height z, side x side x 2 faces.
template <class Colour>
MeshBlock made_square(int side, double z, const Colour& colour) {
  MeshBlock block;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) {
      block.key.push_back(block.key.size());
      block.position.push_back({static_cast<double>(i) / side, static_cast<double>(j) / side, z});
      block.rgba.push_back(colour(i, j));
    }
  block.vertex_class.assign(block.key.size(), VertexClass::kSmooth);
  const auto row = static_cast<std::uint32_t>(side + 1);
  for (std::uint32_t j = 0; j + 1 < row; ++j)
    for (std::uint32_t i = 0; i + 1 < row; ++i) {
      const std::uint32_t a = j * row + i;
      block.faces.push_back({a, a + 1, a + row + 1});
      block.faces.push_back({a, a + row + 1, a + row});
    }
  block.face_flags.assign(block.faces.size(), 0);
  canonicalise(block);
  return block;
}

constexpr std::uint32_t kWhite = 0xffffffffu, kBlack = 0xff000000u;

}  // namespace

TEST_CASE("mean colours: speckle becomes its mean, whatever colours the vertices that stayed had", "[unit]") {
  const MeshBlock fine =
      made_square(64, 0.0, [](int i, int j) { return (i + j) % 2 == 0 ? kWhite : kBlack; });
  const MeshBlock coarse = made_square(4, 0.01, [](int, int) { return kWhite; });
  for (const std::uint32_t rgba : mean_colours(coarse, fine, 0.1)) {
    CHECK(rgba >> 24 == 255u);
    for (int c = 0; c < 3; ++c) CHECK(std::abs(static_cast<int>(rgba >> 8 * c & 255u) - 128) < 12);
  }
}

TEST_CASE("mean colours: an edge between two colours stays where it is", "[unit]") {
  const MeshBlock fine = made_square(64, 0.0, [](int i, int) { return i < 32 ? 0xff0000ffu : 0xff00ff00u; });
  const MeshBlock coarse = made_square(8, 0.0, [](int, int) { return kBlack; });
  const std::vector<std::uint32_t> rgba = mean_colours(coarse, fine, 0.1);
  for (std::size_t v = 0; v < rgba.size(); ++v) {
    const double x = coarse.position[v][0];
    if (x < 0.3) CHECK(rgba[v] == 0xff0000ffu);
    if (x > 0.7) CHECK(rgba[v] == 0xff00ff00u);
  }
}

TEST_CASE("mean colours: what is far or has no colour gives none", "[unit]") {
  const MeshBlock coarse = made_square(4, 0.0, [](int, int) { return 0xff123456u; });
  CHECK(mean_colours(coarse, made_square(16, 0.5, [](int, int) { return kWhite; }), 0.1) == coarse.rgba);
  CHECK(mean_colours(coarse, made_square(16, 0.0, [](int, int) { return 0u; }), 0.1) == coarse.rgba);
  CHECK(mean_colours(coarse, MeshBlock{}, 0.1) == coarse.rgba);
}

}  // namespace mean_colours_test
