#include "kernels/smooth/crease_blunting.h"

#include <cmath>

#include "octree/edge_faces.h"

namespace tessera {
namespace {

constexpr double kBluntCosine = 0.5;
constexpr int kBluntRounds = 6;
constexpr double kMaxBluntMove = 1.0;  ///< cells

/// Vertices no farther than some rings from a border or a face that nobody saw.
std::vector<std::uint8_t> near_vertices(const CreaseMesh& mesh) {
  std::vector<std::uint8_t> near = mesh.at_border;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    if (mesh.unseen[f])
      for (const std::uint32_t v : mesh.faces[f]) near[v] = 1;
  for (int ring = 0; ring < kBluntRings; ++ring) {
    std::vector<std::uint8_t> wider = near;
    for (const auto& f : mesh.faces)
      if (near[f[0]] | near[f[1]] | near[f[2]])
        for (const std::uint32_t v : f) wider[v] = 1;
    near.swap(wider);
  }
  return near;
}

/// Edges that have an end that may move, and what of the faces there changes.
class SharpEdges {
 public:
  using Face = std::array<std::uint32_t, 3>;

  explicit SharpEdges(const CreaseMesh& mesh) : mesh_(mesh), movable_(near_vertices(mesh)) {
    // All faces of an edge that has an end near are among these.
    for (const Face& f : mesh.faces)
      if (movable_[f[0]] | movable_[f[1]] | movable_[f[2]]) faces_.push_back(f);
    const std::vector<std::uint32_t> opposite = opposite_half_edges(mesh.position.size(), faces_);
    for (std::uint32_t h = 0; h < opposite.size(); ++h)
      if (opposite[h] == kNoHalfEdge) movable_[from(h)] = movable_[to(h)] = 0;
    for (std::size_t v = 0; v < movable_.size(); ++v)
      if (mesh.at_border[v]) movable_[v] = 0;
    normal_.resize(faces_.size());
    for (std::uint32_t f = 0; f < faces_.size(); ++f)
      if (moves(faces_[f])) normal_[f] = normal_of(f);
    for (std::uint32_t h = 0; h < opposite.size(); ++h)
      if (opposite[h] != kNoHalfEdge && opposite[h] > h && (movable_[from(h)] | movable_[to(h)]))
        edges_.push_back({h / 3, opposite[h] / 3, from(h), to(h)});
  }
  /// Those with a vertex that may move among them, in the order of the mesh.
  const std::vector<Face>& faces() const { return faces_; }

  /// Marks the ends of sharp edges, those that may move.
  /// \param[in, out] sharp  those marked, in no order; the marks of those before go
  void mark(std::vector<std::uint8_t>& is_sharp, std::vector<std::uint32_t>& sharp) const {
    for (const std::uint32_t v : sharp) is_sharp[v] = 0;
    sharp.clear();
    for (const Edge& e : edges_) {
      if (dot(normal_[e.face], normal_[e.across]) >= kBluntCosine) continue;
      for (const std::uint32_t v : {e.from, e.to}) {
        if (!movable_[v] || is_sharp[v]) continue;
        is_sharp[v] = 1;
        sharp.push_back(v);
      }
    }
  }
  void follow(const std::vector<std::uint8_t>& moved) {
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
      const Face& c = faces_[f];
      if (moved[c[0]] | moved[c[1]] | moved[c[2]]) normal_[f] = normal_of(f);
    }
  }

 private:
  struct Edge {
    std::uint32_t face, across, from, to;
  };
  std::uint32_t from(std::uint32_t h) const { return faces_[h / 3][h % 3]; }
  std::uint32_t to(std::uint32_t h) const { return faces_[h / 3][(h + 1) % 3]; }
  bool moves(const Face& c) const { return (movable_[c[0]] | movable_[c[1]] | movable_[c[2]]) != 0; }
  Double3 normal_of(std::uint32_t f) const {
    const Face& c = faces_[f];
    const Double3& a = mesh_.position[c[0]];
    return unit_or_zero(cross(mesh_.position[c[1]] - a, mesh_.position[c[2]] - a));
  }
  const CreaseMesh& mesh_;
  std::vector<std::uint8_t> movable_;
  std::vector<Face> faces_;
  std::vector<Double3> normal_;  ///< of faces that may move
  std::vector<Edge> edges_;
};

}  // namespace

std::size_t blunt_creases(CreaseMesh& mesh) {
  const std::size_t n = mesh.position.size();
  SharpEdges edges(mesh);
  std::vector<std::uint8_t> is_sharp(n);
  std::vector<std::uint32_t> sharp;
  edges.mark(is_sharp, sharp);
  if (sharp.empty()) return 0;
  const std::vector<Double3> before = mesh.position;
  std::vector<Double3> sum(n);
  std::vector<double> count(n);
  for (int round = 0; round < kBluntRounds && !sharp.empty(); ++round) {
    for (const std::uint32_t v : sharp) sum[v] = {}, count[v] = 0.0;
    for (const auto& f : edges.faces()) {
      if ((is_sharp[f[0]] | is_sharp[f[1]] | is_sharp[f[2]]) == 0) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        if (!is_sharp[f[k]]) continue;
        sum[f[k]] = sum[f[k]] + mesh.position[f[(k + 1) % 3]] + mesh.position[f[(k + 2) % 3]];
        count[f[k]] += 2.0;
      }
    }
    for (const std::uint32_t v : sharp) {
      const Double3 at = (mesh.position[v] + sum[v] * (1.0 / count[v])) * 0.5, move = at - before[v];
      const double far = norm(move);
      mesh.position[v] = far > kMaxBluntMove ? before[v] + move * (kMaxBluntMove / far) : at;
    }
    edges.follow(is_sharp);
    if (round + 1 < kBluntRounds) edges.mark(is_sharp, sharp);
  }
  std::size_t moved = 0;
  for (std::size_t v = 0; v < n; ++v) moved += mesh.position[v] != before[v];
  return moved;
}

}  // namespace tessera
