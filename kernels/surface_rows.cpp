#include "kernels/surface_rows.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "kernels/face_corners.h"
#include "kernels/portable_math.h"
#include "octree/error.h"

namespace tessera {
namespace {

using synth::Vec3;

/// Below this ratio of doubled area to the sum of squared edges a face has no direction that means anything.
constexpr double kDegenerateRatio = 1e-10;
/// Needles would otherwise tie two vertices together so hard that float weights drown the others.
constexpr double kLargestCotangent = 1e3;
/// Cosine of the turn from which a vertex of a polyline is a corner: noise of a fifth of an edge turns up to
/// 45 degrees.
constexpr double kCornerTurnCosine = 0.5;

struct FaceShape {
  std::array<float, 3> cotangent = {0, 0, 0};  ///< of the angle at each corner
  Float3 normal = {0, 0, 0};                   ///< unit; zero for a degenerate face
};

Vec3 point(const Double3& p) {
  return {p[0], p[1], p[2]};
}

float bounded_cotangent(double cosine_part, double sine_part) {
  const double c = cosine_part / sine_part;
  return static_cast<float>(c > kLargestCotangent    ? kLargestCotangent
                            : c < -kLargestCotangent ? -kLargestCotangent
                                                     : c);
}

std::vector<FaceShape> face_shapes(const MeshBlock& block, std::uint64_t& degenerate) {
  std::vector<FaceShape> shapes(block.faces.size());
  for (std::size_t f = 0; f < shapes.size(); ++f) {
    const auto& face = block.faces[f];
    const Vec3 p = point(block.position[face[0]]), q = point(block.position[face[1]]),
               r = point(block.position[face[2]]);
    const Vec3 pq = q - p, qr = r - q, rp = p - r;
    const Vec3 area = cross(pq, qr);
    const double doubled = length(area);
    if (!(doubled > kDegenerateRatio * (dot(pq, pq) + dot(qr, qr) + dot(rp, rp)))) {
      ++degenerate;
      continue;
    }
    FaceShape& s = shapes[f];
    s.cotangent = {bounded_cotangent(-dot(pq, rp), doubled), bounded_cotangent(-dot(qr, pq), doubled),
                   bounded_cotangent(-dot(rp, qr), doubled)};
    const double inverse = 1.0 / doubled;
    s.normal = {static_cast<float>(area.x * inverse), static_cast<float>(area.y * inverse),
                static_cast<float>(area.z * inverse)};
  }
  return shapes;
}

/// What the faces at a vertex say of one of its edges.
struct EdgeView {
  std::uint32_t face = 0;  ///< the first of them
  std::uint8_t faces = 0;  ///< saturates
  bool border = false;
  bool crease = false;
};

class RowMaker {
 public:
  RowMaker(const MeshBlock& block, const SurfaceRowOptions& options) : block_(block), options_(options) {
    creases_ = options.feature_angle_deg > 0.0;
    const double limit = synth::sin_cos(options.feature_angle_deg * (synth::kPi / 180.0)).cos;
    crease_cosine_ = static_cast<float>(limit);
    // Where extraction or the user already said "crease", half the angle confirms it.
    hinted_cosine_ = static_cast<float>(synth::sin_cos(options.feature_angle_deg * (synth::kPi / 360.0)).cos);
  }

