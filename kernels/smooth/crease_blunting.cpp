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

/// Edges that have an end that may move, and what of the faces there changes.
class SharpEdges {
 public:
  SharpEdges(const CreaseMesh& mesh, const std::vector<std::uint32_t>& opposite,
             const std::vector<std::uint8_t>& movable)
      : mesh_(mesh), movable_(movable), normal_(mesh.faces.size()) {
    for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
      const auto& c = mesh.faces[f];
      if (!movable[c[0]] && !movable[c[1]] && !movable[c[2]]) continue;
      faces_.push_back(f);
      normal_[f] = normal_of(f);
      for (std::uint32_t k = 0; k < 3; ++k) {
        const std::uint32_t h = 3 * f + k, across = opposite[h];
        if (across == kNoHalfEdge || across < h || (!movable[c[k]] && !movable[c[(k + 1) % 3]])) continue;
        edges_.push_back({f, across / 3, c[k], c[(k + 1) % 3]});
      }
    }
  }
  /// Faces with a vertex that may move, ascending.
  const std::vector<std::uint32_t>& faces() const { return faces_; }

  /// Marks the ends of sharp edges, those that may move. \returns whether there are any
  bool mark(std::vector<std::uint8_t>& sharp) const {
    std::fill(sharp.begin(), sharp.end(), std::uint8_t{0});
    bool any = false;
    for (const Edge& e : edges_) {
      if (dot(normal_[e.face], normal_[e.across]) >= kBluntCosine) continue;
      for (const std::uint32_t v : {e.from, e.to})
        if (movable_[v]) sharp[v] = 1, any = true;
    }
    return any;
  }
  void follow(const std::vector<std::uint8_t>& moved) {
    for (const std::uint32_t f : faces_) {
      const auto& c = mesh_.faces[f];
      if (moved[c[0]] || moved[c[1]] || moved[c[2]]) normal_[f] = normal_of(f);
    }
  }

 private:
  struct Edge {
    std::uint32_t face, across, from, to;
  };
  Double3 normal_of(std::uint32_t f) const {
    const auto& c = mesh_.faces[f];
    const Double3& a = mesh_.position[c[0]];
    return unit_or_zero(cross(mesh_.position[c[1]] - a, mesh_.position[c[2]] - a));
  }
  const CreaseMesh& mesh_;
  const std::vector<std::uint8_t>& movable_;
  std::vector<Double3> normal_;  ///< of those faces
  std::vector<std::uint32_t> faces_;
  std::vector<Edge> edges_;
};

}  // namespace

std::size_t blunt_creases(CreaseMesh& mesh) {
  const std::size_t n = mesh.position.size();
  const std::vector<std::uint32_t> opposite = opposite_half_edges(n, mesh.faces);
  const std::vector<std::uint8_t> movable = movable_vertices(mesh, opposite);
  SharpEdges edges(mesh, opposite, movable);
  std::vector<std::uint8_t> sharp(n);
  if (!edges.mark(sharp)) return 0;
  const std::vector<Double3> before = mesh.position;
  std::vector<Double3> sum(n);
  std::vector<double> count(n);
  for (int round = 0; round < kBluntRounds && (round == 0 || edges.mark(sharp)); ++round) {
    std::fill(sum.begin(), sum.end(), Double3{});
    std::fill(count.begin(), count.end(), 0.0);
    for (const std::uint32_t i : edges.faces()) {
      const auto& f = mesh.faces[i];
      for (std::size_t k = 0; k < 3; ++k) {
        if (!sharp[f[k]]) continue;
        sum[f[k]] = sum[f[k]] + mesh.position[f[(k + 1) % 3]] + mesh.position[f[(k + 2) % 3]];
        count[f[k]] += 2.0;
      }
    }
    for (std::size_t v = 0; v < n; ++v) {
      if (!sharp[v]) continue;
      const Double3 at = (mesh.position[v] + sum[v] * (1.0 / count[v])) * 0.5, move = at - before[v];
      const double far = norm(move);
      mesh.position[v] = far > kMaxBluntMove ? before[v] + move * (kMaxBluntMove / far) : at;
    }
    edges.follow(sharp);
  }
  std::size_t moved = 0;
  for (std::size_t v = 0; v < n; ++v) moved += mesh.position[v] != before[v];
  return moved;
}

}  // namespace tessera
