#include "stream/stages/tiles/tile_texture.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/picture/picture.h"
#include "kernels/texture/chart_packing.h"
#include "kernels/texture/page_fill.h"
#include "stream/render/jpeg_file.h"
#include "stream/stages/bake/bake_pages.h"

namespace tessera {
namespace {

constexpr int kTileMargin = 2;           ///< texels
constexpr int kTileQuality = 85;         ///< of JPEG
constexpr double kRadiusSpacings = 8.0;  ///< as of baked textures
constexpr double kPageFill = 0.85;    ///< of a page, what charts with their margins take where all goes well
constexpr double kCoarserArea = 1.3;  ///< texels may be so much wider, in area, where that saves half a page
constexpr double kCoarserTexel = 1.25;   ///< from here on texels count as wider than asked for
constexpr double kFirstFill = 0.9;       ///< what is tried first
constexpr double kNextTexel = 1.02;      ///< what is tried next is so much wider
constexpr double kTightestMasks = 0.95;  ///< fuller pages are not tried
constexpr double kChartShare = 0.2;  ///< of the side of a square as large as the tile: charts grow no wider
constexpr double kWidestChartTexels = 256.0, kLeastChartTexels = 48.0;
constexpr std::uint32_t kLeastPageSide = 32;  ///< texels

/// \param texels  of charts with their margins
PageSize page_for(double texels) {
  PageSize page{kLeastPageSide, kLeastPageSide};
  while (kPageFill * page.width * page.height < texels / kCoarserArea && page.width < kTilePageSide) {
    if (page.height == page.width)
      page.height *= 2;
    else
      page.width *= 2;
  }
  return page;
}

/// Charts as they are packed.
struct PlacedCharts {
  std::vector<ChartEntry> entries;
  std::vector<ChartSpot> spots;
};
struct MaskedCharts {
  std::vector<ChartEntry> entries;
  std::vector<ChartMask> masks;
  double texels = 0.0;  ///< that masks take
};

/// \param page_side  texels: no chart gets larger
MaskedCharts mask_charts(const std::vector<MeshChart>& charts, double page_side, double texel) {
  MaskedCharts masked;
  // Whole cells of the page, margins taken off.
  const double room = page_side - 2.0 * kTileMargin - 1.0;
  for (const MeshChart& chart : charts) {
    ChartEntry entry;
    entry.texel = texel;
    while (std::max(chart.extent[0], chart.extent[1]) > room * entry.texel) entry.texel *= 1.25;
    masked.masks.push_back(chart_mask(raster_chart(chart, entry.texel, kTileMargin), kMaskCell));
    entry.mask_width = masked.masks.back().width, entry.mask_height = masked.masks.back().height;
    masked.texels += static_cast<double>(masked.masks.back().cells) * kMaskCell * kMaskCell;
    masked.entries.push_back(entry);
  }
  return masked;
}

/// Charts on a page of this size, with the finest texels that are found to fit. \param texel  where the search begins; then that found
PlacedCharts place_charts(const std::vector<MeshChart>& charts, const PageSize& page, double& texel) {
  const double area = static_cast<double>(page.width) * page.height;
  const PageSize in_cells{page.width / kMaskCell, page.height / kMaskCell};
  while (true) {
    MaskedCharts masked = mask_charts(charts, page.width, texel);
    if (masked.texels > kTightestMasks * area) {
      texel *= std::max(kNextTexel, std::sqrt(masked.texels / (kFirstFill * area)));
      continue;
    }
    if (auto spots = pack_on_page(masked.masks, in_cells))
      return {std::move(masked.entries), std::move(*spots)};
    texel *= kNextTexel;
  }
}

std::string page_jpeg(const std::vector<ColouredChart>& charts, const PlacedCharts& placed,
                      const PageSize& page) {
  const BakePages::Size size{page.width, page.height};
  std::vector<std::uint32_t> rgba(std::size_t{page.width} * page.height, 0);
  for (std::size_t c = 0; c < charts.size(); ++c)
    for (int y = 0; y < charts[c].height; ++y)
      for (int x = 0; x < charts[c].width; ++x) {
        const std::uint32_t pixel =
            charts[c].pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(charts[c].width) +
                             static_cast<std::size_t>(x)];
        if (pixel >> 24 != 0)
          rgba[page_texel(placed.entries[c], placed.spots[c], size, static_cast<std::uint32_t>(x),
                          static_cast<std::uint32_t>(y))] = pixel;
      }
  fill_page(rgba, page.width, page.height);
  return jpeg_bytes(page_image(rgba, size), kTileQuality);
}

}  // namespace

