#include "kernels/edit/anisotropic_metric.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "kernels/maps/parameterize.h"
#include "octree/error.h"

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;

/// 1 for support, handles and the rings of fixed vertices that the boundary condition reads.
std::vector<std::uint8_t> domain(const TriangleSpan& mesh, std::span<const std::int32_t> role, int rings) {
  std::vector<std::uint8_t> in(role.size());
  for (std::size_t v = 0; v < role.size(); ++v) in[v] = role[v] != kFixedVertex;
  for (int ring = 0; ring < rings; ++ring) {
    std::vector<std::uint8_t> next = in;
    for (const Face& f : mesh.faces)
      if (in[f[0]] || in[f[1]] || in[f[2]]) next[f[0]] = next[f[1]] = next[f[2]] = 1;
    in.swap(next);
  }
  return in;
}

}  // namespace

Laplacian anisotropic_metric(const TriangleSpan& mesh, std::span<const std::int32_t> role, int order,
                             AnisotropicReport& report) {
  const std::vector<std::uint8_t> in = domain(mesh, role, order);
  std::vector<std::uint32_t> number(role.size(), 0), vertex;
  std::vector<Double3> position;
  for (std::uint32_t v = 0; v < role.size(); ++v)
    if (in[v]) {
      number[v] = static_cast<std::uint32_t>(vertex.size());
      vertex.push_back(v);
      position.push_back(mesh.positions[v]);
    }
  std::vector<Face> faces, part;
  for (const Face& f : mesh.faces)
    if (in[f[0]] && in[f[1]] && in[f[2]]) {
      faces.push_back(f);
      part.push_back({number[f[0]], number[f[1]], number[f[2]]});
    }
  Parameterization map;
  try {
    map = parameterize({position, part}, {});
  } catch (const InputError& e) {
    throw InputError(
        std::string("anisotropic bending maps support and handles, with the ring of what is fixed "
                    "around them, into the plane: ") +
        e.what() + "; hold what is too much by handles that do not move, or leave it isotropic");
  }
  report.flipped = map.report.distortion.flipped;
  report.mean_quasi_conformal = map.report.distortion.mean_quasi_conformal;

  // Principal axes of the support in the plane, each vertex with the area around it.
  double area = 0.0, mx = 0.0, my = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
  const auto each = [&](const auto& use) {
    for (const Face& f : part) {
      const Double2 &a = map.uv[f[0]], &b = map.uv[f[1]], &c = map.uv[f[2]];
      const double w = std::fabs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
      for (const std::uint32_t v : f)
        if (role[vertex[v]] == kSupportVertex) use(map.uv[v], w);
    }
  };
  each([&](const Double2& p, double w) { area += w, mx += w * p[0], my += w * p[1]; });
  if (!(area > 0.0)) throw InputError("anisotropic bending: the map of the support has no area");
  mx /= area, my /= area;
  each([&](const Double2& p, double w) {
    const double x = p[0] - mx, y = p[1] - my;
    xx += w * x * x / area, xy += w * x * y / area, yy += w * y * y / area;
  });
  const double half = 0.5 * (xx + yy), apart = std::sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy);
  const double large = half + apart, small = half - apart;
  if (!(small > 0.0)) throw InputError("anisotropic bending: the map of the support has no width");
  Double2 axis = xx >= yy ? Double2{large - yy, xy} : Double2{xy, large - xx};
  const double length = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1]);
  axis = length > 0.0 ? Double2{axis[0] / length, axis[1] / length} : Double2{1.0, 0.0};
  report.ratio = std::sqrt(large / small);

  // As wide as long, and of the area that the surface has.
  double surface = 0.0;
  for (const Face& f : part)
    surface += 0.5 * norm(triangle_normal(position[f[0]], position[f[1]], position[f[2]]));
  std::vector<Double3> plane(role.size(), Double3{});
  double mapped = 0.0;
  for (std::size_t k = 0; k < vertex.size(); ++k) {
    const double x = map.uv[k][0] - mx, y = map.uv[k][1] - my;
    plane[vertex[k]] = {(axis[0] * x + axis[1] * y) / std::sqrt(large),
                        (axis[0] * y - axis[1] * x) / std::sqrt(small), 0.0};
  }
  for (const Face& f : faces) mapped += 0.5 * norm(triangle_normal(plane[f[0]], plane[f[1]], plane[f[2]]));
  const double scale = std::sqrt(surface / mapped);
  for (Double3& p : plane) p = p * scale;
  return laplacian({plane, faces});
}

}  // namespace tessera
