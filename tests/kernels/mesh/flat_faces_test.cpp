#include "kernels/mesh/flat_faces.h"

#include <algorithm>
#include <map>

#include <catch2/catch.hpp>

#include "octree/vector.h"

namespace tessera::flat_faces_test {
namespace {

MeshBlock block_of(std::vector<Double3> position, std::vector<std::array<std::uint32_t, 3>> faces) {
  MeshBlock block;
  for (std::uint64_t v = 0; v < position.size(); ++v) block.key.push_back(10 * v);
  block.vertex_class.resize(position.size());
  block.position = std::move(position);
  block.faces = std::move(faces);
  block.face_flags.resize(block.faces.size());
  // What has no second face is a border.
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
  for (const auto& f : block.faces)
    for (std::size_t i = 0; i < 3; ++i) ++sides[std::minmax(f[i], f[(i + 1) % 3])];
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i)
      if (sides[std::minmax(block.faces[f][i], block.faces[f][(i + 1) % 3])] == 1)
        block.face_flags[f] = static_cast<std::uint8_t>(block.face_flags[f] | kFaceBorder01 << i);
  return block;
}

std::size_t flat_count(const MeshBlock& b) {
  return static_cast<std::size_t>(std::count_if(b.faces.begin(), b.faces.end(), [&](const auto& f) {
    return face_extent(b.position[f[0]], b.position[f[1]], b.position[f[2]]).is_flat();
  }));
}

double area(const MeshBlock& b) {
  double sum = 0.0;
  for (const auto& f : b.faces)
    sum += 0.5 * face_extent(b.position[f[0]], b.position[f[1]], b.position[f[2]]).twice_area;
  return sum;
}

/// Flags agree with what a face has across its edges.
void require_borders(const MeshBlock& b) {
  CHECK(block_of(b.position, b.faces).face_flags == b.face_flags);
}

/// Two halves of a square, cut by a line of vertices that only the upper half uses: `cuts` flat faces lie between.
MeshBlock cut_square(int cuts) {
  std::vector<Double3> position = {{0, 0, 0}, {1, 0, 0}, {0, -1, 0}, {1, -1, 0}, {0.5, 1, 0}};
  std::vector<std::array<std::uint32_t, 3>> faces = {{2, 3, 0}, {0, 3, 1}};
  // The line from 0 to 1 through vertices 5, 6, ...; flat faces fan out from vertex 0.
  std::uint32_t last = 1;
  for (int i = cuts; i > 0; --i) {
    const auto v = static_cast<std::uint32_t>(position.size());
    position.push_back({static_cast<double>(i) / (cuts + 1), 0, 0});
    faces.push_back({0, last, v});
    faces.push_back({v, last, 4});
    last = v;
  }
  faces.push_back({0, last, 4});
  return block_of(position, faces);
}

}  // namespace

TEST_CASE("flat faces: a stack of them turns until each face has area, and the surface stays", "[unit]") {
  for (const int cuts : {1, 2, 5}) {
    MeshBlock block = cut_square(cuts);
    const std::size_t faces = block.faces.size();
    const double before = area(block);
    CHECK(flat_count(block) == static_cast<std::size_t>(cuts));
    block.face_bound.assign(faces, 0.0f);
    block.face_bound[0] = 0.5f;
    CHECK(mend_flat_faces(block) == static_cast<std::uint64_t>(cuts));
    CHECK(flat_count(block) == 0);
    CHECK(block.faces.size() == faces);
    CHECK(block.key.size() == static_cast<std::size_t>(5 + cuts));
    CHECK(area(block) == Approx(before));
    CHECK(*std::max_element(block.face_bound.begin(), block.face_bound.end()) == 0.5f);
    require_borders(block);
  }
}

TEST_CASE("flat faces: at a border the face goes, and the border takes its two other edges", "[unit]") {
  // The lower half of the square alone ends in a flat face whose longest edge is the border.
  MeshBlock block = block_of({{0, 0, 0}, {1, 0, 0}, {0.5, 0, 0}, {0.5, 1, 0}, {0, 1, 0}, {1, 1, 0}},
                             {{0, 1, 2}, {2, 1, 3}, {0, 2, 3}, {0, 3, 4}, {1, 5, 3}});
  CHECK(mend_flat_faces(block) == 1);
  CHECK(block.faces.size() == 4);
  CHECK(flat_count(block) == 0);
  require_borders(block);
}

TEST_CASE("flat faces: a line with borders all around goes, in what is compared with as well", "[unit]") {
  const MeshBlock block =
      block_of({{0, 0, 0}, {1, 0, 0}, {3, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 2, 0}}, {{0, 1, 2}, {3, 4, 5}});
  MeshBlock mended = block, compared = block;
  CHECK(mend_flat_faces(mended) == 1);
  CHECK(drop_flat_islands(compared) == 1);
  for (const MeshBlock* b : {&mended, &compared}) {
    CHECK(b->key == std::vector<std::uint64_t>{30, 40, 50});
    CHECK(b->faces == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}});
  }
}

TEST_CASE("flat faces: left where the block does not know the stars, or the edge is there already",
          "[unit]") {
  MeshBlock block = cut_square(1);
  for (auto& flags : block.face_flags)
    flags = 0;  // the mesh goes on at every side: other blocks may hold the edge
  // Vertex 5, in the middle, has a complete star in the square; without the upper faces nobody has.
  block.faces.resize(3), block.face_flags.resize(3);
  const MeshBlock before = block;
  CHECK(mend_flat_faces(block) == 0);
  CHECK(block.faces == before.faces);

  // A double cover: the edge from the middle to the far corner exists on the other side.
  MeshBlock twice =
      block_of({{0, 0, 0}, {2, 0, 0}, {1, 0, 0}, {1, -1, 0}}, {{0, 1, 2}, {0, 3, 1}, {2, 1, 3}, {0, 2, 3}});
  CHECK(mend_flat_faces(twice) == 0);
  CHECK(twice.faces.size() == 4);
}

TEST_CASE("flat faces: a block without any is not touched", "[unit]") {
  MeshBlock block = block_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{1, 2, 0}});
  CHECK(mend_flat_faces(block) == 0);
  CHECK(drop_flat_islands(block) == 0);
  CHECK(block.faces == std::vector<std::array<std::uint32_t, 3>>{{1, 2, 0}});  // as it was, canonical or not
}

}  // namespace tessera::flat_faces_test
