#include "kernels/blends/curvature_tensors.h"

#include <algorithm>
#include <cmath>

#include "kernels/mesh/face_corners.h"
#include "octree/portable_math.h"
#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoVertex = 0xffffffffu;

class Curvatures {
 public:
  Curvatures(const MeshBlock& block, double radius) : block_(block), square_(radius * radius), at_(block) {
    const std::size_t faces = block.faces.size();
    doubled_.resize(faces), area_.resize(faces), middle_.resize(faces);
    for (std::size_t f = 0; f < faces; ++f) {
      const auto& t = block.faces[f];
      const Double3 &a = block.position[t[0]], &b = block.position[t[1]], &c = block.position[t[2]];
      doubled_[f] = triangle_normal(a, b, c);
      area_[f] = norm(doubled_[f]);
      middle_[f] = (a + b + c) * (1.0 / 3.0);
    }
    first_edge_.reserve(faces + 1);
    edges_.reserve(faces + faces / 2 + 1);
    for (std::uint32_t f = 0; f < faces; ++f) {
      first_edge_.push_back(static_cast<std::uint32_t>(edges_.size()));
      for (std::size_t k = 0; k < 3; ++k) add_edge(f, block.faces[f][k], block.faces[f][(k + 1) % 3]);
    }
    first_edge_.push_back(static_cast<std::uint32_t>(edges_.size()));
    seen_.assign(block.key.size(), kNoVertex);
    face_seen_.assign(faces, kNoVertex);
  }

  CurvatureTensor at(std::uint32_t v) {
    gather(v);
    const Double3& centre = block_.position[v];
    std::array<double, 6> sum{};
    double area = 0.0;
    for (const std::uint32_t f : faces_) {
      area += 0.5 * weight(middle_[f] - centre) * area_[f];
      for (std::uint32_t e = first_edge_[f]; e < first_edge_[f + 1]; ++e) {
        const Edge& edge = edges_[e];
        const double w = weight(edge.middle - centre);
        if (!(w > 0.0)) continue;
        const double share = w * edge.dihedral;
        const Double3& d = edge.direction;
        sum[0] += share * d[0] * d[0], sum[1] += share * d[0] * d[1], sum[2] += share * d[0] * d[2];
        sum[3] += share * d[1] * d[1], sum[4] += share * d[1] * d[2], sum[5] += share * d[2] * d[2];
      }
    }
    CurvatureTensor out;
    for (const std::uint32_t c : at_.at(v)) out.normal = out.normal + doubled_[c >> 2];
    out.normal = unit_or_zero(out.normal);
    if (!(area > 0.0)) return out;
    Double3 value;
    std::array<Double3, 3> vector;
    symmetric_eigen3(sum, value, vector);
    std::size_t maximum = 0, second = kNoVertex;
    for (std::size_t i = 1; i < 3; ++i)
      if (std::fabs(value[i]) > std::fabs(value[maximum])) maximum = i;
    for (std::size_t i = 0; i < 3; ++i)
      if (i != maximum && (second == kNoVertex || std::fabs(value[i]) > std::fabs(value[second]))) second = i;
    out.along = vector[maximum];
    out.across = value[maximum] / area;
    out.minimum = value[second] / area;
    return out;
  }

 private:
  double weight(const Double3& off) const {
    const double t = 1.0 - dot(off, off) / square_;
    return t > 0.0 ? t * t : 0.0;
  }

  /// Faces with a corner in the ball, reached within it; ascending, so that sums are a function of the ball.
  void gather(std::uint32_t v) {
    vertices_.assign(1, v);
    seen_[v] = v;
    faces_.clear();
    for (std::size_t i = 0; i < vertices_.size(); ++i)
      for (const std::uint32_t c : at_.at(vertices_[i])) {
        const std::uint32_t f = c >> 2;
        if (face_seen_[f] == v) continue;
        face_seen_[f] = v;
        faces_.push_back(f);
        for (const std::uint32_t w : block_.faces[f]) {
          if (seen_[w] == v || squared_distance(block_.position[w], block_.position[v]) > square_) continue;
          seen_[w] = v;
          vertices_.push_back(w);
        }
      }
    std::sort(faces_.begin(), faces_.end());
  }

  /// An edge that turns, of the face that runs along it from its lower corner: once.
  struct Edge {
    Double3 middle, direction;
    double dihedral;  ///< by its length
  };
  void add_edge(std::uint32_t f, std::uint32_t a, std::uint32_t b) {
    if (a > b) return;
    const Double3 &p = block_.position[a], &q = block_.position[b];
    std::uint32_t other = kNoVertex;
    for (const std::uint32_t c : at_.at(b)) {
      const auto& t = block_.faces[c >> 2];
      if (t[((c & 3) + 1) % 3] == a) other = c >> 2;
    }
    if (other == kNoVertex) return;
    const Double3 m = unit_or_zero(doubled_[f]), n = unit_or_zero(doubled_[other]);
    const Double3 d = q - p;
    const double length = norm(d);
    if (!(length > 0.0) || dot(m, m) == 0.0 || dot(n, n) == 0.0) return;
    // f lies on the left of the way from a to b, so at a convex edge its normal turns about that way to the other one.
    const double dihedral = angle_between(m, n) * (dot(cross(m, n), d) > 0.0 ? 1.0 : -1.0);
    if (dihedral != 0.0) edges_.push_back({(p + q) * 0.5, d, dihedral / length});
  }

  const MeshBlock& block_;
  double square_;
  FaceCorners at_;
  std::vector<Double3> doubled_;  ///< normals of faces, twice their areas
  std::vector<double> area_;      ///< of faces, doubled
  std::vector<Double3> middle_;   ///< of faces
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> first_edge_;  ///< per face, one more at the end
  std::vector<std::uint32_t> seen_, face_seen_, vertices_, faces_;
};

}  // namespace

std::vector<CurvatureTensor> curvature_tensors(const MeshBlock& block,
                                               const std::vector<std::uint8_t>& wanted, double radius) {
  Curvatures curvatures(block, radius);
  std::vector<CurvatureTensor> out(block.key.size());
  for (std::uint32_t v = 0; v < out.size(); ++v)
    if (wanted[v]) out[v] = curvatures.at(v);
  return out;
}

}  // namespace tessera
