#include "stream/stages/bake/chart_files.h"

#include <algorithm>
#include <array>

#include "stream/files/task_files.h"
#include "stream/stages/bake/bake_stages.h"

namespace tessera {
namespace {

constexpr PackedKind kChartKind = {"TSCHART2", "a file of charts"};

}  // namespace

std::filesystem::path chart_file(const std::filesystem::path& work, std::size_t block) {
  return work / (kBakeCharts + task_file_stem(block) + ".tch");
}

ChartFileWriter::ChartFileWriter(const std::filesystem::path& path)
    : writer_(path, kChartKind, std::size_t{1} << 20) {}

void ChartFileWriter::add(const MeshChart& chart, const ChartMask& mask, ChartEntry entry) {
  entry.faces = static_cast<std::uint32_t>(chart.faces.size());
  entry.vertices = static_cast<std::uint32_t>(chart.vertices.size());
  entry.mask_width = mask.width, entry.mask_height = mask.height, entry.mask_cells = mask.cells;
  entry.unfolded = chart.unfolded ? 1 : 0;
  entry.extent = chart.extent;
  entry.mesh = writer_.append(
      {bytes_of(chart.faces), bytes_of(chart.vertices), bytes_of(chart.corners), bytes_of(chart.uv)});
  entry.mask = writer_.append(bytes_of(mask.bits));
  table_.push_back(entry);
}

std::uint64_t ChartFileWriter::finish() {
  return writer_.finish(table_);
}

ChartFile::ChartFile(const std::filesystem::path& path, double scale, int margin)
    : file_(path, kChartKind, sizeof(ChartEntry)) {
  file_.append_table(table_);
  if (scale == 1.0) return;
  for (ChartEntry& entry : table_) {
    MeshChart chart;
    chart.extent = entry.extent;
    entry.texel *= scale;
    const std::array<int, 2> size = raster_size(chart, entry.texel, margin);
    entry.mask_width = static_cast<std::uint32_t>((size[0] + kMaskCell - 1) / kMaskCell);
    entry.mask_height = static_cast<std::uint32_t>((size[1] + kMaskCell - 1) / kMaskCell);
  }
}

MeshChart ChartFile::load(std::size_t chart) const {
  const ChartEntry& e = table_.at(chart);
  MeshChart c;
  c.faces.resize(e.faces), c.vertices.resize(e.vertices), c.corners.resize(e.faces), c.uv.resize(e.vertices);
  file_.read(e.mesh, {buffer_of(c.faces), buffer_of(c.vertices), buffer_of(c.corners), buffer_of(c.uv)});
  for (const Double2& p : c.uv) c.extent = {std::max(c.extent[0], p[0]), std::max(c.extent[1], p[1])};
  c.unfolded = e.unfolded != 0;
  return c;
}

ChartMask ChartFile::mask(std::size_t chart) const {
  const ChartEntry& e = table_.at(chart);
  ChartMask m;
  m.width = e.mask_width, m.height = e.mask_height, m.cells = e.mask_cells;
  m.bits = file_.load<std::uint64_t>(e.mask);
  return m;
}

}  // namespace tessera
