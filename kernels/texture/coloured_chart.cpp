#include "kernels/texture/coloured_chart.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/triangle_foot.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr std::uint32_t kErrorSample = 8;  ///< one in so many points is compared with the texture

bool is_compared(const Double3& p, const ComparedPoints& points) {
  std::uint64_t bits = 0;
  for (std::size_t a = 0; a < 3; ++a)
    bits = mix(bits ^ static_cast<std::uint64_t>(
                          static_cast<std::int64_t>(std::floor((p[a] - points.low[a]) / points.spacing))));
  return bits % kErrorSample == 0;
}

std::array<int, 3> mixed_colour(const MeshBlock& block, const std::array<std::uint32_t, 3>& face,
                                const Double3& weights) {
  std::array<int, 3> rgb{};
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) sum += weights[k] * (block.rgba[face[k]] >> (8 * c) & 255u);
    rgb[c] = static_cast<int>(std::floor(std::clamp(sum, 0.0, 255.0) + 0.5));
  }
  return rgb;
}

std::uint32_t packed_rgb(const std::array<int, 3>& rgb) {
  return 0xff000000u | static_cast<std::uint32_t>(rgb[0]) | static_cast<std::uint32_t>(rgb[1]) << 8 |
         static_cast<std::uint32_t>(rgb[2]) << 16;
}

std::uint64_t squared_difference(const std::array<int, 3>& rgb, std::uint32_t rgba) {
  std::uint64_t sum = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const int d = rgb[c] - static_cast<int>(rgba >> (8 * c) & 255u);
    sum += static_cast<std::uint64_t>(d * d);
  }
  return sum;
}

}  // namespace

AcrossEdges::AcrossEdges(const MeshBlock& near) {
  for (const auto& f : near.faces)
    for (std::size_t k = 0; k < 3; ++k)
      edges_.push_back({near.key[f[k]], near.key[f[(k + 1) % 3]], near.position[f[(k + 2) % 3]]});
  std::sort(edges_.begin(), edges_.end(), less);
}

std::optional<Double3> AcrossEdges::third(std::uint64_t a, std::uint64_t b) const {
  const auto at = std::lower_bound(edges_.begin(), edges_.end(), Edge{a, b, {}}, less);
  if (at == edges_.end() || at->from != a || at->to != b) return std::nullopt;
  return at->third;
}

bool AcrossEdges::less(const Edge& a, const Edge& b) {
  return std::tie(a.from, a.to) < std::tie(b.from, b.to);
}

bool ColouredChart::sample(const Double2& uv, std::array<int, 3>& rgb) const {
  const double x = uv[0] / texel + margin - 0.5, y = uv[1] / texel + margin - 0.5;
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  if (i < 0 || j < 0 || i + 1 >= width || j + 1 >= height) return false;
  const double s = x - i, t = y - j;
  const std::array<double, 4> share = {(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t};
  Double3 sum{};
  for (std::size_t k = 0; k < 4; ++k) {
    const std::size_t at =
        static_cast<std::size_t>(j + static_cast<int>(k / 2)) * static_cast<std::size_t>(width) +
        static_cast<std::size_t>(i + static_cast<int>(k % 2));
    if (pixels[at] >> 24 == 0) return false;
    for (std::size_t c = 0; c < 3; ++c) sum[c] += share[k] * (pixels[at] >> (8 * c) & 255u);
  }
  for (std::size_t c = 0; c < 3; ++c) rgb[c] = static_cast<int>(std::floor(sum[c] + 0.5));
  return true;
}

FaceAcross ColourSource::across() const {
  return [this](std::uint32_t face, std::uint32_t k) {
    const auto& f = block.faces[face];
    return edges.third(block.key[f[(k + 1) % 3]], block.key[f[k]]);
  };
}

ColouredChart colour_chart(const ColourSource& from, MeshChart chart, double texel, int margin,
                           TexelCounts& counts) {
  const MeshBlock& block = from.block;
  const TriangleSpan mesh{block.position, block.faces};
  const FaceAcross across = from.across();
  ColouredChart done;
  done.chart = std::move(chart);
  done.texel = texel, done.margin = margin;
  const ChartRaster raster = raster_chart(done.chart, texel, margin);
  done.width = raster.width, done.height = raster.height;
  done.pixels.assign(raster.what.size(), 0);
  std::vector<PointColours::Near> scratch;
  for (int y = 0; y < raster.height; ++y)
    for (int x = 0; x < raster.width; ++x) {
      if (raster.at(x, y) == ChartRaster::kEmpty) continue;
      const TexelPlace place = texel_place(mesh, done.chart, raster, x, y, across);
      std::uint32_t& pixel =
          done.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(raster.width) +
                      static_cast<std::size_t>(x)];
      const bool found = from.points.find(place.position - from.origin, place.normal, pixel, scratch);
      if (!found && !block.rgba.empty())
        pixel = packed_rgb(mixed_colour(block, block.faces[place.face], place.weights));
      if (raster.is_inside(x, y)) ++counts.inside, counts.bare += !found;
    }
  return done;
}

