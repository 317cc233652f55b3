// Meshes in packed files: nothing is lost, any grouping of patches merges to the same block, damage is named.
#include <catch2/catch.hpp>

#include <algorithm>
#include <fstream>
#include <numeric>
#include <set>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/meshes/mesh_blocking.h"
#include "tests/helpers/serial_job.h"

namespace tessera::mesh_store_test {
namespace {

constexpr int kSide = 40;

/// A bumpy square of cells of edge 10 over bricks of edge 64, keys shuffled by a stride.
MeshBlock make_sheet() {
  MeshBlock block;
  const auto key = [](int i, int j) {
    return static_cast<std::uint64_t>((j * (kSide + 1) + i) * 97 % 100003);
  };
  for (int j = 0; j <= kSide; ++j)
    for (int i = 0; i <= kSide; ++i) {
      block.key.push_back(key(i, j));
      block.position.push_back({10.0 * i, 10.0 * j, 80.0 + ((i * 7 + j * 3) % 5)});
      block.vertex_class.push_back(i % 9 == 0 ? VertexClass::kCrease : VertexClass::kSmooth);
      block.rgba.push_back(static_cast<std::uint32_t>(i * 1000 + j));
    }
  const auto at = [](int i, int j) { return static_cast<std::uint32_t>(j * (kSide + 1) + i); };
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) {
      block.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      block.face_flags.push_back(
          static_cast<std::uint8_t>((j == 0 ? kFaceBorder01 : 0) | (i == kSide - 1 ? kFaceBorder12 : 0)));
      block.faces.push_back({at(i + 1, j + 1), at(i, j + 1), at(i, j)});
      block.face_flags.push_back(
          static_cast<std::uint8_t>((j == kSide - 1 ? kFaceBorder01 : 0) | (i == 0 ? kFaceBorder12 : 0)));
    }
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    block.face_bound.push_back(0.25f * static_cast<float>(f));
  canonicalise(block);
  return block;
}

MeshStoreInfo sheet_info() {
  MeshStoreInfo info;
  info.lattice.h = 1.0;
  info.colour = true;
  return info;
}

bool same(const MeshBlock& a, const MeshBlock& b) {
  return a.key == b.key && a.position == b.position && a.vertex_class == b.vertex_class && a.rgba == b.rgba &&
         a.faces == b.faces && a.face_flags == b.face_flags && a.face_bound == b.face_bound;
}

/// Two files, bricks dealt out in turn.
std::vector<std::filesystem::path> write_sheet(const MeshBlock& sheet, const std::filesystem::path& folder) {
  const std::vector<std::filesystem::path> paths = {folder / "a.tmm", folder / "b.tmm"};
  MeshFileWriter a(paths[0], sheet_info());
  MeshFileWriter b(paths[1], sheet_info());
  std::vector<std::uint64_t> bricks;
  for (const auto& f : sheet.faces)
    bricks.push_back(brick_of_face(sheet_info().lattice, sheet.position[f[0]], sheet.position[f[1]],
                                   sheet.position[f[2]]));
  int count = 0;
  split_faces(sheet, bricks,
              [&](std::uint64_t brick, MeshBlock&& patch) { (count++ % 2 ? b : a).add(brick, patch); });
  a.finish();
  b.finish();
  return paths;
}

}  // namespace

