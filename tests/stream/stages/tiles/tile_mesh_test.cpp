// The GLB of a tile against the decoders of meshoptimizer.
#include "stream/stages/tiles/tile_mesh.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <set>

#include "kernels/texture/normal_map.h"
#include "octree/portable_math.h"
#include "tests/helpers/tiles_site.h"

namespace tile_mesh_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// A sheet of side x side squares of 1 x 1, wavy, far from zero, with colours.
MeshBlock sheet(int side, const Double3& at) {
  MeshBlock block;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) {
      block.key.push_back(block.key.size());
      block.position.push_back({at[0] + i, at[1] + j, at[2] + sin_cos(0.3 * i).sin * sin_cos(0.2 * j).cos});
      block.rgba.push_back(static_cast<std::uint32_t>(0xff000000u + 50u * static_cast<unsigned>(i)));
    }
  const auto v = [&](int i, int j) { return static_cast<std::uint32_t>(j * (side + 1) + i); };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      block.faces.push_back({v(i, j), v(i + 1, j), v(i + 1, j + 1)});
      block.faces.push_back({v(i, j), v(i + 1, j + 1), v(i, j + 1)});
    }
  return block;
}

using Corners = std::array<Double3, 3>;
std::multiset<Corners> corners_of(const std::vector<Double3>& points,
                                  const std::vector<std::array<std::uint32_t, 3>>& faces) {
  std::multiset<Corners> out;
  for (const auto& f : faces) {
    Corners c = {points[f[0]], points[f[1]], points[f[2]]};
    std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());  // the side it faces stays
    out.insert(c);
  }
  return out;
}

}  // namespace

TEST_CASE("tile mesh: decoded, it is the mesh on its grid, at its place, with its faces' sides", "[unit]") {
  const TileGrid grid{{512, -1024, 64}, GENERATE(0.25, 0x1p-8, 0x1p-12)};
  const int side = GENERATE(1, 40);
  const MeshBlock block = sheet(side, {500000.25, 4000000.5, 100});
  const TileMesh tile = quantise_tile(block, grid, {});
  const DecodedTile decoded = decode_tile(tile_glb(tile));
  CHECK(decoded.position_type == (side / grid.step > 65535 ? "float" : "short"));
  CHECK(decoded.colours.size() == block.position.size());
  std::vector<Double3> wanted;
  for (const Double3& p : block.position) {
    Double3 q;
    for (std::size_t k = 0; k < 3; ++k)
      q[k] = std::floor((p[k] - grid.origin[k]) / grid.step + 0.5) * grid.step;
    wanted.push_back(q);
    CHECK(norm(q + grid.origin - p) <= grid.error());
  }
  CHECK((corners_of(decoded.points, decoded.faces) == corners_of(wanted, block.faces)));
  for (std::size_t k = 0; k < 3; ++k) {
    const auto by = [&](const Double3& a, const Double3& b) { return a[k] < b[k]; };
    const auto [low, high] = std::minmax_element(wanted.begin(), wanted.end(), by);
    CHECK(static_cast<double>(tile.low[k]) * grid.step == (*low)[k]);
    CHECK(static_cast<double>(tile.high[k]) * grid.step == (*high)[k]);
  }
}

TEST_CASE("tile mesh: what is wider than 16 bits of the grid has whole numbers as floats", "[unit]") {
  const TileGrid grid{{0, 0, 0}, 0x1p-12};
  const MeshBlock block = sheet(40, {0, 0, 0});
  const DecodedTile decoded = decode_tile(tile_glb(quantise_tile(block, grid, {})));
  CHECK(decoded.position_type == "float");
  for (const Double3& p : decoded.points)
    for (const double c : p) CHECK(c / grid.step == std::floor(c / grid.step));
}

