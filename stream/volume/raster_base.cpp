#include "stream/volume/raster_base.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/formats/points/projection.h"
#include "stream/runtime/child_process.h"
#include "stream/survey/gdal_program.h"

namespace tessera {
namespace {

constexpr std::int64_t kBatch = 128;  ///< cells of a batch, along both axes

/// Unpacks the heights. \returns what tessera-gdal says of them
Json unpack_heights(const std::filesystem::path& raster, const std::filesystem::path& scratch,
                    std::uint64_t memory_bytes, std::string& warnings) {
  const ReadFile there(raster);  // says what is wrong with the file itself
  const std::filesystem::path request = scratch / "heights.json", result = scratch / "heights.raw",
                              info = scratch / "heights.info.json";
  write_durably(request, dump_json(Json{{"raster", json_text(std::filesystem::absolute(raster))},
                                        {"name", json_text(raster)},
                                        {"result", json_text(result)},
                                        {"info", json_text(info)}}));
  const ChildResult child =
      run_program(gdal_program(), {"heights", request.string(), "--memory", std::to_string(memory_bytes),
                                   "--driven", std::to_string(::getpid())});
  if (child.exit_code != 0) throw_child_failure(child, "tessera-gdal");
  there.require_unchanged();
  if (!child.message.empty()) warnings = child.message + "\n";
  return parse_json(read_text(info), info.string());
}

std::string crs_warning(const std::filesystem::path& raster, const std::string& of_raster,
                        const std::string& of_mesh) {
  if (of_raster.empty() || of_mesh.empty()) return {};
  const std::optional<bool> same =
      same_projection(user_crs(of_raster, raster.string()), user_crs(of_mesh, "the mesh"));
  if (same.value_or(true)) return {};
  return fmt::format(
      "warning: {}: is in another coordinate system than the mesh; coordinates are taken as they are\n",
      raster.string());
}

}  // namespace

RasterBase::RasterBase(const std::filesystem::path& raster, const std::string& crs, const Double3& origin,
                       const std::filesystem::path& scratch, std::uint64_t memory_bytes)
    : origin_(origin) {
  const Json info = unpack_heights(raster, scratch, memory_bytes, warnings_);
  columns_ = info.at("columns").get<std::int64_t>(), rows_ = info.at("rows").get<std::int64_t>();
  for (std::size_t k = 0; k < 6; ++k) transform_[k] = info.at("transform").at(k).get<double>();
  low_ = info.at("low").get<double>(), high_ = info.at("high").get<double>();
  warnings_ += crs_warning(raster, info.at("crs").get<std::string>(), crs);
  file_ = std::make_unique<ReadFile>(scratch / "heights.raw");
}

Double3 RasterBase::centre(std::int64_t column, std::int64_t row, double height) const {
  const double c = static_cast<double>(column) + 0.5, r = static_cast<double>(row) + 0.5;
  return {transform_[0] + c * transform_[1] + r * transform_[2] - origin_[0],
          transform_[3] + c * transform_[4] + r * transform_[5] - origin_[1], height - origin_[2]};
}

RasterBase::Range RasterBase::range_of(const MeshBox& window) const {
  // The inverse of the transform, at the corners of the window.
  const double det = transform_[1] * transform_[5] - transform_[2] * transform_[4];
  double low[2] = {PlanBox::kInfinite, PlanBox::kInfinite},
         high[2] = {-PlanBox::kInfinite, -PlanBox::kInfinite};
  for (int k = 0; k < 4; ++k) {
    const double x = ((k & 1) != 0 ? window.high[0] : window.low[0]) - transform_[0];
    const double y = ((k & 2) != 0 ? window.high[1] : window.low[1]) - transform_[3];
    const double at[2] = {(transform_[5] * x - transform_[2] * y) / det - 0.5,
                          (transform_[1] * y - transform_[4] * x) / det - 0.5};
    for (int a = 0; a < 2; ++a) low[a] = std::min(low[a], at[a]), high[a] = std::max(high[a], at[a]);
  }
  Range range{};
  const std::int64_t count[2] = {columns_ - 1, rows_ - 1};
  for (int a = 0; a < 2; ++a) {
    const auto most = static_cast<double>(count[a]);
    range.first[a] = static_cast<std::int64_t>(std::clamp(std::floor(low[a] - 1e-3), 0.0, most));
    range.end[a] = static_cast<std::int64_t>(std::clamp(std::ceil(high[a] + 1e-3), 0.0, most));
  }
  return range;
}

std::uint64_t RasterBase::window_bytes(const MeshBox& window) const {
  const Range range = range_of(window);
  std::uint64_t cells = 1;
  for (int a = 0; a < 2; ++a)
    cells *=
        static_cast<std::uint64_t>(std::clamp<std::int64_t>(range.end[a] - range.first[a], 0, kBatch) + 1);
  constexpr std::uint64_t kCellBytes = sizeof(double) + 2 * (sizeof(SpaceTriangle) + sizeof(PlanFace) +
                                                             2 * sizeof(std::vector<std::uint32_t>));
  return 2 * cells * kCellBytes;
}

void RasterBase::read_batch(const Range& range, std::vector<double>& heights,
                            std::vector<SpaceTriangle>& out) const {
  const std::int64_t width = range.end[0] - range.first[0] + 1, depth = range.end[1] - range.first[1] + 1;
  heights.resize(static_cast<std::size_t>(width * depth));
  for (std::int64_t r = 0; r < depth; ++r)
    file_->read_at(
        static_cast<std::uint64_t>((range.first[1] + r) * columns_ + range.first[0]) * sizeof(double),
        &heights[static_cast<std::size_t>(r * width)], static_cast<std::uint64_t>(width) * sizeof(double));
  out.clear();
  for (std::int64_t r = 0; r + 1 < depth; ++r)
    for (std::int64_t c = 0; c + 1 < width; ++c) {
      // Around the cell: along the row, then along the next one back.
      std::array<Double3, 4> corner;
      std::array<bool, 4> there{};
      for (std::size_t k = 0; k < 4; ++k) {
        const std::int64_t x = c + (k == 1 || k == 2 ? 1 : 0), y = r + (k >= 2 ? 1 : 0);
        const double h = heights[static_cast<std::size_t>(y * width + x)];
        there[k] = std::isfinite(h);
        corner[k] = centre(range.first[0] + x, range.first[1] + y, there[k] ? h : origin_[2]);
      }
      if (there[0] && there[2]) {
        if (there[1]) out.push_back({corner[0], corner[2], corner[1]});
        if (there[3]) out.push_back({corner[0], corner[3], corner[2]});
      } else if (there[1] && there[3] && (there[0] || there[2])) {
        out.push_back({corner[1], there[0] ? corner[0] : corner[3], there[0] ? corner[3] : corner[2]});
      }
    }
  // Counter-clockwise where rows run south; of rasters that are mirrored they show down otherwise.
  if (transform_[1] * transform_[5] - transform_[2] * transform_[4] > 0.0)
    for (SpaceTriangle& t : out) std::swap(t[1], t[2]);
}

void RasterBase::for_triangles(const MeshBox& window, const Use& use) const {
  const Range range = range_of(window);
  std::vector<double> heights;
  std::vector<SpaceTriangle> triangles;
  for (std::int64_t y = range.first[1]; y < range.end[1]; y += kBatch)
    for (std::int64_t x = range.first[0]; x < range.end[0]; x += kBatch) {
      read_batch({{x, y}, {std::min(x + kBatch, range.end[0]), std::min(y + kBatch, range.end[1])}}, heights,
                 triangles);
      if (!triangles.empty()) use(triangles);
    }
}

}  // namespace tessera