  SurfaceRows make() {
    const std::size_t n = block_.position.size();
    for (std::size_t v = 0; v < n; ++v)
      for (const double x : block_.position[v])
        if (!std::isfinite(x))
          throw InputError("vertex " + std::to_string(block_.key[v]) +
                           " has a coordinate that is not finite; repair "
                           "the mesh before smoothing it");
    shapes_ = face_shapes(block_, rows_.degenerate_faces);
    const FaceCorners corners(block_);
    mark_.assign(n, 0);
    rows_.first.resize(n + 1);
    rows_.inverse_degree.assign(n, 0.0F);
    rows_.role.assign(n, VertexRole::kFixed);
    rows_.neighbour.reserve(3 * block_.faces.size() + n);
    rows_.weight.reserve(rows_.neighbour.capacity());
    for (std::uint32_t v = 0; v < n; ++v) {
      rows_.first[v] = static_cast<std::uint32_t>(rows_.neighbour.size());
      gather(v, corners.at(v));
      finish_row(v);
    }
    rows_.first[n] = static_cast<std::uint32_t>(rows_.neighbour.size());
    for (std::uint32_t v = 0; v < n; ++v)
      for (std::uint32_t e = rows_.first[v]; rows_.role[v] == VertexRole::kLine && e < rows_.first[v + 1];
           ++e)
        if (rows_.role[rows_.neighbour[e]] == VertexRole::kFree) rows_.held.push_back(e);
    return std::move(rows_);
  }

 private:
  void touch(std::uint32_t v, std::uint32_t u, float cotangent, bool border, std::uint32_t face) {
    const std::uint32_t begin = rows_.first[v];
    std::uint32_t at = mark_[u];
    if (at >= begin && at < rows_.neighbour.size() && rows_.neighbour[at] == u) {
      EdgeView& e = edges_[at - begin];
      rows_.weight[at] += cotangent;
      e.border |= border;
      if (e.faces < 3) ++e.faces;
      if (creases_) e.crease |= is_crease(v, u, e.face, face);
      return;
    }
    at = static_cast<std::uint32_t>(rows_.neighbour.size());
    mark_[u] = at;
    rows_.neighbour.push_back(u);
    rows_.weight.push_back(cotangent);
    edges_.push_back({face, 1, border, false});
  }

  bool is_crease(std::uint32_t v, std::uint32_t u, std::uint32_t f, std::uint32_t g) const {
    const Float3& a = shapes_[f].normal;
    const Float3& b = shapes_[g].normal;
    const float cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    if (a == Float3{0, 0, 0} || b == Float3{0, 0, 0}) return false;
    return cosine < (hinted(v) && hinted(u) ? hinted_cosine_ : crease_cosine_);
  }
  bool hinted(std::uint32_t v) const {
    return block_.vertex_class[v] == VertexClass::kCrease || block_.vertex_class[v] == VertexClass::kCorner;
  }

  void gather(std::uint32_t v, std::span<const std::uint32_t> corners) {
    edges_.clear();
    for (const std::uint32_t corner : corners) {
      const std::uint32_t f = corner >> 2, k = corner & 3, next = k == 2 ? 0 : k + 1,
                          last = k == 0 ? 2 : k - 1;
      const auto& face = block_.faces[f];
      const std::uint8_t flags = block_.face_flags[f];
      touch(v, face[next], shapes_[f].cotangent[last], (flags >> k & 1) != 0, f);
      touch(v, face[last], shapes_[f].cotangent[next], (flags >> last & 1) != 0, f);
    }
  }

  void finish_row(std::uint32_t v) {
    const std::uint32_t begin = rows_.first[v];
    if (edges_.empty()) return;
    bool open = false, irregular = false;
    std::size_t lines = 0, borders = 0;
    for (const EdgeView& e : edges_) {
      open |= e.faces == 1 && !e.border;
      irregular |= e.faces > 2;
      const bool border = e.faces == 1;
      borders += border;
      lines += border || e.crease;
    }
    const bool corner = creases_ && block_.vertex_class[v] == VertexClass::kCorner;
    // One crease edge alone is where a crease fades out: the vertex belongs to the smooth part.
    VertexRole role = lines <= 1 && borders == 0 ? VertexRole::kFree : VertexRole::kLine;
    if (open) {
      role = VertexRole::kOpen;
    } else if (irregular || corner || (role == VertexRole::kLine && !is_straight(v, lines))) {
      role = VertexRole::kFixed;
    }
    rows_.role[v] = role;
    if (role == VertexRole::kFree) {
      weigh_free(v);
    } else if (role == VertexRole::kLine) {
      weigh_line(v);
    } else {
      rows_.neighbour.resize(begin);
      rows_.weight.resize(begin);
    }
  }

