// Rings of faces around vertices: patch by patch they are those of the whole mesh.
#include "stream/meshes/mesh_rings.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <limits>
#include <vector>

#include "tests/helpers/temp_folder.h"
#include "tests/helpers/torn_sheet.h"

namespace mesh_rings_test {

using namespace tessera;

TEST_CASE("mesh rings: as breadth first over the whole mesh", "[property]") {
  const test::TempFolder folder;
  const std::uint64_t lost = GENERATE(3u, 8u, 1000u);
  const MeshBlock mesh = test::torn_sheet(48, lost, 7 + lost);
  const MeshStore store = test::store_of(mesh, folder / "a.tmm");
  REQUIRE(store.patches().size() > 40);
  test::Random random(5);
  for (const int rings : {1, 2, 5, 13, 40}) {
    const auto patch = static_cast<std::size_t>(random.below(store.patches().size()));
    const MeshBlock own = store.load({&patch, 1});
    std::vector<std::uint64_t> keys;
    for (int i = 0; i < 2; ++i) keys.push_back(own.key[random.below(own.key.size())]);
    constexpr int kFar = std::numeric_limits<int>::max();
    std::vector<int> depth(mesh.key.size(), kFar);
    for (std::size_t v = 0; v < depth.size(); ++v)
      if (mesh.key[v] == keys[0] || mesh.key[v] == keys[1]) depth[v] = 0;
    std::vector<std::uint8_t> keep(mesh.faces.size(), 0);
    for (int d = 0; d < rings; ++d)
      for (std::size_t f = 0; f < keep.size(); ++f) {
        const auto& c = mesh.faces[f];
        if (depth[c[0]] != d && depth[c[1]] != d && depth[c[2]] != d) continue;
        keep[f] = 1;
        for (const std::uint32_t v : c)
          if (depth[v] == kFar) depth[v] = d + 1;
      }
    const MeshBlock expected = select_faces(mesh, keep);
    const auto got = load_rings(store, {&patch, 1}, keys, rings, [](auto, auto) { return true; });
    REQUIRE(got);
    CHECK(got->block.key == expected.key);
    CHECK(got->block.position == expected.position);
    CHECK(got->block.faces == expected.faces);
    CHECK(got->block.face_flags == expected.face_flags);
  }
}

TEST_CASE("mesh rings: of all vertices of some patches, each with the first patch that has it", "[unit]") {
  const test::TempFolder folder;
  const MeshBlock mesh = test::torn_sheet(48, 9, 2);
  const MeshStore store = test::store_of(mesh, folder / "a.tmm");
  const std::vector<std::size_t> patches = {3, 4, 17};
  const MeshBlock own = store.load(patches);
  const auto all = [](auto, auto) { return true; };
  const auto got = load_rings(store, patches, {}, 4, all),
             by_key = load_rings(store, patches, own.key, 4, all);
  REQUIRE((got && by_key));
  CHECK(got->block.key == by_key->block.key);
  CHECK(got->block.faces == by_key->block.faces);
  std::size_t shared = 0;
  for (const std::uint64_t key : own.key) {
    const auto at = static_cast<std::size_t>(
        std::lower_bound(got->block.key.begin(), got->block.key.end(), key) - got->block.key.begin());
    std::vector<std::uint32_t> with;
    for (std::size_t p = 0; p < store.patches().size(); ++p) {
      const MeshBlock patch = store.load({&p, 1});
      if (std::binary_search(patch.key.begin(), patch.key.end(), key))
        with.push_back(static_cast<std::uint32_t>(p));
    }
    CHECK(got->first_patch[at] == with.front());
    shared += with.size() > 1;
  }
  CHECK(shared > 10);
}

TEST_CASE("mesh rings: nothing where they do not fit", "[unit]") {
  const test::TempFolder folder;
  const MeshBlock mesh = test::torn_sheet(48, 1000, 1);
  const MeshStore store = test::store_of(mesh, folder / "a.tmm");
  const std::size_t patch = store.patches().size() / 2;
  const std::vector<std::uint64_t> key = {store.load({&patch, 1}).key[0]};
  const auto whole = load_rings(store, {&patch, 1}, key, 10, [](auto, auto) { return true; });
  REQUIRE(whole);
  const std::uint64_t vertices = whole->block.key.size(), faces = whole->block.faces.size();
  const auto within = [&](std::uint64_t v, std::uint64_t f) {
    return load_rings(store, {&patch, 1}, key, 10,
                      [=](std::uint64_t found, std::uint64_t made) { return found <= v && made <= f; });
  };
  CHECK(within(vertices, faces));
  CHECK_FALSE(within(vertices - 1, faces));
  CHECK_FALSE(within(vertices, faces - 1));
}

}  // namespace mesh_rings_test
