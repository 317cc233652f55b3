#include "kernels/texture/chart_raster.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/edge_faces.h"

namespace tessera {
namespace {

double plane_area(const Double2& a, const Double2& b, const Double2& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
}

Double2 centre_of(int x, int y, const ChartRaster& raster) {
  return {raster.texel * (x + 0.5 - raster.margin), raster.texel * (y + 0.5 - raster.margin)};
}

/// Range of texels whose centres may lie between two coordinates.
std::array<int, 2> texel_range(double low, double high, const ChartRaster& raster, int count) {
  const double from = std::ceil(low / raster.texel + raster.margin - 0.5 - 1e-6),
               to = std::floor(high / raster.texel + raster.margin - 0.5 + 1e-6);
  return {static_cast<int>(std::clamp(from, 0.0, static_cast<double>(count))),
          static_cast<int>(std::clamp(to, -1.0, static_cast<double>(count - 1)))};
}

void fill_faces(const MeshChart& chart, ChartRaster& raster) {
  for (std::uint32_t f = 0; f < chart.corners.size(); ++f) {
    const auto& t = chart.corners[f];
    const Double2 &a = chart.uv[t[0]], &b = chart.uv[t[1]], &c = chart.uv[t[2]];
    if (!(plane_area(a, b, c) > 0.0)) continue;
    const auto [y0, y1] =
        texel_range(std::min({a[1], b[1], c[1]}), std::max({a[1], b[1], c[1]}), raster, raster.height);
    const auto [x0, x1] =
        texel_range(std::min({a[0], b[0], c[0]}), std::max({a[0], b[0], c[0]}), raster, raster.width);
    for (int y = y0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x) {
        auto& what = raster.what[static_cast<std::size_t>(y) * static_cast<std::size_t>(raster.width) +
                                 static_cast<std::size_t>(x)];
        if (what != ChartRaster::kEmpty) continue;
        const Double2 p = centre_of(x, y, raster);
        if (plane_area(a, b, p) < 0.0 || plane_area(b, c, p) < 0.0 || plane_area(c, a, p) < 0.0) continue;
        what = f;
        ++raster.inside;
      }
  }
}

/// The nearest point of the segment a-b, as a share of it.
double foot_share(const Double2& p, const Double2& a, const Double2& b) {
  const double dx = b[0] - a[0], dy = b[1] - a[1], square = dx * dx + dy * dy;
  if (!(square > 0.0)) return 0.0;
  return std::clamp(((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square, 0.0, 1.0);
}

void fill_margin(const MeshChart& chart, ChartRaster& raster) {
  std::vector<float> nearest(raster.what.size(), std::numeric_limits<float>::infinity());
  const double reach =
      (raster.margin - 0.5) * raster.texel;  // 1.5 texels hold all that bilinear filtering sees
  EdgeFaces(chart.vertices.size(), chart.corners)
      .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
        if (half.size() == 2) return;
        for (const std::uint32_t h : half) {
          const auto& t = chart.corners[h / 3];
          const Double2 &a = chart.uv[t[h % 3]], &b = chart.uv[t[(h % 3 + 1) % 3]];
          const auto [y0, y1] =
              texel_range(std::min(a[1], b[1]) - reach, std::max(a[1], b[1]) + reach, raster, raster.height);
          for (int y = y0; y <= y1; ++y) {
            // Of a long edge only what lies near this row.
            double low = std::min(a[0], b[0]), high = std::max(a[0], b[0]);
            const double v = centre_of(0, y, raster)[1];
            if (std::fabs(b[1] - a[1]) > raster.texel) {
              const auto u_at = [&](double at) {
                const double share = std::clamp((at - a[1]) / (b[1] - a[1]), 0.0, 1.0);
                return a[0] + share * (b[0] - a[0]);
              };
              const double u0 = u_at(v - 1.5 * reach), u1 = u_at(v + 1.5 * reach);
              low = std::min(u0, u1), high = std::max(u0, u1);
            }
            const auto [x0, x1] = texel_range(low - reach, high + reach, raster, raster.width);
            for (int x = x0; x <= x1; ++x) {
              const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(raster.width) +
                                    static_cast<std::size_t>(x);
              if (raster.what[i] < ChartRaster::kMargin) continue;
              const Double2 p = centre_of(x, y, raster);
              const double s = foot_share(p, a, b);
              const double dx = p[0] - (a[0] + s * (b[0] - a[0])), dy = p[1] - (a[1] + s * (b[1] - a[1]));
              const double square = dx * dx + dy * dy;
              if (square > reach * reach || !(static_cast<float>(square) < nearest[i])) continue;
              nearest[i] = static_cast<float>(square);
              raster.what[i] = ChartRaster::kMargin | h;
            }
          }
        }
      });
}

}  // namespace

std::array<int, 2> raster_size(const MeshChart& chart, double texel, int margin) {
  const auto side = [&](double extent) {
    return std::max(1, static_cast<int>(std::ceil(extent / texel - 1e-9))) + 2 * margin;
  };
  return {side(chart.extent[0]), side(chart.extent[1])};
}

ChartRaster raster_chart(const MeshChart& chart, double texel, int margin) {
  ChartRaster raster;
  raster.texel = texel, raster.margin = margin;
  const auto [width, height] = raster_size(chart, texel, margin);
  raster.width = width, raster.height = height;
  raster.what.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), ChartRaster::kEmpty);
  fill_faces(chart, raster);
  fill_margin(chart, raster);
  return raster;
}

