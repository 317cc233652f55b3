#include "kernels/smooth/crease_blunting.h"

#include <algorithm>
#include <cmath>

#include "octree/edge_faces.h"

namespace tessera {
namespace {

constexpr double kBluntCosine = 0.5;
constexpr int kBluntRounds = 6;
constexpr double kMaxBluntMove = 1.0;  ///< cells

/// Vertices no farther than some rings from a border or a face that nobody saw, whose faces are all there.
std::vector<std::uint8_t> movable_vertices(const CreaseMesh& mesh,
                                           const std::vector<std::uint32_t>& opposite) {
  std::vector<std::uint8_t> near = mesh.at_border;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    if (mesh.unseen[f])
      for (const std::uint32_t v : mesh.faces[f]) near[v] = 1;
  for (int ring = 0; ring < kBluntRings; ++ring) {
    std::vector<std::uint8_t> wider = near;
    for (const auto& f : mesh.faces)
      if (near[f[0]] || near[f[1]] || near[f[2]])
        for (const std::uint32_t v : f) wider[v] = 1;
    near.swap(wider);
  }
  for (std::uint32_t h = 0; h < opposite.size(); ++h)
    if (opposite[h] == kNoHalfEdge) near[mesh.faces[h / 3][h % 3]] = near[mesh.faces[h / 3][(h + 1) % 3]] = 0;
  for (std::size_t v = 0; v < near.size(); ++v)
    if (mesh.at_border[v]) near[v] = 0;
  return near;
}

/// Marks the ends of sharp edges, those that may move. \returns whether there are any
bool mark_sharp(const CreaseMesh& mesh, const std::vector<std::uint32_t>& opposite,
                const std::vector<std::uint8_t>& movable, std::vector<std::uint8_t>& sharp) {
  std::vector<Double3> normal(mesh.faces.size());
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const auto& f = mesh.faces[i];
    if (!movable[f[0]] && !movable[f[1]] && !movable[f[2]]) continue;
    const Double3& a = mesh.position[f[0]];
    normal[i] = unit_or_zero(cross(mesh.position[f[1]] - a, mesh.position[f[2]] - a));
  }
  std::fill(sharp.begin(), sharp.end(), std::uint8_t{0});
  bool any = false;
  for (std::uint32_t h = 0; h < opposite.size(); ++h) {
    if (opposite[h] == kNoHalfEdge || opposite[h] < h) continue;
    const std::uint32_t from = mesh.faces[h / 3][h % 3], to = mesh.faces[h / 3][(h + 1) % 3];
    if (!movable[from] && !movable[to]) continue;
    if (dot(normal[h / 3], normal[opposite[h] / 3]) >= kBluntCosine) continue;
    for (const std::uint32_t v : {from, to})
      if (movable[v]) sharp[v] = 1, any = true;
  }
  return any;
}

}  // namespace

std::size_t blunt_creases(CreaseMesh& mesh) {
  const std::size_t n = mesh.position.size();
  const std::vector<std::uint32_t> opposite = opposite_half_edges(n, mesh.faces);
  const std::vector<std::uint8_t> movable = movable_vertices(mesh, opposite);
  const std::vector<Double3> before = mesh.position;
  std::vector<std::uint8_t> sharp(n);
  std::vector<Double3> sum(n);
  std::vector<double> count(n);
  for (int round = 0; round < kBluntRounds && mark_sharp(mesh, opposite, movable, sharp); ++round) {
    std::fill(sum.begin(), sum.end(), Double3{});
    std::fill(count.begin(), count.end(), 0.0);
    for (const auto& f : mesh.faces)
      for (std::size_t k = 0; k < 3; ++k) {
        if (!sharp[f[k]]) continue;
        sum[f[k]] = sum[f[k]] + mesh.position[f[(k + 1) % 3]] + mesh.position[f[(k + 2) % 3]];
        count[f[k]] += 2.0;
      }
    for (std::size_t v = 0; v < n; ++v) {
      if (!sharp[v]) continue;
      const Double3 at = (mesh.position[v] + sum[v] * (1.0 / count[v])) * 0.5, move = at - before[v];
      const double far = norm(move);
      mesh.position[v] = far > kMaxBluntMove ? before[v] + move * (kMaxBluntMove / far) : at;
    }
  }
  std::size_t moved = 0;
  for (std::size_t v = 0; v < n; ++v) moved += mesh.position[v] != before[v];
  return moved;
}

}  // namespace tessera
