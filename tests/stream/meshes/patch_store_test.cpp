#include <catch2/catch.hpp>
#include <fstream>

#include "octree/error.h"
#include "stream/meshes/patch_store.h"
#include "tests/helpers/temp_folder.h"

namespace patch_store_test {

using namespace tessera;
using test::TempFolder;

namespace {

/// Two triangles that share no vertex, and one own vertex that only a neighbour uses.
Patch two_islands(const Int3& brick, bool colour) {
  Patch p;
  p.brick = brick;
  for (int i = 0; i < 6; ++i) p.position.push_back({float(i), float(i * i), 0.5f});
  if (colour) p.rgba.assign(6, 0xff0000ffu);
  p.vertex_class.assign(6, VertexClass::kSmooth);
  p.foreign = {make_vertex_key(100, 2, 3, 0), make_vertex_key(101, 2, 3, 1)};
  p.faces = {{0, 1, 2}, {3, 6, 7}, {6, 4, 7}};
  p.exported = {{make_vertex_key(1, 1, 1, 0), 5}, {make_vertex_key(1, 2, 1, 2), 0}};
  return p;
}

}  // namespace

TEST_CASE("patch components: islands, shared foreign vertices, lone vertices", "[unit]") {
  const PatchComponents c = find_components(two_islands({1, 1, 1}, false));
  CHECK(c.count == 3);
  CHECK(c.of_vertex == std::vector<std::uint32_t>{0, 0, 0, 1, 1, 2, 1, 1});
  CHECK(c.vertices == std::vector<std::uint32_t>{3, 2, 1});
  CHECK(c.faces == std::vector<std::uint32_t>{1, 2, 0});
}

TEST_CASE("patch store: what is written comes back, over several files", "[unit]") {
  const TempFolder folder;
  const std::vector<std::filesystem::path> files = {folder / "000000.tsm", folder / "000001.tsm"};
  const Patch a = two_islands({1, 1, 1}, true);
  const Patch b = two_islands({2, 1, 1}, false);
  {
    PatchFileWriter w(files[0]);
    w.add(a, find_components(a));
    const std::uint64_t bytes = w.finish();
    CHECK(bytes == std::filesystem::file_size(files[0]));
    PatchFileWriter v(files[1]);
    v.add(b, find_components(b));
    v.finish();
  }
  const PatchStore store(files);
  REQUIRE(store.patches().size() == 2);
  CHECK(store.file_range(1) == std::pair<std::size_t, std::size_t>{1, 2});
  CHECK(store.find(brick_key({2, 1, 1})) == 1);
  CHECK(store.find(brick_key({3, 1, 1})) == -1);
  std::vector<Float3> position;
  std::vector<std::uint32_t> rgba;
  store.load_vertices(0, position, rgba);
  CHECK(position == a.position);
  CHECK(rgba == a.rgba);
  store.load_vertices(1, position, rgba);
  CHECK(rgba.empty());
  std::vector<PatchFace> faces;
  store.load_faces(1, faces);
  CHECK(faces == b.faces);
  const PatchSeam seam = store.load_seam(0);
  CHECK(seam.foreign == a.foreign);
  CHECK(seam.exported_key == std::vector<VertexKey>{a.exported[0].first, a.exported[1].first});
  CHECK(seam.exported_index == std::vector<std::uint32_t>{5, 0});
  CHECK(seam.components.of_vertex == find_components(a).of_vertex);
}

TEST_CASE("patch store: damage is named, not meshed", "[fault]") {
  const TempFolder folder;
  const auto path = folder / "000000.tsm";
  const Patch a = two_islands({1, 1, 1}, false);
  {
    PatchFileWriter w(path);
    w.add(a, find_components(a));
    w.finish();
  }
  const auto size = std::filesystem::file_size(path);
  SECTION("one flipped byte in a position") {
    {
      std::fstream f(path, std::ios::in | std::ios::out | std::ios::binary);
      f.seekp(8 + 16 + 24 + 32 + 24 + 3);
      f.put('\x7f');
    }
    const PatchStore store({path});
    std::vector<Float3> position;
    std::vector<std::uint32_t> rgba;
    CHECK_THROWS_AS((store.load_vertices(0, position, rgba), store.load_seam(0)), InputError);
  }
  SECTION("cut short") {
    std::filesystem::resize_file(path, size - 1);
    CHECK_THROWS_AS(PatchStore({path}), InputError);
  }
  SECTION("empty") {
    std::filesystem::resize_file(path, 0);
    CHECK_THROWS_AS(PatchStore({path}), InputError);
  }
}

}  // namespace patch_store_test
