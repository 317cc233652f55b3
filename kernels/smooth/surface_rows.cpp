#include "kernels/smooth/surface_rows.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "octree/error.h"
#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Below this ratio of doubled area to the sum of squared edges a face has no direction that means anything.
constexpr double kDegenerateRatio = 1e-10;
/// Needles would otherwise tie two vertices together so hard that float weights drown the others.
constexpr double kLargestCotangent = 1e3;
/// Cosine of the turn from which a vertex of a polyline is a corner: noise of a fifth of an edge turns up to
/// 45 degrees.
constexpr double kCornerCosine = 0.5;

struct FaceShape {
  std::array<float, 3> cotangent = {0, 0, 0};  ///< of the angle at each corner
  Float3 normal = {0, 0, 0};                   ///< unit; zero for a degenerate face
};

float bounded_cotangent(double c) {
  return static_cast<float>(c > kLargestCotangent    ? kLargestCotangent
                            : c < -kLargestCotangent ? -kLargestCotangent
                                                     : c);
}

std::vector<FaceShape> face_shapes(const MeshBlock& block, std::uint64_t& degenerate) {
  std::vector<FaceShape> shapes(block.faces.size());
  for (std::size_t f = 0; f < shapes.size(); ++f) {
    const auto& face = block.faces[f];
    const Double3 p = block.position[face[0]], q = block.position[face[1]], r = block.position[face[2]];
    const Double3 pq = q - p, qr = r - q, rp = p - r;
    const Double3 area = cross(pq, qr);
    const double doubled = norm(area);
    if (!(doubled > kDegenerateRatio * (dot(pq, pq) + dot(qr, qr) + dot(rp, rp)))) {
      ++degenerate;
      continue;
    }
    FaceShape& s = shapes[f];
    const double inverse = 1.0 / doubled;
    s.cotangent = {bounded_cotangent(-dot(pq, rp) * inverse), bounded_cotangent(-dot(qr, pq) * inverse),
                   bounded_cotangent(-dot(rp, qr) * inverse)};
    s.normal = {static_cast<float>(area[0] * inverse), static_cast<float>(area[1] * inverse),
                static_cast<float>(area[2] * inverse)};
  }
  return shapes;
}

/// What the faces at a vertex say of one of its edges.
struct EdgeView {
  std::uint32_t to = 0;
  std::uint32_t face = 0;  ///< the first of them
  float cotangent = 0.0F;  ///< sum of the opposite angles'
  std::uint8_t faces = 0;  ///< saturates
  bool border = false;
  bool crease = false;
};

class RowMaker {
 public:
  RowMaker(const MeshBlock& block, const SurfaceRowOptions& options) : block_(block), options_(options) {
    creases_ = options.feature_angle_deg > 0.0;
    const double limit = cosine_of_degrees(options.feature_angle_deg);
    crease_cosine_ = static_cast<float>(limit);
    // Where extraction or the user already said "crease", half the angle confirms it.
    hinted_cosine_ = static_cast<float>(sin_cos(options.feature_angle_deg * (kPi / 360.0)).cos);
  }

  SurfaceRows make(const FaceCorners& corners) {
    const std::size_t n = block_.position.size();
    for (std::size_t v = 0; v < n; ++v)
      for (const double x : block_.position[v])
        if (!std::isfinite(x))
          throw InputError("vertex " + std::to_string(block_.key[v]) +
                           " has a coordinate that is not finite; repair "
                           "the mesh before smoothing it");
    shapes_ = face_shapes(block_, rows_.degenerate_faces);
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
    return std::move(rows_);
  }

 private:
  bool is_crease(std::uint32_t v, std::uint32_t u, std::uint32_t f, std::uint32_t g) const {
    const Float3& a = shapes_[f].normal;
    const Float3& b = shapes_[g].normal;
    const float cosine = dot(a, b);
    if (a == Float3{0, 0, 0} || b == Float3{0, 0, 0}) return false;
    return cosine < (hinted(v) && hinted(u) ? hinted_cosine_ : crease_cosine_);
  }
  bool hinted(std::uint32_t v) const {
    return block_.vertex_class[v] == VertexClass::kCrease || block_.vertex_class[v] == VertexClass::kCorner;
  }

