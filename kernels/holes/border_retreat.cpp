#include "kernels/holes/border_retreat.h"

#include <algorithm>
#include <map>

namespace tessera {
namespace {

Double3 face_normal_at(const std::array<Double3, 3>& p) {
  return cross(p[1] - p[0], p[2] - p[0]);
}

}  // namespace

std::vector<std::uint32_t> border_vertices(const MeshBlock& block, std::span<const std::uint32_t> faces) {
  std::vector<std::uint32_t> asked;
  for (const std::uint32_t f : faces) asked.insert(asked.end(), block.faces[f].begin(), block.faces[f].end());
  std::sort(asked.begin(), asked.end());
  std::map<std::array<std::uint32_t, 2>, int> edges;
  for (const auto& f : block.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(f[k], f[(k + 1) % 3]);
      if (std::binary_search(asked.begin(), asked.end(), low) ||
          std::binary_search(asked.begin(), asked.end(), high))
        ++edges[{low, high}];
    }
  std::vector<std::uint32_t> out;
  for (const auto& [edge, count] : edges)
    for (const std::uint32_t v : edge)
      if (count == 1 && std::binary_search(asked.begin(), asked.end(), v)) out.push_back(v);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

BorderRetreat pulled_in(const MeshBlock& block, std::span<const std::uint32_t> vertices, double share,
                        bool float_positions) {
  BorderRetreat out;
  const auto slot = [&](std::uint32_t v) {
    const auto at = std::lower_bound(vertices.begin(), vertices.end(), v);
    return at != vertices.end() && *at == v ? at - vertices.begin() : -1;
  };
  std::vector<Double3> away(vertices.size(), {0, 0, 0});
  std::vector<double> count(vertices.size(), 0.0);
  for (std::uint32_t f = 0; f < block.faces.size(); ++f) {
    bool moves = false;
    for (const std::uint32_t v : block.faces[f]) {
      const auto i = slot(v);
      if (i < 0) continue;
      moves = true;
      for (const std::uint32_t w : block.faces[f])
        away[static_cast<std::size_t>(i)] =
            away[static_cast<std::size_t>(i)] + (block.position[w] - block.position[v]);
      count[static_cast<std::size_t>(i)] += 3.0;
    }
    if (moves) out.faces.push_back(f);
  }
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    Double3 at = block.position[vertices[i]];
    if (count[i] > 0.0) at = at + away[i] * (share / count[i]);
    if (float_positions)
      for (double& x : at) x = static_cast<double>(static_cast<float>(x));
    out.position.push_back(at);
    if (!block.rgba.empty()) out.rgba.push_back(block.rgba[vertices[i]]);
  }
  for (const std::uint32_t f : out.faces) {
    std::array<std::uint32_t, 3> corner = block.faces[f];
    std::array<Double3, 3> before, after;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto i = slot(corner[k]);
      before[k] = after[k] = block.position[corner[k]];
      if (i < 0) continue;
      after[k] = out.position[static_cast<std::size_t>(i)];
      corner[k] = static_cast<std::uint32_t>(block.position.size() + static_cast<std::size_t>(i));
    }
    out.turns = out.turns || !(dot(face_normal_at(before), face_normal_at(after)) > 0.0);
    out.corners.push_back(corner);
  }
  return out;
}

}  // namespace tessera