  bool on_line(std::size_t e) const { return edges_[e].faces == 1 || edges_[e].crease; }

  /// Exactly two edges of the line, without a sharp turn between them.
  bool is_straight(std::uint32_t v, std::size_t lines) const {
    if (lines != 2) return false;
    std::array<Vec3, 2> arm;
    std::size_t found = 0;
    for (std::size_t e = 0; e < edges_.size(); ++e)
      if (on_line(e))
        arm[found++] =
            point(block_.position[rows_.neighbour[rows_.first[v] + e]]) - point(block_.position[v]);
    const double lengths = length(arm[0]) * length(arm[1]);
    return lengths > 0.0 && -dot(arm[0], arm[1]) > kCornerTurnCosine * lengths;
  }

  void weigh_free(std::uint32_t v) {
    const std::uint32_t begin = rows_.first[v], end = static_cast<std::uint32_t>(rows_.neighbour.size());
    float sum = 0.0F;
    for (std::uint32_t e = begin; e < end; ++e) {
      float& w = rows_.weight[e];
      w = options_.weights == LaplaceWeights::kUniform ? 1.0F : w > 0.0F ? w : 0.0F;
      sum += w;
    }
    if (!(sum > 0.0F)) {  // a star of degenerate faces: their angles say nothing
      std::fill(rows_.weight.begin() + begin, rows_.weight.end(), 1.0F);
      sum = static_cast<float>(end - begin);
    }
    rows_.inverse_degree[v] = 1.0F / sum;
  }

  void weigh_line(std::uint32_t v) {
    const std::uint32_t begin = rows_.first[v];
    std::uint32_t kept = begin;
    float sum = 0.0F;
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      if (!on_line(e)) continue;
      const std::uint32_t u = rows_.neighbour[begin + e];
      const double arm = length(point(block_.position[u]) - point(block_.position[v]));
      const float w = options_.weights == LaplaceWeights::kUniform ? 1.0F : static_cast<float>(1.0 / arm);
      rows_.neighbour[kept] = u;
      rows_.weight[kept++] = w;
      sum += w;
    }
    rows_.neighbour.resize(kept);
    rows_.weight.resize(kept);
    rows_.inverse_degree[v] = 1.0F / sum;
  }

  const MeshBlock& block_;
  const SurfaceRowOptions& options_;
  bool creases_ = false;
  float crease_cosine_ = 0.0F, hinted_cosine_ = 0.0F;
  std::vector<FaceShape> shapes_;
  std::vector<std::uint32_t>
      mark_;                     ///< where the current row may hold a vertex; checked before it is believed
  std::vector<EdgeView> edges_;  ///< of the current row
  SurfaceRows rows_;
};

}  // namespace

SurfaceRows make_surface_rows(const MeshBlock& block, const SurfaceRowOptions& options) {
  return RowMaker(block, options).make();
}

std::vector<std::uint8_t> complete_rings(const MeshBlock& block, const SurfaceRows& rows, int rings) {
  const std::size_t n = rows.role.size();
  std::vector<std::uint8_t> complete(n, 1);
  std::vector<std::uint32_t> front, next;
  for (std::uint32_t v = 0; v < n; ++v) {
    if (rows.role[v] != VertexRole::kOpen) continue;
    complete[v] = 0;
    front.push_back(v);
  }
  if (front.empty()) return complete;
  // Rows of lines and corners name few neighbours; rings spread over faces.
  const FaceCorners corners(block);
  for (int ring = 1; ring < rings; ++ring) {
    next.clear();
    for (const std::uint32_t v : front)
      for (const std::uint32_t corner : corners.at(v))
        for (const std::uint32_t u : block.faces[corner >> 2]) {
          if (complete[u] == 0) continue;
          complete[u] = 0;
          next.push_back(u);
        }
    front.swap(next);
  }
  return complete;
}

}  // namespace tessera