  /// The edges of a star, in the order in which its ascending faces name them.
  void gather(std::uint32_t v, std::span<const std::uint32_t> corners) {
    if (edges_.size() < 2 * corners.size()) edges_.resize(2 * corners.size());
    EdgeView* const edges = edges_.data();
    std::uint32_t* const mark = mark_.data();
    std::uint32_t count = 0;
    const auto touch = [&](std::uint32_t u, float cotangent, bool border, std::uint32_t face) {
      const std::uint32_t at = mark[u];
      if (at >= count || edges[at].to != u) {
        mark[u] = count;
        edges[count++] = {u, face, cotangent, 1, border, false};
        return;
      }
      EdgeView& e = edges[at];
      e.cotangent += cotangent;
      e.border |= border;
      if (e.faces < 3) ++e.faces;
      if (creases_) e.crease |= is_crease(v, u, e.face, face);
    };
    for (const std::uint32_t corner : corners) {
      const std::uint32_t f = corner >> 2, k = corner & 3, next = k == 2 ? 0 : k + 1,
                          last = k == 0 ? 2 : k - 1;
      const auto& face = block_.faces[f];
      const std::uint8_t flags = block_.face_flags[f];
      const FaceShape& shape = shapes_[f];
      touch(face[next], shape.cotangent[last], (flags >> k & 1) != 0, f);
      touch(face[last], shape.cotangent[next], (flags >> last & 1) != 0, f);
    }
    star_ = {edges, count};
  }

  void finish_row(std::uint32_t v) {
    if (star_.empty()) return;
    bool open = false, irregular = false;
    std::size_t lines = 0, borders = 0;
    for (const EdgeView& e : star_) {
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
    }
  }

  static bool on_line(const EdgeView& e) { return e.faces == 1 || e.crease; }

  /// Exactly two edges of the line, without a sharp turn between them.
  bool is_straight(std::uint32_t v, std::size_t lines) const {
    if (lines != 2) return false;
    std::array<Double3, 2> arm{};
    std::size_t found = 0;
    for (const EdgeView& e : star_)
      if (on_line(e)) arm[found++] = block_.position[e.to] - block_.position[v];
    const double lengths = norm(arm[0]) * norm(arm[1]);
    return lengths > 0.0 && -dot(arm[0], arm[1]) > kCornerCosine * lengths;
  }

  void append(std::uint32_t to, float weight) {
    rows_.neighbour.push_back(to);
    rows_.weight.push_back(weight);
  }

  void weigh_free(std::uint32_t v) {
    const bool uniform = options_.weights == LaplaceWeights::kUniform;
    float sum = 0.0F;
    for (EdgeView& e : star_) {
      e.cotangent = uniform ? 1.0F : e.cotangent > 0.0F ? e.cotangent : 0.0F;
      sum += e.cotangent;
    }
    if (!(sum > 0.0F)) {  // a star of degenerate faces: their angles say nothing
      for (EdgeView& e : star_) e.cotangent = 1.0F;
      sum = static_cast<float>(star_.size());
    }
    for (const EdgeView& e : star_) append(e.to, e.cotangent);
    rows_.inverse_degree[v] = 1.0F / sum;
  }

  void weigh_line(std::uint32_t v) {
    float sum = 0.0F;
    for (const EdgeView& e : star_) {
      if (!on_line(e)) continue;
      const double arm = norm(block_.position[e.to] - block_.position[v]);
      const float w = options_.weights == LaplaceWeights::kUniform ? 1.0F : static_cast<float>(1.0 / arm);
      append(e.to, w);
      sum += w;
    }
    rows_.inverse_degree[v] = 1.0F / sum;
  }

  const MeshBlock& block_;
  const SurfaceRowOptions& options_;
  bool creases_ = false;
  float crease_cosine_ = 0.0F, hinted_cosine_ = 0.0F;
  std::vector<FaceShape> shapes_;
  /// Where the current row may hold a vertex; checked before it is believed.
  std::vector<std::uint32_t> mark_;
  std::vector<EdgeView> edges_;
  std::span<EdgeView> star_;  ///< the edges of the current row
  SurfaceRows rows_;
};

}  // namespace

SurfaceRows make_surface_rows(const MeshBlock& block, const FaceCorners& corners,
                              const SurfaceRowOptions& options) {
  return RowMaker(block, options).make(corners);
}

std::vector<std::uint8_t> complete_rings(const MeshBlock& block, const FaceCorners& corners,
                                         const SurfaceRows& rows, int rings) {
  std::vector<std::uint8_t> complete(rows.role.size(), 1);
  for (std::size_t v = 0; v < complete.size(); ++v) complete[v] = rows.role[v] != VertexRole::kOpen;
  erode(block, corners, rings - 1, complete);
  return complete;
}

void erode(const MeshBlock& block, const FaceCorners& corners, int rings, std::vector<std::uint8_t>& flags) {
  std::vector<std::uint32_t> front, next;
  for (std::uint32_t v = 0; v < flags.size(); ++v)
    if (flags[v] == 0) front.push_back(v);
  // Rows of lines and corners name few neighbours; rings spread over faces.
  for (int ring = 0; ring < rings && !front.empty(); ++ring) {
    next.clear();
    for (const std::uint32_t v : front)
      for (const std::uint32_t corner : corners.at(v))
        for (const std::uint32_t u : block.faces[corner >> 2]) {
          if (flags[u] == 0) continue;
          flags[u] = 0;
          next.push_back(u);
        }
    front.swap(next);
  }
}

}  // namespace tessera
