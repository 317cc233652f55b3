#include "kernels/decimate/feature_edges.h"

#include <algorithm>
#include <cmath>

#include "octree/portable_math.h"

namespace tessera {
namespace {

/// Not of unit length: cosines compare by their squares, without roots.
struct FaceNormal {
  Double3 normal{};
  double length2;
};

FaceNormal face_normal(const CollapseMesh& mesh, std::size_t f) {
  const std::uint32_t* v = mesh.face(f).vertex;
  const Double3& a = mesh.at(v[0]);
  const Double3 n = cross(mesh.at(v[1]) - a, mesh.at(v[2]) - a);
  return {n, dot(n, n)};
}

/// Whether the cosine is below `minimum`; faces without area count as no turn.
bool is_sharp(const FaceNormal& a, const FaceNormal& b, double minimum) {
  const double along = dot(a.normal, b.normal), square = along * along,
               limit = minimum * minimum * (a.length2 * b.length2);
  return minimum > 0.0 ? along < 0.0 || square < limit : along < 0.0 && square > limit;
}

/// Calls `visit(corner, corner across)` for the edges of a face with another one of a higher number.
template <class Visit>
void for_its_edges(const CollapseMesh& mesh, std::uint32_t f, const Visit& visit) {
  for (std::uint32_t i = 0; i < 3; ++i) {
    const std::uint32_t c = 4 * f + i, o = mesh.face(f).opposite[i];
    if (o != kNoCorner && o > c) visit(c, o);
  }
}

/// Normals of unit length as floats: off by less than 2^-22.
struct UnitNormal {
  float x, y, z;
};

std::vector<UnitNormal> unit_normals(const CollapseMesh& mesh) {
  std::vector<UnitNormal> unit(mesh.faces().size());
  for (std::size_t f = 0; f < unit.size(); ++f) {
    const FaceNormal n = face_normal(mesh, f);
    const double per = 1.0 / std::sqrt(n.length2);
    unit[f] = {static_cast<float>(n.normal[0] * per), static_cast<float>(n.normal[1] * per),
               static_cast<float>(n.normal[2] * per)};
  }
  return unit;
}

/// Whether the cosines to the faces across the three edges are all above `minimum`; not where a face has no area.
bool all_above(const CollapseMesh& mesh, const std::vector<UnitNormal>& unit, std::uint32_t f,
               float minimum) {
  const UnitNormal& n = unit[f];
  bool above = true;
  for (const std::uint32_t o : mesh.face(f).opposite) {
    const UnitNormal& m = unit[o != kNoCorner ? o >> 2 : f];
    above &= n.x * m.x + n.y * m.y + n.z * m.z > minimum;
  }
  return above;
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
  const auto look_at = [&](std::uint32_t c, std::uint32_t o) {
    const FaceNormal n = face_normal(mesh, c >> 2), m = face_normal(mesh, o >> 2);
    if (!is_sharp(n, m, limit)) return;
    const std::uint32_t a = mesh.vertex(next_corner(c)), b = mesh.vertex(prev_corner(c));
    const bool strong = is_sharp(n, m, 0.5);
    edges.push_back({a, b, strong});
    edges.push_back({b, a, strong});
  };
  {
    // Most edges are far from the limit, which floats tell.
    const std::vector<UnitNormal> unit = unit_normals(mesh);
    const float surely_flat = static_cast<float>(limit) + 0x1p-19f;
    for (std::uint32_t f = 0; f < unit.size(); ++f)
      if (!all_above(mesh, unit, f, surely_flat)) for_its_edges(mesh, f, look_at);
  }
  std::sort(edges.begin(), edges.end(),
            [](const Sharp& x, const Sharp& y) { return x.from != y.from ? x.from < y.from : x.to < y.to; });
  const auto goes_on = [&](std::uint32_t from, std::uint32_t at) {
    const Double3 in = mesh.at(at) - mesh.at(from);
    for (auto e = std::lower_bound(edges.begin(), edges.end(), at,
                                   [](const Sharp&x, std::uint32_t v) { return x.from < v; });
         e != edges.end() && e->from == at; ++e) {
      const Double3 out = mesh.at(e->to) - mesh.at(at);
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
  const double minimum = cosine_of_degrees(std::fmax(10.0, 0.5 * feature_angle_deg));
  const auto near = [&](const CollapseFace& f) {
    return synthetic || feature[f.vertex[0]] + feature[f.vertex[1]] + feature[f.vertex[2]] > 1;
  };
  const auto look_at = [&](std::uint32_t c, std::uint32_t o) {
    const std::uint32_t a = mesh.vertex(next_corner(c)), b = mesh.vertex(prev_corner(c));
    const bool boundary = ((mesh.face(c >> 2).state ^ mesh.face(o >> 2).state) & kStateSynthetic) != 0;
    if (!boundary && !(feature[a] && feature[b] &&
                       is_sharp(face_normal(mesh, c >> 2), face_normal(mesh, o >> 2), minimum)))
      return;
    mesh.mark_crease(c);
    mesh.mark_crease(o);
    for (const std::uint32_t v : {a, b}) creases[v] = static_cast<std::uint8_t>(std::min(creases[v] + 1, 3));
  };
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f)
    if (near(mesh.face(f))) for_its_edges(mesh, f, look_at);
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
