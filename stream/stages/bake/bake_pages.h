/// \file bake_pages.h
/// Which chart lies where on which page.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/picture/picture.h"
#include "octree/vector.h"
#include "stream/stages/bake/chart_files.h"

namespace tessera {

struct BakePages {
  struct Size {
    std::uint32_t width = 0, height = 0;  ///< texels
  };
  /// Numbers of charts go through all blocks, in their order.
  std::vector<ChartSpot> spots;            ///< in cells of masks
  std::vector<std::uint64_t> first_chart;  ///< per block, one more at the end
  std::vector<Size> pages;
  double texel_scale = 1.0;  ///< of the texels that the charts were cut for (ChartFile)

  static BakePages of_work(const std::filesystem::path& work);
  /// Charts of a page, ascending.
  std::vector<std::uint64_t> charts_of(std::uint32_t page) const;
  std::size_t block_of(std::uint64_t chart) const;
  static constexpr std::uint64_t bytes_per_chart() { return sizeof(ChartSpot) + 8; }
};

/// Where a place of a chart lies on its page, from 0 to 1, v up. \param uv  units of the mesh, in the chart
Double2 page_uv(const ChartEntry& chart, const ChartSpot& spot, const BakePages::Size& page, int margin,
                const Double2& uv);
/// The texel of the page, rows of ascending v, that a texel of the chart's raster goes to.
std::size_t page_texel(const ChartEntry& chart, const ChartSpot& spot, const BakePages::Size& page,
                       std::uint32_t x, std::uint32_t y);

/// The picture of a page, top down. \param rgba  rows of ascending v
Image page_image(const std::vector<std::uint32_t>& rgba, const BakePages::Size& page);

/// "site_0.png", or "site_0.jpg", for page 0 of "site.obj".
std::string page_image_name(const std::filesystem::path& output, std::size_t page, bool jpeg);
std::string page_normals_name(const std::filesystem::path& output,
                              std::size_t page);  ///< "site_0_normal.png"
// Of the work directory.
std::string page_image_file(std::size_t page, bool jpeg);
std::string page_normals_file(std::size_t page);

}  // namespace tessera
