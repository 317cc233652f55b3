// Patches as mesh blocks: names, places and borders that bricks find by themselves fit together.
#include <catch2/catch.hpp>

#include <algorithm>
#include <map>
#include <utility>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/patch_mesh.h"
#include "tests/helpers/analytic_field.h"
#include "tests/helpers/mesh_checks.h"

namespace patch_mesh_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr Int3 kOrigin = {64, 128, 64};

/// Eight bricks, each from a field of its own.
std::vector<Patch> extract_alone(const std::function<DirectedField(const Int3&)>& field,
                                 ExtractMethod method) {
  ExtractOptions options;
  options.method = method;
  options.names = true;
  std::vector<Patch> patches;
  for (int b = 0; b < 8; ++b) {
    const Int3 origin = {kOrigin[0] + 64 * (b & 1), kOrigin[1] + 64 * (b >> 1 & 1),
                         kOrigin[2] + 64 * (b >> 2)};
    extract_surface(field(origin), options, [&](Patch&& p) { patches.push_back(std::move(p)); });
  }
  return patches;
}

MeshFrame frame() {
  MeshFrame frame;
  frame.lattice.h = 0.37;
  frame.lattice.origin_brick = {-3, 5, 1000};
  frame.double_positions = true;
  frame.colour = true;
  return frame;
}

void check_blocks(const std::vector<Patch>& patches) {
  const IndexedMesh welded = weld(patches);
  REQUIRE(welded.unresolved == 0);
  REQUIRE(welded.faces.size() > 100);
  std::vector<MeshBlock> blocks;
  std::vector<const MeshBlock*> pointers;
  blocks.reserve(patches.size());
  for (const Patch& p : patches) {
    blocks.push_back(make_mesh_block(p, frame()));
    const MeshBlock& block = blocks.back();
    REQUIRE(std::is_sorted(block.key.begin(), block.key.end()));
    REQUIRE(std::adjacent_find(block.key.begin(), block.key.end()) == block.key.end());
    std::vector<std::uint64_t> own;
    for (const VertexKey name : p.name) own.push_back(mesh_key(name));
    REQUIRE(std::is_sorted(own.begin(), own.end()));  // as patch_mesh.h promises
    if (!block.faces.empty()) pointers.push_back(&block);
  }
  const MeshBlock all = merge_blocks(pointers, {}, nullptr);  // throws where a name has two positions
  CHECK(all.key.size() == welded.position.size());
  CHECK(all.faces.size() == welded.faces.size());
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> faces_at, borders_at;
  for (std::size_t f = 0; f < all.faces.size(); ++f)
    for (std::size_t e = 0; e < 3; ++e) {
      const auto edge = std::minmax(all.faces[f][e], all.faces[f][(e + 1) % 3]);
      ++faces_at[edge];
      borders_at[edge] += all.face_flags[f] >> e & 1;
    }
  for (const auto& [edge, faces] : faces_at) REQUIRE(borders_at[edge] == (faces == 1 ? 1 : 0));
  const std::vector<std::uint8_t> complete = complete_stars(all);
  CHECK(std::count(complete.begin(), complete.end(), 1) == static_cast<std::ptrdiff_t>(complete.size()));
  std::map<Double3, VertexClass> classes;
  const MeshFrame f = frame();
  for (std::size_t v = 0; v < welded.position.size(); ++v) {
    Double3 at;
    for (std::size_t a = 0; a < 3; ++a) at[a] = f.lattice.world(static_cast<int>(a), welded.position[v][a]);
    classes[at] = welded.vertex_class[v];
  }
  for (std::size_t v = 0; v < all.key.size(); ++v) {
    const auto found = classes.find(all.position[v]);
    REQUIRE(found != classes.end());
    REQUIRE(found->second == all.vertex_class[v]);
  }
}

}  // namespace

TEST_CASE("patch mesh: noise with holes across eight bricks fits together by names and border flags",
          "[property]") {
  const auto method = GENERATE(ExtractMethod::kMarchingCubes, ExtractMethod::kExtendedMarchingCubes);
  NoiseOptions noise;
  noise.seed = static_cast<std::uint64_t>(GENERATE(1, 2, 3));
  noise.valid_probability = GENERATE(1.0, 0.98, 0.9, 0.75);
  noise.domain_min = {108, 171, 100};
  noise.domain_max = {146, 210, 139};
  noise.inside_probability = noise.seed == 1 ? 0.5 : 0.35;
  CAPTURE(noise.seed, noise.valid_probability);
  check_blocks(extract_alone(
      [&](const Int3& origin) {
        return make_noise_field(noise, origin, {64, 64, 64});
      },
      method));
}

TEST_CASE("patch mesh: creases and borders that cross bricks", "[property]") {
  AnalyticFieldOptions options;
  options.rgba = [](const Double3&) { return 0xff102030u; };
  options.valid = [](const Int3& n) { return n[0] + 2 * n[1] + n[2] < 590; };
  const Shape solid =
      subtract(box({90.2, 150.3, 85.4}, {170.3, 222.2, 160.9}), ball({128.1, 190.2, 130.7}, 30.3));
  check_blocks(extract_alone(
      [&](const Int3& origin) {
        return make_field(solid, origin, {64, 64, 64}, options);
      },
      ExtractMethod::kExtendedMarchingCubes));
}

}  // namespace patch_mesh_test
