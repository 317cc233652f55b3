/// \file chart_raster.h
/// Which texels show a chart, and where on the surface their centres lie.
///
/// Texel (i, j) has its centre at uv = texel * (i + 0.5 - margin, j + 0.5 - margin): the chart lies `margin` texels from the
/// sides. Around it a margin, half a texel narrower, continues the surface: across an edge that another face shares, in
/// the plane of that face (as if both were unfolded into one plane), so that texels on both sides of a seam see the same
/// surface and bilinear filtering shows no seam; where the surface ends, at its border.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "kernels/texture/charts.h"

namespace tessera {

struct ChartRaster {
  static constexpr std::uint32_t kEmpty = 0xffffffffu;
  static constexpr std::uint32_t kMargin = 0x80000000u;

  int width = 0, height = 0, margin = 0;
  double texel = 0.0;  ///< units of the mesh
  /// Per texel, rows of ascending v: index of a face of the chart that holds its centre; or kMargin and 3 face + corner of
  /// the edge of the border that is nearest; or kEmpty.
  std::vector<std::uint32_t> what;
  std::size_t inside = 0;  ///< texels with their centre in a face

  [[nodiscard]] std::uint32_t at(int x, int y) const {
    return what[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  }
  [[nodiscard]] bool is_inside(int x, int y) const { return at(x, y) < kMargin; }
};

/// Width and height of the raster of a chart.
[[nodiscard]] std::array<int, 2> raster_size(const MeshChart& chart, double texel, int margin);

/// \param texel  > 0, so that the chart has fewer than 2^15 texels a side \param margin  texels, >= 1
[[nodiscard]] ChartRaster raster_chart(const MeshChart& chart, double texel, int margin);

struct TexelPlace {
  Double3 position{};
  Double3 normal{};        ///< unit, or zero
  std::uint32_t face = 0;  ///< of the mesh; that of the border for a texel of the margin
  Double3 weights{};  ///< of the corners of `face`: of the texel, in the margin of the foot on the border
};

/// The third corner of the face across edge `corner` of a face of the mesh, none where the surface ends.
using FaceAcross = std::function<std::optional<Double3>(std::uint32_t face, std::uint32_t corner)>;

/// \pre  the texel is not empty
[[nodiscard]] TexelPlace texel_place(const TriangleSpan& mesh, const MeshChart& chart,
                                     const ChartRaster& raster, int x, int y, const FaceAcross& across);

}  // namespace tessera