TexelPlace texel_place(const TriangleSpan& mesh, const MeshChart& chart, const ChartRaster& raster, int x,
                       int y, const FaceAcross& across) {
  const std::uint32_t what = raster.at(x, y);
  const Double2 p = centre_of(x, y, raster);
  TexelPlace place;
  const std::uint32_t f = what < ChartRaster::kMargin ? what : (what & ~ChartRaster::kMargin) / 3;
  place.face = chart.faces[f];
  const auto& face = mesh.faces[place.face];
  const std::array<Double3, 3> at = {mesh.positions[face[0]], mesh.positions[face[1]],
                                     mesh.positions[face[2]]};
  place.normal = unit_or_zero(triangle_normal(at[0], at[1], at[2]));
  const auto& t = chart.corners[f];
  if (what < ChartRaster::kMargin) {
    const Double2 &a = chart.uv[t[0]], &b = chart.uv[t[1]], &c = chart.uv[t[2]];
    const double whole = plane_area(a, b, c);
    place.weights = {plane_area(b, c, p) / whole, plane_area(c, a, p) / whole, plane_area(a, b, p) / whole};
    place.position = at[0] * place.weights[0] + at[1] * place.weights[1] + at[2] * place.weights[2];
    return place;
  }
  const std::uint32_t k = (what & ~ChartRaster::kMargin) % 3, l = (k + 1) % 3;
  const Double2 &a = chart.uv[t[k]], &b = chart.uv[t[l]];
  const double share = foot_share(p, a, b);
  place.weights[k] = 1.0 - share, place.weights[l] = share;
  const Double3 foot = at[k] * (1.0 - share) + at[l] * share;
  place.position = foot;
  const std::optional<Double3> third = across(place.face, k);
  const Double3 edge = at[l] - at[k];
  const double length = norm(edge), dx = b[0] - a[0], dy = b[1] - a[1],
               in_plane = std::sqrt(dx * dx + dy * dy);
  if (!third || !(length > 0.0) || !(in_plane > 0.0)) return place;
  const Double3 along = edge / length, beyond = *third - at[k];
  const Double3 outward = unit_or_zero(beyond - along * dot(beyond, along));
  const double ox = p[0] - (a[0] + share * dx), oy = p[1] - (a[1] + share * dy);
  const double out = std::max(0.0, (ox * dy - oy * dx) / in_plane), on = (ox * dx + oy * dy) / in_plane;
  place.position = foot + outward * out + along * (on * length / in_plane);
  const Double3 n = unit_or_zero(triangle_normal(at[l], at[k], *third));
  if (n != Double3{}) place.normal = n;
  return place;
}

}  // namespace tessera