TEST_CASE("mesh store: all patches merge to the mesh they were cut from", "[unit]") {
  const test::TempFolder folder;
  const MeshBlock sheet = make_sheet();
  const MeshStore store(write_sheet(sheet, folder.path()));
  CHECK(store.patches().size() == 49);
  CHECK(store.face_count() == sheet.faces.size());
  CHECK(store.box().high == Double3{400, 400, 84});
  std::vector<std::size_t> all(store.patches().size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const MeshBlock merged = store.load(all);
  CHECK(same(merged, sheet));
  const auto complete = complete_stars(merged);
  CHECK(std::count(complete.begin(), complete.end(), 1) == static_cast<std::ptrdiff_t>(sheet.key.size()));
}

TEST_CASE("mesh store: a star that the block cuts is not complete, a border is", "[unit]") {
  const test::TempFolder folder;
  const MeshBlock sheet = make_sheet();
  const MeshStore store(write_sheet(sheet, folder.path()));
  const MeshBlock one = store.load(std::vector<std::size_t>{0});
  std::set<std::uint64_t> here(one.key.begin(), one.key.end());
  std::set<std::uint64_t> cut;  // vertices of this patch that faces elsewhere use
  for (std::size_t p = 1; p < store.patches().size(); ++p)
    for (const std::uint64_t k : store.load(std::vector<std::size_t>{p}).key)
      if (here.count(k)) cut.insert(k);
  const auto complete = complete_stars(one);
  REQUIRE(!cut.empty());
  for (std::size_t v = 0; v < one.key.size(); ++v) CHECK((complete[v] != 0) == (cut.count(one.key[v]) == 0));
}

TEST_CASE("mesh blocks: stars of a hub and its rim, as borders and missing faces are told", "[unit]") {
  for (const std::uint32_t rim : {3u, 100u}) {
    MeshBlock b;  // a wheel around vertex 0
    for (std::uint32_t i = 1; i <= rim; ++i) {
      b.faces.push_back({0, i, i < rim ? i + 1 : 1});
      b.face_flags.push_back(kFaceBorder12);
    }
    for (std::uint64_t v = 0; v <= rim; ++v) b.key.push_back(v);
    CHECK(complete_stars(b) == std::vector<std::uint8_t>(rim + 1, 1));
    // The rim goes on elsewhere: its edge is no border.
    MeshBlock cut = b;
    cut.face_flags[1] = 0;
    std::vector<std::uint8_t> expected(rim + 1, 1);
    expected[2] = expected[3] = 0;
    CHECK(complete_stars(cut) == expected);
    // A face too many at an edge, one with a border at an edge of two.
    MeshBlock more = b;
    more.faces.push_back({0, 1, 2});
    more.face_flags.push_back(kFaceBorder12 | kFaceBorder20);
    expected.assign(rim + 1, 1);
    expected[0] = expected[1] = expected[2] = 0;
    CHECK(complete_stars(more) == expected);
  }
}

TEST_CASE("mesh store: halos hold what is near", "[unit]") {
  const test::TempFolder folder;
  const MeshBlock sheet = make_sheet();
  const MeshStore store(write_sheet(sheet, folder.path()));
  const auto core = static_cast<std::size_t>(store.find(brick_key({3, 3, 1})));
  const std::vector<std::size_t> list = {core};
  const auto core_faces = static_cast<std::ptrdiff_t>(store.patches()[core].faces);
  for (const double margin : {0.0, 25.0}) {
    const MeshHaloBlock near = store.load_near(list, margin);
    CHECK(std::count(near.core.begin(), near.core.end(), 1) == core_faces);
    const MeshBox box = grown(store.box_of(list), margin);
    std::size_t expected = 0;
    for (const auto& f : sheet.faces) {
      MeshBox b{sheet.position[f[0]], sheet.position[f[0]]};
      for (const std::uint32_t v : f)
        for (std::size_t a = 0; a < 3; ++a) {
          b.low[a] = std::min(b.low[a], sheet.position[v][a]);
          b.high[a] = std::max(b.high[a], sheet.position[v][a]);
        }
      expected += overlap(b, box);
    }
    CHECK(near.block.faces.size() == expected);
  }
}

TEST_CASE("mesh store: blocks are maximal, cover every patch once, and move with the shift", "[unit]") {
  const test::TempFolder folder;
  const MeshStore store(write_sheet(make_sheet(), folder.path()));
  std::set<std::vector<std::size_t>> seams;
  for (int pass = 0; pass < 6; ++pass) {
    const bool halves = pass >= 3;
    const auto blocks = make_blocks(store, {400, 1u << 30, pass_shift(pass), halves});
    if (halves) CHECK(blocks.size() < make_blocks(store, {400, 1u << 30, pass_shift(pass)}).size());
    std::vector<std::size_t> seen;
    for (const auto& block : blocks) {
      std::uint64_t faces = 0;
      for (const std::size_t p : block.patches) {
        faces += store.patches()[p].faces;
        const Int3 b = brick_of_key(store.patches()[p].key);
        for (std::size_t a = 0; a < 3; ++a)
          CHECK((b[a] >= block.first_brick[a] && b[a] <= block.last_brick[a]));
      }
      CHECK(faces == block.faces);
      CHECK((faces <= 400 || block.patches.size() == 1));
      seen.insert(seen.end(), block.patches.begin(), block.patches.end());
    }
    std::sort(seen.begin(), seen.end());
    CHECK(std::adjacent_find(seen.begin(), seen.end()) == seen.end());
    CHECK(seen.size() == store.patches().size());
    CHECK(blocks.size() < store.patches().size() / 2);
    seams.insert(blocks[0].patches);
  }
  CHECK(seams.size() > 1);
  CHECK(make_blocks(store, {1u << 20, 1u << 30, {0, 0, 0}}).size() == 1);
}

TEST_CASE("mesh store: damage is named with its file", "[unit]") {
  const test::TempFolder folder;
  const auto paths = write_sheet(make_sheet(), folder.path());
  {
    std::fstream file(paths[1], std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(200);
    file.put('\x7f');
  }
  const MeshStore store(paths);
  std::vector<std::size_t> all(store.patches().size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  CHECK_THROWS_AS(store.load(all), InputError);
  CHECK_THROWS_AS(MeshStore({paths[0], paths[0]}), InputError);
  std::filesystem::resize_file(paths[0], std::filesystem::file_size(paths[0]) - 9);
  CHECK_THROWS_AS(MeshStore({paths[0]}), InputError);
}

TEST_CASE("mesh blocks: the order of vertices and faces does not matter", "[property]") {
  const MeshBlock sheet = make_sheet();
  MeshBlock other = sheet;
  std::reverse(other.key.begin(), other.key.end());
  std::reverse(other.position.begin(), other.position.end());
  std::reverse(other.vertex_class.begin(), other.vertex_class.end());
  std::reverse(other.rgba.begin(), other.rgba.end());
  std::reverse(other.faces.begin(), other.faces.end());
  std::reverse(other.face_flags.begin(), other.face_flags.end());
  std::reverse(other.face_bound.begin(), other.face_bound.end());
  const auto last = static_cast<std::uint32_t>(sheet.key.size() - 1);
  for (std::size_t f = 0; f < other.faces.size(); ++f) {
    auto& c = other.faces[f];
    for (auto& v : c) v = last - v;
    c = {c[1], c[2], c[0]};
    const unsigned bits = other.face_flags[f];
    other.face_flags[f] = static_cast<std::uint8_t>(bits >> 1 | (bits & 1) << 2);
  }
  canonicalise(other);
  CHECK(same(other, sheet));
}

}  // namespace tessera::mesh_store_test
