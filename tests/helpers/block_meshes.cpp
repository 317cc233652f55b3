#include "tests/helpers/block_meshes.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "octree/portable_math.h"
#include "octree/vector.h"
#include "tests/helpers/random.h"

namespace tessera::test {
namespace {

void flag_borders(MeshBlock& block) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> count;
  const auto edge = [](std::uint32_t a, std::uint32_t b) {
    return std::pair(std::min(a, b), std::max(a, b));
  };
  for (const auto& f : block.faces)
    for (std::size_t k = 0; k < 3; ++k) ++count[edge(f[k], f[(k + 1) % 3])];
  block.face_flags.assign(block.faces.size(), 0);
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k)
      if (count[edge(block.faces[f][k], block.faces[f][(k + 1) % 3])] == 1)
        block.face_flags[f] = static_cast<std::uint8_t>(block.face_flags[f] | (1 << k));
}

}  // namespace

MeshBlock make_block(const std::vector<Double3>& position,
                     const std::vector<std::array<std::uint32_t, 3>>& faces) {
  MeshBlock block;
  block.position = position;
  block.vertex_class.assign(position.size(), VertexClass::kSmooth);
  for (std::size_t v = 0; v < position.size(); ++v) block.key.push_back(10 * v + 7);
  for (auto f : faces) {
    std::rotate(f.begin(), std::min_element(f.begin(), f.end()), f.end());
    block.faces.push_back(f);
  }
  std::sort(block.faces.begin(), block.faces.end());
  flag_borders(block);
  return block;
}

MeshBlock grid_block(int columns, int rows, const std::function<double(double, double)>& height) {
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i <= columns; ++i) position.push_back({double(i), double(j), height(i, j)});
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (columns + 1) + i); };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return make_block(position, faces);
}

MeshBlock sphere_block(int levels) {
  std::vector<Double3> position = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  std::vector<std::array<std::uint32_t, 3>> faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                                     {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middle;
    const auto split = [&](std::uint32_t a, std::uint32_t b) {
      const auto [it, fresh] = middle.try_emplace({std::min(a, b), std::max(a, b)}, position.size());
      if (fresh) {
        Double3 m;
        for (std::size_t k = 0; k < 3; ++k) m[k] = position[a][k] + position[b][k];
        const double size = norm(m);
        position.push_back({m[0] / size, m[1] / size, m[2] / size});
      }
      return it->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto& f : faces) {
      const std::uint32_t a = split(f[0], f[1]), b = split(f[1], f[2]), c = split(f[2], f[0]);
      finer.insert(finer.end(), {{f[0], a, c}, {a, f[1], b}, {c, b, f[2]}, {a, b, c}});
    }
    faces = finer;
  }
  return make_block(position, faces);
}

MeshBlock cube_block(int n) {
  std::map<std::array<int, 3>, std::uint32_t> index;
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  const auto at = [&](std::array<int, 3> p) {
    const auto [it, fresh] = index.try_emplace(p, static_cast<std::uint32_t>(position.size()));
    if (fresh) position.push_back({double(p[0]) / n, double(p[1]) / n, double(p[2]) / n});
    return it->second;
  };
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const int side : {0, n})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const auto corner = [&](int di, int dj) {
            std::array<int, 3> p{};
            p[axis] = side;
            p[(axis + 1) % 3] = i + di;
            p[(axis + 2) % 3] = j + dj;
            return at(p);
          };
          std::array<std::uint32_t, 3> lower = {corner(0, 0), corner(1, 0), corner(1, 1)};
          std::array<std::uint32_t, 3> upper = {corner(0, 0), corner(1, 1), corner(0, 1)};
          if (side == 0) {
            std::swap(lower[1], lower[2]);
            std::swap(upper[1], upper[2]);
          }
          faces.push_back(lower);
          faces.push_back(upper);
        }
  return make_block(position, faces);
}

MeshBlock piece_of(const MeshBlock& whole, const std::function<bool(std::uint32_t)>& pass) {
  MeshBlock piece;
  constexpr std::uint32_t kUnused = 0xffffffffU;
  std::vector<std::uint32_t> rename(whole.position.size(), kUnused);
  for (const auto& f : whole.faces)
    if (pass(f[0]) && pass(f[1]) && pass(f[2]))
      for (const std::uint32_t v : f) rename[v] = 0;
  for (std::uint32_t v = 0; v < rename.size(); ++v) {
    if (rename[v] == kUnused) continue;
    rename[v] = static_cast<std::uint32_t>(piece.position.size());
    piece.key.push_back(whole.key[v]);
    piece.position.push_back(whole.position[v]);
    piece.vertex_class.push_back(whole.vertex_class[v]);
  }
  for (std::size_t f = 0; f < whole.faces.size(); ++f) {
    const auto& face = whole.faces[f];
    if (!(pass(face[0]) && pass(face[1]) && pass(face[2]))) continue;
    piece.faces.push_back({rename[face[0]], rename[face[1]], rename[face[2]]});
    piece.face_flags.push_back(whole.face_flags[f]);
  }
  return piece;
}

void add_noise(MeshBlock& block, double amplitude, std::uint64_t seed) {
  for (std::size_t v = 0; v < block.position.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a)
      block.position[v][a] += amplitude * (2.0 * to_unit(random_bits(seed, a, block.key[v])) - 1.0);
}

MeshBlock rough_sheets(int edge, int sheets, double roughness, std::uint64_t seed) {
  Random random(seed);
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  const int row = edge + 1;
  for (int s = 0; s < sheets; ++s) {
    const auto first = static_cast<std::uint32_t>(position.size());
    for (int j = 0; j < row; ++j)
      for (int i = 0; i < row; ++i)
        position.push_back(
            {i + random.in(-0.1, 0.1), j + random.in(-0.1, 0.1),
             0.2 * s + 0.8 * std::sin(0.5 * i) * std::cos(0.4 * j) + roughness * random.in(-0.5, 0.5)});
    for (int j = 0; j < edge; ++j)
      for (int i = 0; i < edge; ++i) {
        const auto at = [&](int x, int y) { return first + static_cast<std::uint32_t>(y * row + x); };
        faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  }
  return make_block(position, faces);
}

}  // namespace tessera::test
