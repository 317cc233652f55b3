#include "stream/change/change_raster.h"

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/path_text.h"
#include "stream/runtime/disk_space.h"
#include "stream/survey/gdal_program.h"

namespace tessera {
namespace {

constexpr std::size_t kPending = 1u << 14;
constexpr std::int64_t kMaxSideCells = 2147483647;  ///< what GDAL can count

LayerSettings change_settings(double max_distance) {
  LayerSettings settings;
  settings.low = -max_distance, settings.high = max_distance;
  return settings;
}

}  // namespace

ChangeRaster::ChangeRaster(const ChangeCells& cells, double max_distance,
                           const std::filesystem::path& scratch)
    : scratch_(scratch),
      raw_(scratch / "change.raw"),
      size_(cells.size()),
      west_(static_cast<double>(cells.low()[0]) * size_),
      north_(static_cast<double>(cells.high()[1] + 1) * size_),
      first_column_(cells.low()[0]),
      last_row_(cells.high()[1]),
      columns_(cells.high()[0] - cells.low()[0] + 1),
      rows_(cells.high()[1] - cells.low()[1] + 1),
      values_(RasterLayer::kTop, change_settings(max_distance)),
      file_(raw_) {
  if (columns_ > kMaxSideCells || rows_ > kMaxSideCells)
    throw UsageError(fmt::format("--cell {:g}: makes {} x {} cells, at most {} a side are possible", size_,
                                 columns_, rows_, kMaxSideCells));
  const std::uint64_t bytes =
      static_cast<std::uint64_t>(columns_) * static_cast<std::uint64_t>(rows_) * sizeof(float);
  require_disk(std::array{DiskNeed{scratch, 2 * bytes, "the raw raster"}}, kLargerDisk);
}

void ChangeRaster::flush() {
  const std::vector<std::uint8_t> inside(pending_.size(), 1);
  std::vector<char> bytes(pending_.size() * values_.bytes_per_cell());
  values_.put(pending_, inside, bytes.data());
  file_.write(bytes.data(), bytes.size());
  pending_.clear();
}

void ChangeRaster::put(double mean) {
  pending_.emplace_back();
  pending_.back().top = mean;
  ++next_;
  if (pending_.size() == kPending) flush();
}

void ChangeRaster::skip_to(std::uint64_t place) {
  while (next_ < place) put(-RasterCell::kNone);
}

void ChangeRaster::add(const ChangeCell& cell) {
  skip_to(static_cast<std::uint64_t>((last_row_ - cell.y) * columns_ + cell.x - first_column_));
  put(cell.mean);
}

std::string ChangeRaster::finish(const std::string& crs, std::uint64_t memory_bytes,
                                 const std::filesystem::path& output) {
  const std::uint64_t all = static_cast<std::uint64_t>(columns_) * static_cast<std::uint64_t>(rows_);
  skip_to(all);
  flush();
  file_.finish();
  Json request = values_.description();
  request["layer"] = "M3C2 distance";
  request["raw"] = json_text(raw_);
  request["columns"] = columns_, request["rows"] = rows_;
  request["west"] = west_, request["north"] = north_, request["cell"] = size_;
  request["valid_percent"] = 100.0 * static_cast<double>(values_.count()) / static_cast<double>(all);
  request["crs"] = crs;
  std::string warnings = write_by_gdal(scratch_, "raster", request, memory_bytes, output);
  std::filesystem::remove(raw_);
  return warnings;
}

}  // namespace tessera
