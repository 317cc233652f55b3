/// \file tile_texture.h
/// The picture of a tile: charts on one page, coloured from points (tile_points_stage.h).
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "kernels/texture/charts.h"
#include "kernels/texture/coloured_chart.h"
#include "stream/files/json.h"
#include "stream/stages/bake/texture_points.h"

namespace tessera {

inline constexpr std::uint32_t kTilePageSide = 2048;  ///< texels, of the largest page

struct TileTexture {
  /// Vertices of the tile, those where charts meet once for each: of the block, and where they lie on the page, in 65,535ths of
  /// its sides, v down as glTF has it.
  std::vector<std::uint32_t> vertex;
  std::vector<std::array<std::uint16_t, 2>> uv;
  std::vector<std::array<std::uint32_t, 3>> faces;  ///< those of the block, in their order
  std::string jpeg;
};

/// Sums over tiles.
struct TileTextureSums {
  TexelCounts texels;
  ColourErrors errors;
  ChartStretch stretch;
  std::uint64_t tiles = 0, charts = 0, page_texels = 0, bytes = 0;
  double shown = 0.0;        ///< texels of pages that show a face, by the areas of faces in the plane
  std::uint64_t coarse = 0;  ///< tiles with texels wider than asked for, since they fit no page
  double widest_texel = 0.0;

  void merge(const TileTextureSums& other);
  Json to_json() const;
  static TileTextureSums of_json(const Json& j);
  Json report() const;  ///< what people read
};

/// Texels are as wide as asked for, or up to a fifth less or more where pages are filled so; wider where the largest page would not
/// hold them.
/// \param texel  scan units \param spacing  of the points  \param sums  the tile is added
TileTexture make_tile_texture(const MeshBlock& block, const TexturePoints& points, double texel,
                              double spacing, TileTextureSums& sums);

/// Memory of make_tile_texture(). \param near_points  TexturePoints::count() with tile_texture_radius() around the block
std::uint64_t tile_texture_bytes(std::uint64_t faces, std::uint64_t near_points);
/// How far points may lie from the tile that they colour.
double tile_texture_radius(double spacing);

}  // namespace tessera