TEST_CASE("tile mesh: packed, a face takes less than four bytes", "[unit]") {
  MeshBlock block = sheet(150, {0, 0, 0});
  block.rgba.clear();
  const std::string glb = tile_glb(quantise_tile(block, {{0, 0, 0}, 0x1p-8}, {}));
  CHECK(static_cast<double>(glb.size()) / static_cast<double>(block.faces.size()) < 4.0);
  CHECK(tile_glb(quantise_tile(block, {{0, 0, 0}, 0x1p-8}, {})) == glb);
}

TEST_CASE("tile mesh: normals come from all faces at a vertex, also from those outside the tile", "[unit]") {
  MeshBlock around;  // a roof: two slopes that meet in the edge from 1 to 2
  around.key = {10, 11, 12, 13};
  around.position = {{-1, 0, 0}, {0, -1, 1}, {0, 1, 1}, {1, 0, 0}};
  around.faces = {{0, 1, 2}, {1, 3, 2}};
  MeshBlock block;
  block.key = {10, 11, 12};
  block.position = {around.position[0], around.position[1], around.position[2]};
  block.faces = {{0, 1, 2}};
  const std::vector<Double3> normals = star_normals(block, around);
  REQUIRE(normals.size() == 3);
  const double r = std::sqrt(0.5);
  CHECK(norm(normals[0] - Double3{-r, 0, r}) < 1e-12);
  CHECK(norm(normals[1] - Double3{0, 0, 1}) < 1e-12);
  CHECK(norm(normals[2] - Double3{0, 0, 1}) < 1e-12);
  const DecodedTile decoded = decode_tile(tile_glb(quantise_tile(block, {{0, 0, 0}, 0x1p-8}, normals)));
  REQUIRE(decoded.normals.size() == 3);
  for (std::size_t v = 0; v < 3; ++v)
    for (std::size_t i = 0; i < 3; ++i)
      if (norm(decoded.points[v] - block.position[i]) < 0.01)
        CHECK(norm(decoded.normals[v] - normals[i]) < 0.02);
}

TEST_CASE("tile mesh: faces that close holes are marked by vertices of their own, on the same places",
          "[unit]") {
  const TileGrid grid{{0, 0, 0}, 0x1p-8};
  MeshBlock block = sheet(6, {0, 0, 0});
  const std::size_t vertices = block.position.size();
  block.face_flags.assign(block.faces.size(), 0);
  CHECK(decode_tile(tile_glb(quantise_tile(block, grid, {}))).synthetic.empty());
  std::vector<std::array<std::uint32_t, 3>> marked;
  for (std::size_t f = 0; f < block.faces.size(); f += 7) {
    block.face_flags[f] = kFaceSynthetic | kFaceBorder01;
    marked.push_back(block.faces[f]);
  }
  const TileMesh tile = quantise_tile(block, grid, {});
  CHECK(tile.position.size() > vertices);
  CHECK(tile.position.size() == tile.synthetic.size());
  CHECK(tile.position.size() == tile.rgba.size());
  const DecodedTile decoded = decode_tile(tile_glb(tile));
  REQUIRE(decoded.synthetic.size() == decoded.points.size());
  std::vector<std::array<std::uint32_t, 3>> found;
  for (const auto& f : decoded.faces) {
    const int marks = decoded.synthetic[f[0]] + decoded.synthetic[f[1]] + decoded.synthetic[f[2]];
    CHECK((marks == 0 || marks == 3));
    if (marks == 3) found.push_back(f);
  }
  std::vector<Double3> positions;
  for (std::size_t v = 0; v < vertices; ++v)
    positions.push_back({static_cast<double>(tile.low[0] + tile.position[v][0]) * grid.step,
                         static_cast<double>(tile.low[1] + tile.position[v][1]) * grid.step,
                         static_cast<double>(tile.low[2] + tile.position[v][2]) * grid.step});
  CHECK((corners_of(decoded.points, found) == corners_of(positions, marked)));
  CHECK((corners_of(decoded.points, decoded.faces) == corners_of(positions, block.faces)));
}

}  // namespace tile_mesh_test
