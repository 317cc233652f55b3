#include "kernels/solid/crease_sheets.h"

#include <algorithm>
#include <array>
#include <tuple>

#include "kernels/mesh/face_corners.h"

namespace tessera {
namespace {

constexpr double kOneSheet = 0.906;       ///< cosine of 25 degrees
constexpr double kTwoSheets = 0.766;      ///< of 40 degrees
constexpr double kRadiusSquare = 9.0;     ///< cells, of the ball around a vertex
constexpr double kMinShare = 1.0 / 12.0;  ///< of the weight around a vertex
/// Cosines of 25, 15 and 12 degrees: faces count for the mean of their sheet that are so close to the last one. What EMC
/// leaves in corners tilts means by degrees, which offsets by many cells show.
constexpr std::array<double, 3> kCones = {kOneSheet, 0.966, 0.978};

/// A face as a vertex nearby sees it.
struct Facet {
  Double3 weighted;  ///< its normal, as long as its area times a weight that falls with the distance
  double weight;     ///< length of that
  bool operator<(const Facet& o) const {
    return std::tie(o.weight, o.weighted[0], o.weighted[1], o.weighted[2]) <
           std::tie(weight, weighted[0], weighted[1], weighted[2]);
  }
};

/// Faces of a mesh around places of its surface.
class Balls {
 public:
  explicit Balls(const MeshBlock& block)
      : block_(block),
        corners_(block),
        seen_vertex_(block.position.size(), 0),
        seen_face_(block.faces.size(), 0) {}

  /// Faces with a corner in the ball around a vertex that are joined to it within the ball, in any order.
  const std::vector<std::uint32_t>& around(std::uint32_t vertex) {
    faces_.clear(), open_.assign(1, vertex);
    ++ball_;
    seen_vertex_[vertex] = ball_;
    while (!open_.empty()) {
      const std::uint32_t v = open_.back();
      open_.pop_back();
      for (const std::uint32_t corner : corners_.at(v)) {
        const std::uint32_t f = corner >> 2;
        if (seen_face_[f] == ball_) continue;
        seen_face_[f] = ball_;
        faces_.push_back(f);
        for (const std::uint32_t u : block_.faces[f])
          if (seen_vertex_[u] != ball_ &&
              squared_distance(block_.position[u], block_.position[vertex]) < kRadiusSquare) {
            seen_vertex_[u] = ball_;
            open_.push_back(u);
          }
      }
    }
    return faces_;
  }

  /// face * 4 + corner of the vertex in it
  [[nodiscard]] std::span<const std::uint32_t> corners(std::uint32_t v) const { return corners_.at(v); }

 private:
  const MeshBlock& block_;
  FaceCorners corners_;
  std::vector<std::uint32_t> seen_vertex_, seen_face_;  ///< number of the last ball that they were in
  std::uint32_t ball_ = 0;
  std::vector<std::uint32_t> open_, faces_;
};

Double3 normal_of(const MeshBlock& block, std::uint32_t face) {
  const auto& f = block.faces[face];
  return triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]);
}

/// Vertices whose ball has a crease in it.
std::vector<std::uint8_t> near_creases(const MeshBlock& block, Balls& balls) {
  std::vector<std::uint8_t> near(block.position.size(), 0);
  std::vector<Double3> normals;
  for (std::uint32_t v = 0; v < block.position.size(); ++v) {
    normals.clear();
    for (const std::uint32_t c : balls.corners(v)) normals.push_back(unit_or_zero(normal_of(block, c >> 2)));
    const bool sharp = std::any_of(normals.begin(), normals.end(), [&](const Double3& a) {
      return std::any_of(normals.begin(), normals.end(),
                         [&](const Double3& b) { return dot(a, b) < kOneSheet; });
    });
    if (!sharp) continue;
    for (const std::uint32_t f : balls.around(v))
      for (const std::uint32_t u : block.faces[f]) near[u] = 1;
  }
  return near;
}

/// Unit normals of sheets among facets: groups around the heaviest ones, each then around its own mean.
void find_sheets(std::vector<Facet>& facets, std::vector<Double3>& sheets) {
  std::sort(facets.begin(), facets.end());
  sheets.clear();
  std::vector<Double3> sum;
  double all = 0.0;
  for (const Facet& f : facets) all += f.weight;
  const auto closest = [&](const Double3& normal) {
    std::size_t best = sheets.size();
    double maximum = kOneSheet;
    for (std::size_t s = 0; s < sheets.size(); ++s)
      if (const double c = dot(sheets[s], normal); c > maximum) maximum = c, best = s;
    return best;
  };
  for (const Facet& f : facets) {
    if (!(f.weight > 0.0)) break;
    const Double3 normal = f.weighted / f.weight;
    if (closest(normal) == sheets.size()) sheets.push_back(normal);
  }
  for (std::size_t round = 0; round < kCones.size(); ++round) {
    sum.assign(sheets.size(), {0, 0, 0});
    for (const Facet& f : facets) {
      if (!(f.weight > 0.0)) break;
      const Double3 normal = f.weighted / f.weight;
      if (const std::size_t s = closest(normal); s < sheets.size() && dot(sheets[s], normal) > kCones[round])
        sum[s] = sum[s] + f.weighted;
    }
    if (round == 0) {
      std::erase_if(sum, [&](const Double3& s) { return !(norm(s) > kMinShare * all); });
      sheets.resize(sum.size());
    }
    for (std::size_t s = 0; s < sum.size(); ++s)
      if (round == 0 || norm(sum[s]) > 0.0) sheets[s] = unit_or_zero(sum[s]);
  }
}

}  // namespace

CreaseSheets::CreaseSheets(const MeshBlock& block) : first_(block.position.size() + 1, 0) {
  share_.resize(block.position.size(), 0.0F);
  Balls balls(block);
  const std::vector<std::uint8_t> near = near_creases(block, balls);
  std::vector<Facet> facets;
  std::vector<Double3> sheets;
  for (std::uint32_t v = 0; v < block.position.size(); ++v) {
    first_[v + 1] = first_[v];
    if (near[v] == 0) continue;
    facets.clear();
    for (const std::uint32_t face : balls.around(v)) {
      Double3 middle{};
      for (const std::uint32_t u : block.faces[face])
        middle = middle + (block.position[u] - block.position[v]);
      const double nearness = std::max(0.0, 1.0 - dot(middle, middle) / (9.0 * kRadiusSquare));
      const Double3 weighted = normal_of(block, face) * (nearness * nearness);
      facets.push_back({weighted, norm(weighted)});
    }
    find_sheets(facets, sheets);
    double opening = 1.0;  // its cosine
    for (std::size_t a = 0; a < sheets.size(); ++a)
      for (std::size_t b = 0; b < a; ++b) opening = std::min(opening, dot(sheets[a], sheets[b]));
    const double t = std::clamp((kOneSheet - opening) / (kOneSheet - kTwoSheets), 0.0, 1.0);
    if (!(t > 0.0)) continue;
    share_[v] = static_cast<float>(t * t * (3.0 - 2.0 * t));
    normal_.insert(normal_.end(), sheets.begin(), sheets.end());
    first_[v + 1] = static_cast<std::uint32_t>(normal_.size());
  }
}

}  // namespace tessera
