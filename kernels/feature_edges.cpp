#include "kernels/feature_edges.h"

#include <algorithm>
#include <cmath>

#include "kernels/portable_math.h"

namespace tessera {
namespace {

using synth::Vec3;

double cosine_of_degrees(double degrees) {
  return synth::sin_cos(degrees * (synth::kPi / 180.0)).cos;
}

std::vector<Vec3> unit_normals(const CollapseMesh& mesh) {
  std::vector<Vec3> out(mesh.face_state.size());
  for (std::size_t f = 0; f < out.size(); ++f) {
    const auto p = [&](std::size_t i) {
      const Double3& q = mesh.position[mesh.vertex[3 * f + i]];
      return Vec3{q[0], q[1], q[2]};
    };
    const Vec3 n = cross(p(1) - p(0), p(2) - p(0));
    const double size = length(n);
    out[f] = size > 0.0 ? n * (1.0 / size) : Vec3{0, 0, 0};
  }
  return out;
}

/// Calls `visit(corner, cosine of the turn)` for each edge with two faces; faces without area count as no
/// turn.
template <class Visit>
void for_each_edge(const CollapseMesh& mesh, const std::vector<Vec3>& normal, const Visit& visit) {
  for (std::uint32_t c = 0; c < mesh.vertex.size(); ++c) {
    const std::uint32_t o = mesh.opposite[c];
    if (o == kNoCorner || o < c) continue;
    const Vec3 &a = normal[c / 3], &b = normal[o / 3];
    const bool flat = dot(a, a) == 0.0 || dot(b, b) == 0.0;
    visit(c, flat ? 1.0 : dot(a, b));
  }
}

}  // namespace

void mark_features(CollapseMesh& mesh, const MeshBlock& block, const MeshBlock& reference,
                   double feature_angle_deg) {
  const std::size_t n = mesh.position.size();
  std::vector<std::uint8_t> feature(n, 0);
  bool any = false;
  for (std::size_t v = 0; v < n; ++v)
    if (block.vertex_class[v] == VertexClass::kCrease || block.vertex_class[v] == VertexClass::kCorner)
      feature[v] = any = true;
  if (feature_angle_deg > 0.0) {
    const CollapseMesh original(reference, {0.0, 0.0, 0.0});
    const double limit = cosine_of_degrees(feature_angle_deg);
    const auto mark = [&](std::uint32_t v) {
      const auto at = std::lower_bound(block.key.begin(), block.key.end(), reference.key[v]);
      if (at != block.key.end() && *at == reference.key[v]) {
        feature[static_cast<std::size_t>(at - block.key.begin())] = 1;
        any = true;
      }
    };
    for_each_edge(original, unit_normals(original), [&](std::uint32_t c, double cosine) {
      if (cosine >= limit) return;
      mark(original.vertex[next_corner(c)]);
      mark(original.vertex[prev_corner(c)]);
    });
  }
  bool synthetic = false;
  for (const std::uint8_t s : mesh.face_state) synthetic |= (s & kStateSynthetic) != 0;
  if (!any && !synthetic) return;

  std::vector<std::uint8_t> creases(n, 0);
  const double least = cosine_of_degrees(std::fmax(10.0, 0.5 * feature_angle_deg));
  for_each_edge(mesh, unit_normals(mesh), [&](std::uint32_t c, double cosine) {
    const std::uint32_t a = mesh.vertex[next_corner(c)], b = mesh.vertex[prev_corner(c)];
    const std::uint32_t o = mesh.opposite[c];
    const bool rim = ((mesh.face_state[c / 3] ^ mesh.face_state[o / 3]) & kStateSynthetic) != 0;
    if (!rim && !(feature[a] && feature[b] && cosine < least)) return;
    mesh.mark_crease(c);
    mesh.mark_crease(o);
    for (const std::uint32_t v : {a, b}) creases[v] = static_cast<std::uint8_t>(std::min(creases[v] + 1, 3));
  });
  for (std::size_t v = 0; v < n; ++v) {
    unsigned state = mesh.vertex_state[v];
    const bool corner = block.vertex_class[v] == VertexClass::kCorner;
    if (corner || creases[v] == 1 || creases[v] > 2 || (creases[v] > 0 && (state & kVertexBorder)))
      state |= kVertexFixed;
    else if (creases[v] == 2)
      state |= kVertexCrease;
    mesh.vertex_state[v] = static_cast<std::uint8_t>(state);
  }
}

}  // namespace tessera
