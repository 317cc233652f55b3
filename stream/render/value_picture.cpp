#include "stream/render/value_picture.h"

#include <algorithm>
#include <cmath>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/scratch_folder.h"
#include "stream/formats/points/point_writer.h"
#include "stream/render/render.h"
#include "stream/render/render_scene.h"
#include "stream/runtime/memory_budget.h"

namespace tessera {
namespace {

constexpr int kViewWidth = 800, kViewHeight = 600, kColumns = 2, kPageSamples = 2;
constexpr double kFlat = 0.2;  ///< of the longest side: what is less high is seen from above
constexpr std::size_t kWrittenCells = 16384;

/// Cells as a file of points, in colours.
void write_cells(const std::filesystem::path& path, const ValueMap& map, double scale) {
  PointFileHeader header;
  header.attributes.colour = true;
  header.double_positions = true;
  const auto encoder = make_point_encoder(path, header);
  const auto writer = create_point_file(path, header);
  PointChunk chunk;
  EncodedPoints encoded;
  for (std::size_t i = 0; i < map.cells.size(); ++i) {
    const ValueCell& cell = map.cells[i];
    chunk.x.push_back(cell.centre[0]), chunk.y.push_back(cell.centre[1]), chunk.z.push_back(cell.centre[2]);
    chunk.rgba.push_back(std::isnan(cell.mean) ? kNoValueColour : deviation_colour(cell.mean, scale, true));
    if (chunk.size() < kWrittenCells && i + 1 < map.cells.size()) continue;
    encoder->encode(chunk, {}, encoded);
    writer->append(encoded);
    chunk.clear();
  }
  writer->finish();
}

std::vector<std::string> views_of(const ValueMap& map) {
  Double3 low = map.cells.front().centre, high = low;
  for (const ValueCell& cell : map.cells)
    for (std::size_t a = 0; a < 3; ++a)
      low[a] = std::min(low[a], cell.centre[a]), high[a] = std::max(high[a], cell.centre[a]);
  const Double3 size = high - low;
  if (size[2] < kFlat * std::max(size[0], size[1])) return {"iso", "iso2", "front", "top"};
  return {"iso", "iso2", "front", "back", "top", "bottom"};
}

}  // namespace

ValuePicture draw_values(const ValueMap& map, double scale, std::uint64_t memory_bytes,
                         const std::filesystem::path& temp) {
  if (map.cells.empty()) throw EmptyError("there is no point to draw");
  const ScratchFolder scratch(temp, "picture");
  const std::filesystem::path cells = scratch.path() / "cells.ply";
  write_cells(cells, map, scale);
  RenderOptions options;
  options.inputs = {cells.string()};
  options.output = scratch.path() / "picture.png";
  options.temp = scratch.path();
  options.views = views_of(map);
  options.width = kViewWidth * kColumns;
  options.height = kViewHeight * static_cast<int>(options.views.size()) / kColumns;
  options.samples = kPageSamples;
  options.titles = false;
  for (std::size_t i = 0; i < map.worst.size(); ++i)
    options.marks.push_back({map.worst[i].at, std::to_string(i + 1)});
  // render() sees what is held.
  trim_allocator();
  options.memory_bytes = memory_bytes - memory_bytes / 32;
  const RenderReport drawn = render(options);
  return {read_text(options.output), drawn.notices};
}

}  // namespace tessera
