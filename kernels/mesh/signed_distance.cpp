#include "kernels/mesh/signed_distance.h"

#include <algorithm>

#include "kernels/mesh/triangle_foot.h"
#include "octree/edge_faces.h"
#include "octree/portable_math.h"

namespace tessera {

SignedDistance::SignedDistance(const MeshBlock& block, const Double3& origin)
    : faces_(block.position, block.faces, origin),
      corner_(block.faces),
      beyond_(block.faces.size(), {kNone, kNone, kNone}),
      border_edge_(block.faces.size(), 0),
      position_(block.position),
      normal_(block.faces.size()),
      vertex_normal_(block.position.size(), Double3{0, 0, 0}),
      border_vertex_(block.position.size(), 0) {
  for (Double3& p : position_) p = p - origin;
  for (std::size_t f = 0; f < corner_.size(); ++f) {
    const std::array<Double3, 3> p = {position_[corner_[f][0]], position_[corner_[f][1]],
                                      position_[corner_[f][2]]};
    normal_[f] = unit_or_zero(triangle_normal(p[0], p[1], p[2]));
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 to = unit_or_zero(p[(k + 1) % 3] - p[k]), from = unit_or_zero(p[(k + 2) % 3] - p[k]);
      Double3& sum = vertex_normal_[corner_[f][k]];
      sum = sum + normal_[f] * angle_between(to, from);
    }
  }
  join_edges(block);
}

void SignedDistance::join_edges(const MeshBlock& block) {
  EdgeFaces(position_.size(), corner_)
      .for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
        const std::uint32_t f = half[0] / 3, k = half[0] % 3;
        if (half.size() == 2) {
          beyond_[f][k] = half[1] / 3;
          beyond_[half[1] / 3][half[1] % 3] = f;
        } else if (half.size() == 1 && (block.face_flags[f] >> k & 1) != 0) {
          border_edge_[f] = static_cast<std::uint8_t>(border_edge_[f] | 1u << k);
          border_vertex_[low] = border_vertex_[high] = 1;
        }
      });
}

SignedDistance::Foot SignedDistance::closest(const Double3& p, double limit_square,
                                             std::uint32_t hint) const {
  const ClosestFaces::Hit hit = faces_.closest(p, limit_square, hint);
  Foot foot;
  if (hit.slot == kNone) return foot;
  foot.slot = hit.slot;
  foot.face = faces_.face(hit.slot);
  foot.square = hit.square;
  const std::array<std::uint32_t, 3>& c = corner_[foot.face];
  const TriangleFoot on = foot_in_triangle(p, position_[c[0]], position_[c[1]], position_[c[2]]);
  foot.at = on.at;
  foot.side = normal_[foot.face];
  if (on.corner >= 0) {
    const std::uint32_t v = c[static_cast<std::size_t>(on.corner)];
    foot.at = position_[v];
    foot.side = vertex_normal_[v];
    foot.border = border_vertex_[v] != 0;
  } else if (on.edge >= 0) {
    // The same foot whichever of the two faces was found.
    const auto k = static_cast<std::size_t>(on.edge);
    const auto [low, high] = std::minmax(c[k], c[(k + 1) % 3]);
    foot.at = foot_in_triangle(p, position_[low], position_[high], position_[high]).at;
    const std::uint32_t other = beyond_[foot.face][k];
    if (other != kNone) foot.side = foot.side + normal_[other];
    foot.border = (border_edge_[foot.face] >> k & 1) != 0;
  }
  return foot;
}

std::uint32_t SignedDistance::nearest_corner(const Foot& foot) const {
  const std::array<std::uint32_t, 3>& c = corner_[foot.face];
  std::uint32_t best = c[0];
  for (const std::uint32_t v : c)
    if (squared_distance(position_[v], foot.at) < squared_distance(position_[best], foot.at)) best = v;
  return best;
}

double SignedDistance::signed_distance(const Double3& p, const Foot& foot) {
  const double away = std::sqrt(foot.square);
  return dot(p - foot.at, foot.side) < 0.0 ? -away : away;
}

}  // namespace tessera
