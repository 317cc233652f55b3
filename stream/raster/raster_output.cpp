#include "stream/raster/raster_output.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/fault.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/survey/gdal_program.h"

namespace tessera {
namespace {

/// What GDAL can count.
constexpr double kMaxSide = 2147483647.0;
/// Whole numbers of doubles: beyond them cells have no edges of their own.
constexpr double kMaxIndex = 0x1p52;

}  // namespace

CellRange::CellRange(double low, double high, double cell) {
  if (!(std::max(std::abs(low), std::abs(high)) / cell < kMaxIndex))
    throw UsageError(fmt::format("--cell {:g}: is too small for coordinates like {:.17g}", cell, high));
  first = std::floor(low / cell), end = std::ceil(high / cell);
  // A quotient may round across a whole number.
  while (first * cell > low) --first;
  while ((first + 1.0) * cell <= low) ++first;
  while (end * cell < high) ++end;
  while ((end - 1.0) * cell >= high) --end;
  end = std::max(end, first + 1.0);
}

RasterGrid::RasterGrid(const CellRange& x, const CellRange& y, double edge) : cell(edge) {
  if (!(x.end - x.first <= kMaxSide && y.end - y.first <= kMaxSide))
    throw UsageError(
        fmt::format("--cell {:g}: makes {:.3g} x {:.3g} cells, at most {:.3g} a side are possible", cell,
                    x.end - x.first, y.end - y.first, kMaxSide));
  west = x.first * cell, north = y.end * cell;
  columns = static_cast<std::int64_t>(x.end - x.first), rows = static_cast<std::int64_t>(y.end - y.first);
}

bool RasterGrid::inside(std::int64_t column, std::int64_t row, double min_x, double max_x, double min_y,
                        double max_y) const {
  const Double2 at = centre(column, row);
  return at[0] >= min_x && at[0] <= max_x && at[1] >= min_y && at[1] <= max_y;
}

/// A raw file that windows are written into, row by row of the whole raster.
class RasterFiles::RawFile {
 public:
  explicit RawFile(std::filesystem::path path)
      : path_(std::move(path)),
        fd_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666)) {
    if (fd_ < 0) throw_write_error(path_, errno);
  }
  ~RawFile() { ::close(fd_); }
  RawFile(const RawFile&) = delete;
  RawFile& operator=(const RawFile&) = delete;
  const std::filesystem::path& path() const { return path_; }
  void write_at(std::uint64_t offset, const char* from, std::uint64_t bytes) {
    fault_point(FaultPoint::kWrite);
    if (const int error = write_all_at(fd_, from, bytes, offset)) throw_write_error(path_, error);
  }

 private:
  std::filesystem::path path_;
  int fd_;
};

RasterFiles::RasterFiles(const RasterGrid& grid, const LayerSettings& settings,
                         const std::vector<RasterOutput>& outputs, const std::filesystem::path& scratch)
    : grid_(grid), settings_(settings), outputs_(outputs), scratch_(scratch) {
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    files_.push_back(std::make_unique<RawFile>(scratch / fmt::format("layer{}.raw", k)));
    totals_.emplace_back(outputs[k].layer, settings);
  }
}

RasterFiles::~RasterFiles() = default;

std::uint64_t RasterFiles::raw_bytes(std::uint64_t cells, const std::vector<RasterOutput>& outputs) {
  std::uint64_t bytes = 0;
  for (const RasterOutput& output : outputs) bytes += cells * LayerValues(output.layer, {}).bytes_per_cell();
  return bytes;
}

RasterReport RasterFiles::finish(const std::string& name, const RasterOptions& options) {
  RasterReport report;
  report.cell = grid_.cell, report.columns = grid_.columns, report.rows = grid_.rows;
  report.west = grid_.west, report.north = grid_.north;
  for (std::size_t k = 0; k < outputs_.size(); ++k) {
    report.values.push_back(totals_[k].count());
    if (report.values[k] == 0)
      throw EmptyError(fmt::format("{}: no cell of {:g} has a value of layer {}", name, grid_.cell,
                                   outputs_[k].name.empty() ? name_of(outputs_[k].layer) : outputs_[k].name));
  }
  for (std::size_t k = 0; k < outputs_.size(); ++k) {
    Json request = totals_[k].description();
    if (!outputs_[k].name.empty()) request["layer"] = outputs_[k].name;
    request["raw"] = json_text(files_[k]->path());
    request["columns"] = grid_.columns, request["rows"] = grid_.rows;
    request["west"] = grid_.west, request["north"] = grid_.north, request["cell"] = grid_.cell;
    request["valid_percent"] =
        100.0 * static_cast<double>(report.values[k]) / static_cast<double>(grid_.cells());
    request["crs"] = options.crs;
    const std::string warnings =
        write_by_gdal(scratch_, "raster", request, options.memory_bytes, outputs_[k].path);
    if (!warnings.empty()) report.warnings += warnings + "\n";
    std::filesystem::remove(files_[k]->path());
  }
  return report;
}

RasterRows::RasterRows(RasterFiles& files) : files_(files) {
  for (const RasterOutput& output : files.outputs_) values_.emplace_back(output.layer, files.settings_);
}

void RasterRows::write(std::size_t output, std::int64_t column, std::int64_t row, std::size_t cells) {
  const std::uint64_t bytes = values_[output].bytes_per_cell();
  const auto first = static_cast<std::uint64_t>(row * files_.grid_.columns + column);
  files_.files_[output]->write_at(first * bytes, bytes_.data(), cells * bytes);
}

void RasterRows::finish() {
  const std::lock_guard lock(files_.mutex_);
  for (std::size_t k = 0; k < values_.size(); ++k) files_.totals_[k].merge(values_[k]);
}

}  // namespace tessera
