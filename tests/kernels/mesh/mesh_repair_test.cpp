// Repair in tiles: whatever the tiles, the same manifold, and every decision about a face reaches who keeps
// it.
#include <catch2/catch.hpp>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "kernels/mesh/mesh_repair.h"

namespace tessera::mesh_repair_test {
namespace {

struct Soup {
  std::vector<RepairFace> faces;
  std::vector<std::uint32_t> number;
  std::vector<Double3> position;
};

Soup random_soup(unsigned seed, std::uint32_t vertices, std::size_t faces) {
  std::mt19937 engine(seed);
  const auto random = [&] { return static_cast<std::uint32_t>(engine()); };
  Soup soup;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    soup.number.push_back(v);
    soup.position.push_back({double(random() % 64), double(random() % 64), double(random() % 64)});
  }
  while (soup.faces.size() < faces) {
    // Mostly neighbours in number, so that tiles have an inside.
    const std::uint32_t a = random() % vertices;
    const RepairFace f = {a, (a + 1 + random() % 4) % vertices, (a + 1 + random() % 6) % vertices};
    if (f[0] != f[1] && f[1] != f[2] && f[2] != f[0]) soup.faces.push_back(f);
  }
  return soup;
}

/// A face with its corners as (vertex, copy) and its border bits, smallest corner first.
using Corner = std::pair<std::uint32_t, std::uint16_t>;
struct Kept {
  std::array<Corner, 3> corner;
  std::array<bool, 3> border;
  auto operator<=>(const Kept&) const = default;
};

std::set<Kept> repair(const Soup& soup, std::size_t tiles) {
  const auto n = static_cast<std::uint32_t>(soup.number.size());
  std::map<RepairFace, Kept> kept;
  std::vector<RepairFix> fixes;
  for (std::uint32_t t = 0; t < tiles; ++t) {
    RepairTile tile;
    tile.own_begin = static_cast<std::uint32_t>(n * t / tiles);
    tile.own_end = static_cast<std::uint32_t>(n * (t + 1) / tiles);
    const auto own = [&](std::uint32_t v) { return v >= tile.own_begin && v < tile.own_end; };
    std::set<std::uint32_t> used;
    for (const RepairFace& f : soup.faces)
      if (own(f[0]) || own(f[1]) || own(f[2])) {
        tile.faces.push_back(f);
        used.insert(f.begin(), f.end());
      }
    const std::vector<std::uint32_t> number(used.begin(), used.end());
    std::vector<Double3> position;
    for (const std::uint32_t v : number) position.push_back(soup.position[v]);
    tile.number = number;
    tile.position = position;
    const RepairResult result = repair_tile(std::move(tile));
    fixes.insert(fixes.end(), result.fixes.begin(), result.fixes.end());
    for (std::size_t f = 0; f < result.faces.size(); ++f) {
      RepairFace key = result.faces[f];
      std::sort(key.begin(), key.end());
      Kept k;
      for (std::size_t c = 0; c < 3; ++c) {
        CHECK(number[result.local[f][c]] == result.faces[f][c]);
        k.corner[c] = {result.faces[f][c], result.copy[f][c]};
        k.border[c] = (result.border[f] >> c & 1) != 0;
      }
      CHECK(kept.emplace(key, k).second);
    }
  }
  for (const RepairFix& fix : fixes) {
    Kept& k = kept.at(fix.face);
    const auto corner_of = [&](std::uint32_t v) {
      return k.corner[0].first == v ? 0u : k.corner[1].first == v ? 1u : 2u;
    };
    if (fix.slot < 3) {
      k.corner[corner_of(fix.face[fix.slot])].second = fix.copy;
    } else {
      const unsigned i = corner_of(fix.face[fix.slot - 3u]);
      const unsigned j = corner_of(fix.face[(fix.slot - 2u) % 3u]);
      k.border[(i + 1) % 3 == j ? i : j] = true;
    }
  }
  std::set<Kept> out;
  for (const auto& [key, k] : kept) out.insert(k);
  return out;
}

}  // namespace

TEST_CASE("mesh repair: where the whole mesh is here, every vertex has one fan of faces", "[property]") {
  std::size_t split = 0;
  for (unsigned seed = 1; seed <= 300; ++seed) {
    Soup soup = random_soup(seed, 8 + seed % 20, 20 + seed % 60);
    RepairTile tile;
    tile.own_end = static_cast<std::uint32_t>(soup.number.size());
    tile.faces = soup.faces;
    tile.number = soup.number;
    tile.position = soup.position;
    tile.orient = true;
    const RepairResult result = repair_tile(std::move(tile));
    split += result.report.split_vertices;
    // Faces around each named vertex, joined where exactly two share an edge.
    std::map<std::pair<Corner, Corner>, std::vector<std::size_t>> edges;
    std::map<Corner, std::vector<std::size_t>> around;
    const auto corner = [&](std::size_t f, std::size_t c) {
      return Corner{result.faces[f][c % 3], result.copy[f][c % 3]};
    };
    for (std::size_t f = 0; f < result.faces.size(); ++f)
      for (std::size_t c = 0; c < 3; ++c) {
        around[corner(f, c)].push_back(f);
        edges[std::minmax(corner(f, c), corner(f, c + 1))].push_back(f);
      }
    for (const auto& [edge, faces] : edges) CHECK(faces.size() <= 2);
    for (const auto& [vertex, faces] : around) {
      std::set<std::size_t> visited = {faces.front()};
      std::vector<std::size_t> open = {faces.front()};
      while (!open.empty()) {
        const std::size_t f = open.back();
        open.pop_back();
        for (std::size_t c = 0; c < 3; ++c) {
          const Corner a = corner(f, c), b = corner(f, c + 1);
          if (a != vertex && b != vertex) continue;
          for (const std::size_t g : edges[std::minmax(a, b)])
            if (visited.insert(g).second) open.push_back(g);
        }
      }
      CHECK(visited.size() == faces.size());
    }
  }
  CHECK(split > 1000);  // else nothing was tried
}

TEST_CASE("mesh repair: tiles agree with one tile", "[property]") {
  for (unsigned seed = 0; seed < 30; ++seed) {
    const Soup soup = random_soup(seed, 60, 40 + 4 * seed);
    const std::set<Kept> whole = repair(soup, 1);
    for (const std::size_t tiles : {2, 7, 30}) CHECK(repair(soup, tiles) == whole);
  }
}

TEST_CASE("mesh repair: no edge has more than two faces, two go opposite ways, fans are apart",
          "[property]") {
  for (unsigned seed = 0; seed < 60; ++seed) {
    const std::set<Kept> mesh = repair(random_soup(seed, 50, 30 + 5 * seed), 1);
    std::map<std::pair<Corner, Corner>, int> directed;
    for (const Kept& k : mesh)
      for (std::size_t e = 0; e < 3; ++e) ++directed[{k.corner[e], k.corner[(e + 1) % 3]}];
    for (const auto& [edge, count] : directed) CHECK(count == 1);
    for (const Kept& k : mesh)
      for (std::size_t e = 0; e < 3; ++e)
        CHECK(k.border[e] == (directed.count({k.corner[(e + 1) % 3], k.corner[e]}) == 0));
  }
}

}  // namespace tessera::mesh_repair_test