ColourErrors compare_colours(const ColourSource& from, const MeshBlock& near,
                             std::span<const std::uint8_t> core, std::span<const ColouredChart> charts,
                             const ComparedPoints& points) {
  const MeshBlock& block = from.block;
  struct OfFace {
    std::uint32_t chart = 0, index = 0;
  };
  std::vector<OfFace> of_face(block.faces.size());
  for (std::uint32_t c = 0; c < charts.size(); ++c)
    for (std::uint32_t i = 0; i < charts[c].chart.faces.size(); ++i)
      of_face[charts[c].chart.faces[i]] = {c, i};
  // Faces of the core come in the order of the block.
  std::vector<std::uint32_t> in_block(near.faces.size(), 0);
  std::uint32_t next = 0;
  for (std::size_t f = 0; f < in_block.size(); ++f)
    if (core[f] != 0) in_block[f] = next++;
  const ClosestFaces closest(near.position, near.faces, from.origin);
  ColourErrors errors;
  std::vector<PointColours::Near> scratch;
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    const Double3 p = wide(points.position[i]);
    if (!is_compared(p + from.origin, points)) continue;
    const ClosestFaces::Hit hit =
        closest.closest(p, points.max_distance * points.max_distance, ClosestFaces::kNone);
    if (hit.slot == ClosestFaces::kNone) continue;
    const std::uint32_t face = closest.face(hit.slot);
    if (core[face] == 0) continue;
    const std::uint32_t f = in_block[face];
    const auto& t = block.faces[f];
    const Double3 a = block.position[t[0]] - from.origin, b = block.position[t[1]] - from.origin,
                  c = block.position[t[2]] - from.origin;
    const Double3 foot = foot_in_triangle(p, a, b, c).at;
    const Double3 n = triangle_normal(a, b, c);
    const double square = dot(n, n);
    if (!(square > 0.0)) continue;
    // Beside the surface rather than before or behind it: beyond its border.
    const double height = dot(p - foot, n);
    if (squared_distance(p, foot) - height * height / square > points.spacing * points.spacing) continue;
    const Double3 weights = {dot(triangle_normal(foot, b, c), n) / square,
                             dot(triangle_normal(foot, c, a), n) / square,
                             dot(triangle_normal(foot, a, b), n) / square};
    const ColouredChart& chart = charts[of_face[f].chart];
    const auto& corners = chart.chart.corners[of_face[f].index];
    Double2 uv{};
    // Corners of a chart go with those of the face.
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t d = 0; d < 2; ++d) uv[d] += weights[k] * chart.chart.uv[corners[k]][d];
    std::array<int, 3> seen{};
    if (!chart.sample(uv, seen)) continue;
    ++errors.points;
    errors.texture += squared_difference(seen, points.rgba[i]);
    std::uint32_t around = points.rgba[i];
    from.points.find(p, n / std::sqrt(square), around, scratch, static_cast<std::uint32_t>(i));
    errors.around +=
        squared_difference({static_cast<int>(around & 255u), static_cast<int>(around >> 8 & 255u),
                            static_cast<int>(around >> 16 & 255u)},
                           points.rgba[i]);
    if (!block.rgba.empty())
      errors.vertices += squared_difference(mixed_colour(block, t, weights), points.rgba[i]);
  }
  return errors;
}

double colour_psnr_db(std::uint64_t squares, std::uint64_t points) {
  const double mean = std::max(static_cast<double>(squares) / (3.0 * static_cast<double>(points)), 1e-3);
  return 10.0 * natural_log(255.0 * 255.0 / mean) / natural_log(10.0);
}

}  // namespace tessera
