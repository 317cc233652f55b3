#include "kernels/blends/normal_jumps.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "octree/edge_faces.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr double kInner = 10.0 / 12.0;  ///< of the arc
constexpr double kEnd = 0.25;           ///< ribs: what is stitched there is not of the blend
constexpr double kAligned = 0.8660254037844386;
constexpr double kOtherLine = 8.0;  ///< so much nearer is what lies on the same trajectory, or the same rib
constexpr double kAsNear = 1e-9;    ///< cosines that differ by less are the same

/// The jump of an edge, and where it is: along the spine and across.
struct Jump {
  double along, across, angle;
};

/// Half the mean square difference of nearest neighbours.
/// \param line_along, line_across  what a way counts
double noise_of(const std::vector<Jump>& jumps, double line_along, double line_across) {
  const std::size_t n = jumps.size();
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    double square = std::numeric_limits<double>::infinity(), angle = jumps[i].angle;
    const auto look = [&](std::size_t j) {
      const double a = line_along * (jumps[j].along - jumps[i].along);
      const double b = line_across * (jumps[j].across - jumps[i].across);
      if (a * a >= square) return false;
      if (a * a + b * b < square) square = a * a + b * b, angle = jumps[j].angle;
      return true;
    };
    for (std::size_t j = i; j-- > 0 && look(j);) {
    }
    for (std::size_t j = i + 1; j < n && look(j); ++j) {
    }
    sum += 0.5 * (angle - jumps[i].angle) * (angle - jumps[i].angle);
  }
  return sum / static_cast<double>(n);
}

/// \param jumps  ascending along the spine
JumpSum sum_of(const std::vector<Jump>& jumps, double line_along, double line_across) {
  JumpSum s;
  s.edges = jumps.size();
  if (jumps.empty()) return s;
  const double n = static_cast<double>(jumps.size());
  for (const Jump& j : jumps) s.mean += j.angle / n;
  for (const Jump& j : jumps) s.variance += (j.angle - s.mean) * (j.angle - s.mean) / n;
  s.noise = noise_of(jumps, line_along, line_across);
  return s;
}

/// An edge of two faces.
struct InnerEdge {
  std::uint32_t low, high;
  std::array<std::uint32_t, 2> face;
};

}  // namespace

NormalJumps normal_jumps(const Fishbone& bone, std::span<const Double3> position,
                         std::span<const std::array<std::uint32_t, 3>> faces) {
  std::vector<Double3> middle, normal;
  std::vector<InnerEdge> inner;
  const auto face_normal = [&](std::uint32_t f) {
    const auto& t = faces[f];
    return unit_or_zero(triangle_normal(position[t[0]], position[t[1]], position[t[2]]));
  };
  EdgeFaces(position.size(), faces)
      .for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
        if (half.size() != 2) return;
        const Double3 m = face_normal(half[0] / 3), n = face_normal(half[1] / 3);
        if (dot(m, m) == 0.0 || dot(n, n) == 0.0) return;
        middle.push_back((position[low] + position[high]) * 0.5);
        normal.push_back(unit_or_zero(m + n));
        inner.push_back({low, high, {half[0] / 3, half[1] / 3}});
      });
  std::vector<Jump> along, across;
  const double ends = static_cast<double>(bone.planes.size() - 1);
  for (const RibVertex& v : locate_vertices(bone, middle, normal, 0.0, bone.edge + 0.5 * bone.mean_arc())) {
    if (!bone.planes.closed() && (v.position.rib < kEnd || v.position.rib > ends - kEnd)) continue;
    const RibProfile p = bone.profile_at(v.position.rib);
    if (v.across.zone != RibZone::kArc || std::fabs(v.across.run) > 0.5 * kInner * p.arc_length()) continue;
    const InnerEdge& edge = inner[v.vertex];
    const Double3 direction = unit_or_zero(position[edge.high] - position[edge.low]);
    const auto rib = static_cast<std::size_t>(v.position.rib) % bone.planes.size();
    const double cosine = std::fabs(dot(direction, bone.planes[rib].along));
    const Jump jump = {v.position.rib * bone.planes.spacing(), v.across.run,
                       angle_between(face_normal(edge.face[0]), face_normal(edge.face[1]))};
    const auto leads = [&](std::uint32_t f) {
      const auto& t = faces[f];
      for (std::size_t k = 0; k < 3; ++k) {
        const Double3 side = unit_or_zero(position[t[(k + 1) % 3]] - position[t[k]]);
        if (std::fabs(dot(side, bone.planes[rib].along)) > cosine + kAsNear) return false;
      }
      return true;
    };
    if (cosine > kAligned && (leads(edge.face[0]) || leads(edge.face[1]))) across.push_back(jump);
    if (cosine < 0.5) along.push_back(jump);
  }
  return {sum_of(along, 1.0, kOtherLine), sum_of(across, kOtherLine, 1.0)};
}

}  // namespace tessera
