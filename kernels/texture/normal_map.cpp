#include "kernels/texture/normal_map.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "octree/vector.h"

namespace tessera {
namespace {

std::uint32_t packed_direction(const Double3& n) {
  std::uint32_t rgba = 0xff000000u;
  for (std::size_t k = 0; k < 3; ++k)
    rgba |= static_cast<std::uint32_t>(std::floor(std::clamp(0.5 * (n[k] + 1.0), 0.0, 1.0) * 255.0 + 0.5))
            << (8 * k);
  return rgba;
}

/// Along +u of the page, in the plane of the chart.
Double2 page_right(std::uint32_t turns) {
  constexpr std::array<Double2, 4> kRight = {{{1, 0}, {0, -1}, {-1, 0}, {0, 1}}};
  return kRight[turns % 4];
}

Double3 without_part(const Double3& v, const Double3& unit) {
  return v - unit * dot(v, unit);
}

}  // namespace

std::vector<Double3> star_normals(const MeshBlock& block, const MeshBlock& around) {
  std::vector<Double3> sum(around.position.size(), Double3{0, 0, 0});
  for (const auto& f : around.faces) {
    const Double3& a = around.position[f[0]];
    const Double3 n = cross(around.position[f[1]] - a, around.position[f[2]] - a);
    for (const std::uint32_t v : f) sum[v] = sum[v] + n;
  }
  std::vector<Double3> normals;
  normals.reserve(block.key.size());
  for (const std::uint64_t key : block.key) {
    const auto at = std::lower_bound(around.key.begin(), around.key.end(), key);
    const Double3& n = sum.at(static_cast<std::size_t>(at - around.key.begin()));
    const double length = norm(n);
    normals.push_back(length > 0.0 ? Double3{n[0] / length, n[1] / length, n[2] / length} : Double3{0, 0, 0});
  }
  return normals;
}

std::vector<Double3> chart_tangents(const TriangleSpan& mesh, const MeshChart& chart,
                                    std::span<const Double3> normal, std::uint32_t turns) {
  const Double2 right = page_right(turns);
  std::vector<Double3> tangent(chart.vertices.size(), Double3{});
  for (std::size_t i = 0; i < chart.faces.size(); ++i) {
    const auto& f = mesh.faces[chart.faces[i]];
    const auto& t = chart.corners[i];
    const Double2 &a = chart.uv[t[0]], &b = chart.uv[t[1]], &c = chart.uv[t[2]];
    const double whole = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if (!(whole > 0.0)) continue;
    const Double3 ab = mesh.positions[f[1]] - mesh.positions[f[0]],
                  ac = mesh.positions[f[2]] - mesh.positions[f[0]];
    // Along u and v of the chart; times the area in the plane, so that large faces count.
    const Double3 du = ab * (c[1] - a[1]) - ac * (b[1] - a[1]), dv = ac * (b[0] - a[0]) - ab * (c[0] - a[0]);
    const Double3 along = du * right[0] + dv * right[1];
    for (const std::uint32_t v : t) tangent[v] = tangent[v] + along;
  }
  for (std::size_t v = 0; v < tangent.size(); ++v) {
    const Double3& n = normal[chart.vertices[v]];
    const Double3 flat = unit_or_zero(without_part(tangent[v], n));
    tangent[v] = flat != Double3{} ? flat : any_orthogonal(n == Double3{} ? Double3{0, 0, 1} : n);
  }
  return tangent;
}

std::vector<std::uint32_t> normal_pixels(const ColourSource& from, const ColouredChart& chart,
                                         std::span<const Double3> normal, std::uint32_t turns) {
  const MeshBlock& block = from.block;
  const TriangleSpan mesh{block.position, block.faces};
  const std::vector<Double3> tangent = chart_tangents(mesh, chart.chart, normal, turns);
  const FaceAcross across = from.across();
  const ChartRaster raster = raster_chart(chart.chart, chart.texel, chart.margin);
  std::vector<std::uint32_t> pixels(raster.what.size(), 0);
  std::vector<PointColours::Near> scratch;
  const PointColours& directions = from.directions != nullptr ? *from.directions : from.points;
  for (int y = 0; y < raster.height; ++y)
    for (int x = 0; x < raster.width; ++x) {
      if (raster.at(x, y) == ChartRaster::kEmpty) continue;
      const TexelPlace place = texel_place(mesh, chart.chart, raster, x, y, across);
      const auto index = static_cast<std::size_t>(
          std::lower_bound(chart.chart.faces.begin(), chart.chart.faces.end(), place.face) -
          chart.chart.faces.begin());
      const auto& f = block.faces[place.face];
      const auto& t = chart.chart.corners[index];
      Double3 n{}, right{}, found{};
      for (std::size_t k = 0; k < 3; ++k)
        n = n + normal[f[k]] * place.weights[k], right = right + tangent[t[k]] * place.weights[k];
      n = unit_or_zero(n);
      right = unit_or_zero(without_part(right, n));
      Double3 seen = {0, 0, 1};
      if (directions.find_normal(place.position - from.origin, place.normal, found, scratch))
        seen = unit_or_zero(Double3{dot(found, right), dot(found, cross(n, right)), dot(found, n)});
      pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(raster.width) +
             static_cast<std::size_t>(x)] = packed_direction(seen);
    }
  return pixels;
}

}  // namespace tessera
