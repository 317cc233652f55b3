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
  std::vector<Vec3> out(mesh.faces().size());
  for (std::size_t f = 0; f < out.size(); ++f) {
    const auto p = [&](std::size_t i) { return mesh.at(mesh.face(f).vertex[i]); };
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
  for (std::uint32_t c = 0; c < mesh.corner_end(); ++c) {
    if ((c & 3u) == 3u) continue;
    const std::uint32_t o = mesh.opposite(c);
    if (o == kNoCorner || o < c) continue;
    const Vec3 &a = normal[c >> 2], &b = normal[o >> 2];
    const bool flat = dot(a, a) == 0.0 || dot(b, b) == 0.0;
    visit(c, flat ? 1.0 : dot(a, b));
  }
}

}  // namespace

std::vector<std::uint8_t> sharp_vertices(const CollapseMesh& mesh, double feature_angle_deg) {
  if (!(feature_angle_deg > 0.0)) return {};
  const double limit = cosine_of_degrees(feature_angle_deg);
  struct Sharp {
    std::uint32_t from, to;
    bool strong;
  };
  std::vector<Sharp> edges;
  for_each_edge(mesh, unit_normals(mesh), [&](std::uint32_t c, double cosine) {
    if (cosine >= limit) return;
    const std::uint32_t a = mesh.vertex(next_corner(c)), b = mesh.vertex(prev_corner(c));
    edges.push_back({a, b, cosine < 0.5});
    edges.push_back({b, a, cosine < 0.5});
  });
  std::sort(edges.begin(), edges.end(),
            [](const Sharp& x, const Sharp& y) { return x.from != y.from ? x.from < y.from : x.to < y.to; });
  const auto goes_on = [&](std::uint32_t from, std::uint32_t at) {
    const Vec3 in = mesh.at(at) - mesh.at(from);
    for (auto e = std::lower_bound(edges.begin(), edges.end(), at,
                                   [](const Sharp&x, std::uint32_t v) { return x.from < v; });
         e != edges.end() && e->from == at; ++e) {
      const Vec3 out = mesh.at(e->to) - mesh.at(at);
      const double along = dot(in, out);
      if (e->to != from && along > 0.0 && along * along > 0.5 * dot(in, in) * dot(out, out)) return true;
    }
    return false;
  };
  std::vector<std::uint8_t> sharp(mesh.vertices(), 0);
  for (const Sharp& e : edges)
    if (e.from < e.to && (e.strong || (goes_on(e.from, e.to) && goes_on(e.to, e.from))))
      sharp[e.from] = sharp[e.to] = 1;
  return sharp;
}

void mark_features(CollapseMesh& mesh, const MeshBlock& block, const std::vector<std::uint8_t>& sharp,
                   const std::vector<std::uint32_t>& reference_vertex, double feature_angle_deg) {
  const std::size_t n = mesh.vertices();
  std::vector<std::uint8_t> feature(n, 0);
  bool any = false;
  const auto class_of = [&](std::uint32_t v) { return block.vertex_class[mesh.block_vertex(v)]; };
  for (std::uint32_t v = 0; v < n; ++v)
    if (class_of(v) == VertexClass::kCrease || class_of(v) == VertexClass::kCorner) feature[v] = any = true;
  for (std::uint32_t v = 0; v < n && !sharp.empty(); ++v)
    if (reference_vertex[v] != kNoCorner && sharp[reference_vertex[v]]) feature[v] = any = true;
  bool synthetic = false;
  for (const CollapseFace& f : mesh.faces()) synthetic |= (f.state & kStateSynthetic) != 0;
  if (!any && !synthetic) return;

  std::vector<std::uint8_t> creases(n, 0);
  const double least = cosine_of_degrees(std::fmax(10.0, 0.5 * feature_angle_deg));
  for_each_edge(mesh, unit_normals(mesh), [&](std::uint32_t c, double cosine) {
    const std::uint32_t a = mesh.vertex(next_corner(c)), b = mesh.vertex(prev_corner(c));
    const std::uint32_t o = mesh.opposite(c);
    const bool rim = ((mesh.face(c >> 2).state ^ mesh.face(o >> 2).state) & kStateSynthetic) != 0;
    if (!rim && !(feature[a] && feature[b] && cosine < least)) return;
    mesh.mark_crease(c);
    mesh.mark_crease(o);
    for (const std::uint32_t v : {a, b}) creases[v] = static_cast<std::uint8_t>(std::min(creases[v] + 1, 3));
  });
  for (std::uint32_t v = 0; v < n; ++v) {
    const bool border = (mesh.state(v) & kVertexBorder) != 0;
    if (class_of(v) == VertexClass::kCorner || creases[v] == 1 || creases[v] > 2 ||
        (creases[v] > 0 && border))
      mesh.add_state(v, kVertexFixed);
    else if (creases[v] == 2)
      mesh.add_state(v, kVertexCrease);
  }
}

}  // namespace tessera
