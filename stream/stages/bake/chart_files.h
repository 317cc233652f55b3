/// \file chart_files.h
/// Charts of a block on disk.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "kernels/texture/chart_packing.h"
#include "kernels/texture/charts.h"
#include "stream/files/packed_file.h"

namespace tessera {

struct ChartEntry {
  Section mesh, mask;
  std::uint32_t faces = 0, vertices = 0;
  std::uint32_t mask_width = 0, mask_height = 0, mask_cells = 0;
  std::uint32_t unfolded = 0, flipped = 0, overlapping = 0;
  double texel = 0.0;  ///< of this chart: coarser than that of the job where a page would be too small for it
  double surface = 0.0, plane = 0.0, stretch = 0.0;  ///< ChartStretch
  Double2 extent{};                                  ///< of the chart
};

/// Texels of a side of a cell of the masks.
inline constexpr int kMaskCell = 2;
/// Memory of growing, mapping and unfolding a face.
inline constexpr std::uint64_t kChartFaceBytes = 700;

std::filesystem::path chart_file(const std::filesystem::path& work, std::size_t block);

class ChartFileWriter {
 public:
  explicit ChartFileWriter(const std::filesystem::path& path);
  /// \pre fields of `entry` that are no sections are set
  void add(const MeshChart& chart, const ChartMask& mask, ChartEntry entry);
  std::uint64_t finish();

 private:
  PackedWriter writer_;
  std::vector<ChartEntry> table_;
};

class ChartFile {
 public:
  /// \param scale  of the texels of all charts, of which the entries tell then (masks are those that were written)
  explicit ChartFile(const std::filesystem::path& path, double scale = 1.0, int margin = 0);
  const std::vector<ChartEntry>& entries() const { return table_; }
  MeshChart load(std::size_t chart) const;
  ChartMask mask(std::size_t chart) const;

 private:
  PackedFile file_;
  std::vector<ChartEntry> table_;
};

}  // namespace tessera