TileTexture make_tile_texture(const MeshBlock& block, const TexturePoints& points, double texel,
                              double spacing, TileTextureSums& sums) {
  const TriangleSpan mesh{block.position, block.faces};
  double area = 0.0;
  MeshBox box{block.position.at(0), block.position.at(0)};
  for (const Double3& p : block.position)
    for (std::size_t k = 0; k < 3; ++k)
      box.low[k] = std::min(box.low[k], p[k]), box.high[k] = std::max(box.high[k], p[k]);
  for (const auto& f : block.faces)
    area += 0.5 * norm(triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]));
  if (!(area > 0.0)) area = texel * texel;
  ChartOptions options;
  options.max_extent =
      std::clamp(kChartShare * std::sqrt(area) / texel, kLeastChartTexels, kWidestChartTexels) * texel;
  const std::vector<MeshChart> charts = make_charts(mesh, options);
  TileTextureSums own;
  for (const MeshChart& chart : charts) own.stretch.merge(measure_stretch(mesh, chart));
  const double asked = mask_charts(charts, kTilePageSide, texel).texels;
  const PageSize page = page_for(asked);
  double fitted = texel * std::sqrt(asked / (kFirstFill * page.width * page.height));
  const PlacedCharts placed = place_charts(charts, page, fitted);

  const Double3 origin = (box.low + box.high) * 0.5;
  const double radius = tile_texture_radius(spacing);
  const TexturePointBlock near = points.load(grown(box, radius), origin);
  const PointColours colours(near.position, near.rgba, near.normal, {spacing, radius, 8});
  const AcrossEdges edges(block);
  const ColourSource from{block, edges, colours, origin};
  std::vector<ColouredChart> coloured;
  for (std::size_t c = 0; c < charts.size(); ++c)
    coloured.push_back(colour_chart(from, charts[c], placed.entries[c].texel, kTileMargin, own.texels));
  const std::vector<std::uint8_t> core(block.faces.size(), 1);
  own.errors = compare_colours(from, block, core, coloured,
                               {near.position, near.rgba, radius, points.cells().low, spacing});

  TileTexture out;
  out.faces.resize(block.faces.size());
  const BakePages::Size size{page.width, page.height};
  for (std::size_t c = 0; c < charts.size(); ++c) {
    const auto first = static_cast<std::uint32_t>(out.vertex.size());
    for (std::size_t v = 0; v < charts[c].vertices.size(); ++v) {
      out.vertex.push_back(charts[c].vertices[v]);
      const Double2 at = page_uv(placed.entries[c], placed.spots[c], size, kTileMargin, charts[c].uv[v]);
      const auto steps = [](double share) {
        return static_cast<std::uint16_t>(std::floor(std::clamp(share, 0.0, 1.0) * 65535.0 + 0.5));
      };
      out.uv.push_back({steps(at[0]), steps(1.0 - at[1])});
    }
    for (std::size_t i = 0; i < charts[c].faces.size(); ++i)
      for (std::size_t k = 0; k < 3; ++k) out.faces[charts[c].faces[i]][k] = first + charts[c].corners[i][k];
    own.shown += measure_stretch(mesh, charts[c]).plane / (placed.entries[c].texel * placed.entries[c].texel);
  }
  out.jpeg = page_jpeg(coloured, placed, page);
  own.tiles = 1, own.charts = charts.size();
  own.page_texels = std::uint64_t{page.width} * page.height;
  own.bytes = out.jpeg.size();
  own.coarse = fitted > texel * kCoarserTexel ? 1 : 0;
  own.widest_texel = fitted;
  sums.merge(own);
  return out;
}

double tile_texture_radius(double spacing) {
  return kRadiusSpacings * spacing;
}

std::uint64_t tile_texture_bytes(std::uint64_t faces, std::uint64_t near_points) {
  // Growing and unfolding charts, edges and the tree of faces; points with their cells; the largest page thrice, with its picture,
  // its rasters and masks.
  constexpr std::uint64_t kTexturedFaceBytes = kChartFaceBytes + 500, kPageTexelBytes = 36;
  return faces * kTexturedFaceBytes +
         near_points * (TexturePoints::bytes_per_point() + PointColours::bytes_per_point()) +
         std::uint64_t{kTilePageSide} * kTilePageSide * kPageTexelBytes / 4 + (std::uint64_t{4} << 20);
}

void TileTextureSums::merge(const TileTextureSums& other) {
  texels.inside += other.texels.inside, texels.bare += other.texels.bare;
  errors.points += other.errors.points, errors.texture += other.errors.texture;
  errors.vertices += other.errors.vertices, errors.around += other.errors.around;
  stretch.merge(other.stretch);
  tiles += other.tiles, charts += other.charts, page_texels += other.page_texels, bytes += other.bytes;
  shown += other.shown;
  coarse += other.coarse;
  widest_texel = std::max(widest_texel, other.widest_texel);
}

Json TileTextureSums::to_json() const {
  return Json{{"texels", {texels.inside, texels.bare}},
              {"errors", {errors.points, errors.texture, errors.vertices, errors.around}},
              {"stretch", {stretch.surface, stretch.plane, stretch.stretch}},
              {"counts", {tiles, charts, page_texels, bytes, coarse}},
              {"shown", shown},
              {"widest", widest_texel}};
}

TileTextureSums TileTextureSums::of_json(const Json& j) {
  const auto count = [&](const char* key, std::size_t i) { return j.at(key)[i].get<std::uint64_t>(); };
  TileTextureSums s;
  s.texels = {count("texels", 0), count("texels", 1)};
  s.errors = {count("errors", 0), count("errors", 1), count("errors", 2), count("errors", 3)};
  const Json& stretch = j.at("stretch");
  s.stretch = {stretch[0].get<double>(), stretch[1].get<double>(), stretch[2].get<double>()};
  s.tiles = count("counts", 0), s.charts = count("counts", 1), s.page_texels = count("counts", 2);
  s.bytes = count("counts", 3), s.coarse = count("counts", 4);
  s.shown = j.at("shown").get<double>(), s.widest_texel = j.at("widest").get<double>();
  return s;
}

Json TileTextureSums::report() const {
  Json out = {{"pages", tiles},
              {"page_texels", page_texels},
              {"texels", texels.inside},
              {"without_points", texels.bare},
              {"used_share", page_texels > 0 ? shown / static_cast<double>(page_texels) : 0.0},
              {"charts", charts},
              {"stretch_l2", stretch.l2()},
              {"bytes", bytes},
              {"widest_texel", widest_texel},
              {"pages_with_coarser_texels", coarse}};
  if (errors.points > 0) {
    out["psnr_db"] = colour_psnr_db(errors.texture, errors.points);
    out["vertex_colours_psnr_db"] = colour_psnr_db(errors.vertices, errors.points);
  }
  return out;
}

}  // namespace tessera
