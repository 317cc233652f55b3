/// \file coloured_chart.h
/// Colours of the texels of a chart, and how far what a texture shows is from the points that it was made of.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "kernels/texture/chart_raster.h"
#include "kernels/texture/point_colours.h"

namespace tessera {

/// Corners across the edges of a block and what lies around it, by the keys of their ends.
class AcrossEdges {
 public:
  explicit AcrossEdges(const MeshBlock& near);
  /// Of the face that has the edge from a to b.
  std::optional<Double3> third(std::uint64_t a, std::uint64_t b) const;

 private:
  struct Edge {
    std::uint64_t from, to;
    Double3 third;
  };
  static bool less(const Edge& a, const Edge& b);
  std::vector<Edge> edges_;
};

struct ColouredChart {
  MeshChart chart;
  double texel = 0.0;  ///< units of the mesh
  int width = 0, height = 0, margin = 0;
  std::vector<std::uint32_t> pixels;  ///< r | g<<8 | b<<16 | a<<24, rows of ascending v; alpha 0: none

  /// Filtered as graphics hardware does. \param uv  units of the mesh \returns false where there is no colour
  bool sample(const Double2& uv, std::array<int, 3>& rgb) const;
};

/// Where colours of a block come from.
struct ColourSource {
  const MeshBlock& block;
  const AcrossEdges& edges;
  const PointColours& points;
  Double3 origin{};                          ///< of the points
  const PointColours* directions = nullptr;  ///< of normal maps, where these are other points
  FaceAcross across() const;
};

/// Texels with their centre in a face, and those of them that no point is near.
struct TexelCounts {
  std::uint64_t inside = 0, bare = 0;
};

/// Texels that no point is near have the colours of the vertices, if these have any. \param texel, margin  as raster_chart
ColouredChart colour_chart(const ColourSource& from, MeshChart chart, double texel, int margin,
                           TexelCounts& counts);

/// Squares of differences, summed over three channels.
struct ColourErrors {
  std::uint64_t points = 0, texture = 0, vertices = 0, around = 0;
};

/// Points that are compared with what the texture shows at their feet.
struct ComparedPoints {
  std::span<const Float3> position;  ///< from the origin of the source
  std::span<const std::uint32_t> rgba;
  double max_distance = 0.0;  ///< from the surface
  /// One in eight is compared, by the cell of the lattice that it lies in, whatever block looks at it.
  Double3 low{};
  double spacing = 1.0;
};

/// Points whose nearest face is of the block, not farther than a spacing beyond its border: against the texture, the colours of vertices, and the points around.
/// \param near, core  the block with the faces around it, and which are of the block, in its order
/// \param charts  of all faces of the block
ColourErrors compare_colours(const ColourSource& from, const MeshBlock& near,
                             std::span<const std::uint8_t> core, std::span<const ColouredChart> charts,
                             const ComparedPoints& points);

/// Peak signal to noise ratio. \param squares  over three channels \pre points > 0
double colour_psnr_db(std::uint64_t squares, std::uint64_t points);

}  // namespace tessera
