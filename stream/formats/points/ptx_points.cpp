#include "stream/formats/points/ptx_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "kernels/points/scan_pose.h"
#include "octree/error.h"
#include "octree/points.h"
#include "stream/formats/closed_file.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/points/grid_stream.h"
#include "stream/formats/points/point_records.h"
#include "stream/formats/points/pose_look.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

/// Numbers of the header lines after columns and rows.
constexpr std::array<int, 8> kHeaderNumbers = {3, 3, 3, 3, 4, 4, 4, 4};

struct Scan {
  std::uint64_t declared = 0;    ///< columns * rows
  std::uint64_t data_begin = 0;  ///< first point line
  std::uint64_t data_end = 0;    ///< header of the next scan, or end of the file
  std::uint64_t lines = 0;       ///< point lines found
  bool colour = false;
  std::uint64_t rows = 0;              ///< lines of a column, 0 where there is no grid to make normals of
  std::vector<std::uint64_t> columns;  ///< where each begins, in bytes
  Double3 position{};                  ///< of the scanner, as the header gives it
  std::array<double, 12> matrix{};     ///< rows: images of the axes, then the translation
  std::uint64_t header_rows = 0;       ///< as declared, whether there is a grid or not
  std::uint16_t sensor = kNoSensor;    ///< index into PointFileInfo::sensors

  /// Where the scanner stood by the header: its position, or the translation of the matrix where that is zero.
  Double3 scanner() const {
    const bool finite =
        std::all_of(position.begin(), position.end(), [](double v) { return std::isfinite(v); });
    return finite && position != Double3{} ? position : Double3{matrix[9], matrix[10], matrix[11]};
  }
  Double3 moved(const double* v) const {
    const auto& m = matrix;
    return {v[0] * m[0] + v[1] * m[3] + v[2] * m[6] + m[9], v[0] * m[1] + v[1] * m[4] + v[2] * m[7] + m[10],
            v[0] * m[2] + v[1] * m[5] + v[2] * m[8] + m[11]};
  }
};

/// A line of one whole number, which no point line is.
bool is_lone_count(std::string_view line, std::uint64_t& count) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  if (line.size() > 24) return false;  // most lines are points: decide by their length
  return take_count(line, count) && is_blank(line);
}

bool parse_header_line(std::string_view line, std::size_t index, Scan& scan) {
  for (int i = 0; i < kHeaderNumbers[index]; ++i) {
    double value = 0;
    if (!next_number(line, value)) return false;
    const auto column = static_cast<std::size_t>(i);
    if (index == 0) scan.position[column] = value;
    if (index >= 4 && column < 3) scan.matrix[3 * (index - 4) + column] = value;
  }
  return is_blank(line);
}

double determinant(const std::array<double, 12>& m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
         m[2] * (m[3] * m[7] - m[4] * m[6]);
}

bool is_zero(const double* v) {
  return v[0] == 0 && v[1] == 0 && v[2] == 0;
}

class PtxPoints final : public PointFile {
 public:
  PtxPoints(const ReadFile& file, const ReadOptions& options) : input_(file), options_(options) {
    info_.path = input_.path();
    info_.bytes = input_.size();
    info_.packed = true;
    layout_.line_end = detect_line_end(file);
    find_scans(file);
    info_.placeholders = true;
    info_.format = "PTX with " + std::to_string(scans_.size()) + (scans_.size() == 1 ? " scan" : " scans") +
                   input_.packed_words();
    info_.attributes.intensity = true;
    info_.attributes.intensity_16 = true;
    for (std::size_t i = 0; i < scans_.size(); ++i) {
      // Where lines are missing nobody knows which cells the others are.
      if (scans_[i].lines != scans_[i].declared) scans_[i].rows = 0;
      describe(scans_[i], i);
    }
    info_.attributes.sensor = !info_.sensors.empty();
    refused_.tell(scans_.size(), info_.warnings);
  }

  const PointFileInfo& info() const override { return info_; }

  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const override {
    if (!input_.packed().empty()) {  // in one go: what comes first must be unpacked first
      const std::uint64_t begin = scans_.front().data_begin;
      return even_slices(file, begin, input_.size(), 1, input_.slice_bytes(target_bytes));
    }
    std::vector<InputSlice> all;
    for (const Scan& scan : scans_) {
      for (const InputSlice& s : even_slices(file, scan.data_begin, scan.data_end, 1, target_bytes))
        all.push_back(s);
    }
    return all;
  }

  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    const auto after = std::upper_bound(scans_.begin(), scans_.end(), slice.begin,
                                        [](std::uint64_t at, const Scan& s) { return at < s.data_begin; });
    if (after == scans_.begin())
      throw InputError(input_.path().string() + ": a slice that starts in a header");
    ChunkSink out(options_.chunk_points, sink);
    ReadCounts counts;
    const ReadFile file = input_.open();
    // A scan without points starts where its successor's header does: the slice then is empty.
    auto scan = after - 1;
    const bool alone = input_.packed().empty();  // the slice lies within the scan
    LineLayout layout = layout_;
    layout.data_begin = scan->data_begin;
    std::uint64_t begin = slice.begin;
    std::uint64_t end = std::min(slice.end, input_.size());
    if (scan->rows > 0 && alone) {
      begin = scan->columns[first_column(*scan, slice.begin)];
      end = end_of_columns(*scan, slice.end);
    }
    LineReader reader(file, layout, begin, end, options_.release_cache);
    do {
      if (scan->rows > 0)
        read_grid(reader, *scan, slice, alone ? first_column(*scan, slice.begin) : 0,
                  alone ? end : scan->data_end, out, counts);
      else
        read_lines(reader, *scan, out, counts);
      if (slice.end >= scan->data_end && scan->declared > scan->lines)
        counts.missing += scan->declared - scan->lines;
    } while (++scan != scans_.end() && scan->data_begin < slice.end);
    out.flush();
    counts.points = out.points();
    return counts;
  }

 private:
  [[noreturn]] void fail(std::uint64_t line, const std::string& what) const {
    throw InputError(input_.path().string() + ": line " + std::to_string(line) + ": " + what);
  }

  void find_scans(const ReadFile& file) {
    LineReader reader(file, layout_, 0, input_.size(), options_.release_cache);
    std::string_view line;
    std::uint64_t number = 0;
    std::uint64_t columns = 0;
    PoseLook look;
    while (reader.next(line)) {
      ++number;
      if (is_lone_count(line, columns)) {
        if (!scans_.empty()) scans_.back().data_end = reader.line_offset(), judge(look);
        if (scans_.size() == kNoSensor) fail(number, "more than 65535 scans in one file; split it");
        read_header(reader, columns, number);
        look = PoseLook(scans_.back().scanner(), columns, scans_.back().header_rows);
      } else if (scans_.empty()) {
        if (!is_blank(line)) fail(number, "a PTX file starts with the number of columns");
      } else if (!is_blank(line)) {
        Scan& scan = scans_.back();
        if (scan.rows > 0 && scan.lines % scan.rows == 0) scan.columns.push_back(reader.line_offset());
        if (look.wants_next(scan.lines)) look_at(line, scan, look);
        if (++scan.lines == 1) scan.colour = count_fields(line) >= 7;
        if (!reader.complete() && !is_point(line)) --scan.lines;  // torn
      }
    }
    if (scans_.empty()) throw InputError(input_.path().string() + ": there is no PTX header");
    scans_.back().data_end = input_.size();
    judge(look);
  }

  static void look_at(std::string_view line, const Scan& scan, PoseLook& look) {
    double v[3];
    if (!next_number(line, v[0]) || !next_number(line, v[1]) || !next_number(line, v[2]) || is_zero(v))
      return;
    look.add(scan.lines, scan.moved(v));
  }

  /// The last scan is looked at: it has a sensor, unless its points tell that nobody stood there.
  void judge(PoseLook& look) {
    Scan& scan = scans_.back();
    const bool filled_in = scan.scanner() != Double3{};
    // Where lines are missing or too many, nobody knows which cells they are.
    const ScanPose pose = look.verdict(filled_in, scan.lines == scan.declared);
    if (pose == ScanPose::kHolds) {
      scan.sensor = static_cast<std::uint16_t>(info_.sensors.size());
      info_.sensors.push_back(scan.scanner());
      return;
    }
    scan.rows = 0;  // normals by rows and columns need the scanner
    scan.columns.clear();
    refused_.add(scans_.size(), pose, scan.scanner());
  }

  void read_header(LineReader& reader, std::uint64_t columns, std::uint64_t& number) {
    std::string_view line;
    const auto next = [&] {
      ++number;
      if (!reader.next(line)) fail(number, "the file ends within a PTX header; it is truncated");
    };
    Scan scan;
    std::uint64_t rows = 0;
    next();
    if (!is_lone_count(line, rows)) fail(number, "the second line of a PTX header is not the number of rows");
    scan.declared = columns == 0 || rows <= ~std::uint64_t{0} / columns ? columns * rows : ~std::uint64_t{0};
    for (std::size_t i = 0; i < kHeaderNumbers.size(); ++i) {
      next();
      if (!parse_header_line(line, i, scan)) {
        fail(number, "line " + std::to_string(i + 3) + " of a PTX header has " +
                         std::to_string(kHeaderNumbers[i]) + " numbers, not '" +
                         std::string(line.substr(0, 60)) + "'");
      }
    }
    const double volume = determinant(scan.matrix);
    const bool finite =
        std::all_of(scan.matrix.begin(), scan.matrix.end(), [](double v) { return std::isfinite(v); });
    if (!finite || !std::isfinite(volume) || volume == 0) {
      fail(number, "the matrix of this scan is no motion, so its points have no positions");
    }
    scan.data_begin = reader.next_offset();
    scan.header_rows = rows;
    if (options_.grid_normals && rows <= kMaxGridCells && columns > 1) scan.rows = rows;
    scans_.push_back(scan);
  }

  static int count_fields(std::string_view line) {
    int n = 0;
    while (n < 8 && skip_field(line)) ++n;
    return n;
  }

  static bool is_point(std::string_view line) {
    double value = 0;
    return next_number(line, value) && next_number(line, value) && next_number(line, value);
  }

  void describe(const Scan& scan, std::size_t index) {
    const double* origin = scan.matrix.data() + 9;
    const bool finite =
        std::all_of(scan.position.begin(), scan.position.end(), [](double v) { return std::isfinite(v); });
    const bool given = finite && !is_zero(scan.position.data());
    info_.attributes.colour = info_.attributes.colour || scan.colour;
    info_.attributes.normals = info_.attributes.normals || scan.rows > 0;
    info_.attributes.grid_normals = info_.attributes.normals;
    const std::uint64_t remaining = ~std::uint64_t{0} - info_.declared_points;
    info_.declared_points += std::min(remaining, scan.declared);
    const std::string name = "scan " + std::to_string(index + 1);
    if (scan.lines != scan.declared) {
      info_.warnings.push_back(name + ": the header declares " + std::to_string(scan.declared) +
                               " points, the file has " + std::to_string(scan.lines));
    }
    double apart = 0;
    double size = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      apart = std::max(apart, std::abs(scan.position[a] - origin[a]));
      size = std::max(size, std::abs(scan.position[a]));
    }
    if (given && !is_zero(origin) && apart > 1e-6 * size) {
      info_.warnings.push_back(
          name +
          ": the scanner position and the translation of the matrix differ; the position is "
          "taken for the sensor");
    }
  }

  enum class Line { kPoint, kEmpty, kTorn };

  /// Takes the point of a line, without a normal. \throws InputError for a line that is none
  Line take(const LineReader& reader, std::string_view line, const Scan& scan, PointChunk& chunk,
            ReadCounts& counts) const {
    const std::string_view whole = line;
    double v[3];
    if (!next_number(line, v[0]) || !next_number(line, v[1]) || !next_number(line, v[2])) {
      if (!reader.complete()) {
        counts.warnings.push_back(reader.torn_line());
        return Line::kTorn;  // missing: the index did not count it
      }
      throw InputError(reader.where() + ": '" + std::string(whole.substr(0, 60)) +
                       "' is not a point 'x y z intensity [r g b]'; correct or remove the line");
    }
    if (is_zero(v)) return Line::kEmpty;
    const Double3 p = scan.moved(v);
    chunk.x.push_back(p[0]), chunk.y.push_back(p[1]), chunk.z.push_back(p[2]);
    if (info_.attributes.sensor) chunk.sensor.push_back(scan.sensor);
    if (info_.attributes.colour) chunk.rgba.push_back(colour(line));
    if (options_.intensities) chunk.intensity.push_back(intensity(line));
    return Line::kPoint;
  }

  void read_lines(LineReader& reader, const Scan& scan, ChunkSink& out, ReadCounts& counts) const {
    std::string_view line;
    while (reader.next_offset() < scan.data_end && reader.next(line)) {
      if (reader.line_offset() < scan.data_begin || is_blank(line)) continue;  // its header
      const Line found = take(reader, line, scan, out.chunk(), counts);
      if (found == Line::kTorn) break;
      if (found == Line::kEmpty) {
        ++counts.empty;
        continue;
      }
      if (info_.attributes.normals) {  // of other scans
        PointChunk& chunk = out.chunk();
        chunk.nx.push_back(0), chunk.ny.push_back(0), chunk.nz.push_back(0);
      }
      out.added();
    }
  }

  /// Of the columns that a slice from this byte on needs.
  static std::size_t first_column(const Scan& scan, std::uint64_t byte) {
    const auto after = std::upper_bound(scan.columns.begin(), scan.columns.end(), byte);
    const auto in = static_cast<std::size_t>(after - scan.columns.begin());
    return in - std::min<std::size_t>(in, GridStream::kLinesAround + 1);
  }
  /// The byte behind the columns that a slice up to this byte needs.
  static std::uint64_t end_of_columns(const Scan& scan, std::uint64_t byte) {
    const auto at = std::lower_bound(scan.columns.begin(), scan.columns.end(), byte);
    const auto next = static_cast<std::uint64_t>(at - scan.columns.begin()) + GridStream::kLinesAround;
    return next < scan.columns.size() ? scan.columns[next] : scan.data_end;
  }

  /// The points of a slice with normals, which need columns around it.
  /// \param column  that the reader stands before  \param end  a byte at which a column ends
  void read_grid(LineReader& reader, const Scan& scan, const InputSlice& slice, std::size_t column,
                 std::uint64_t end, ChunkSink& out, ReadCounts& counts) const {
    GridStream stream(scan.scanner(), scan.rows, true, out);
    PointChunk one;
    std::string_view line;
    for (std::uint64_t n = column * scan.rows; reader.next_offset() < end && reader.next(line);) {
      if (reader.line_offset() < scan.data_begin || is_blank(line)) continue;  // its header
      const bool wanted = reader.line_offset() >= slice.begin && reader.line_offset() < slice.end;
      one.clear();
      const Line found = take(reader, line, scan, one, counts);
      if (found == Line::kTorn) break;
      stream.next(static_cast<std::int64_t>(n / scan.rows));
      if (found == Line::kPoint)
        stream.add(static_cast<std::int64_t>(n % scan.rows), one, 0, wanted);
      else
        counts.empty += wanted ? 1 : 0;
      ++n;
    }
    stream.finish(true);
  }

  /// Of the rest of a point line after x y z, 0..1; 0 if it has none.
  static std::uint16_t intensity(std::string_view rest) {
    double value = 0;
    if (!next_number(rest, value) || !(value > 0)) return 0;
    return static_cast<std::uint16_t>(std::min(value, 1.0) * 65535.0 + 0.5);
  }

  /// Of the rest of a point line after x y z; 0 if it has none.
  static std::uint32_t colour(std::string_view rest) {
    double intensity = 0;
    double c[3];
    if (!next_number(rest, intensity)) return 0;
    for (double& value : c) {
      if (!next_number(rest, value)) return 0;
    }
    return pack_rgb(colour_byte(c[0], ColourScale::kByte), colour_byte(c[1], ColourScale::kByte),
                    colour_byte(c[2], ColourScale::kByte));
  }

  ClosedFile input_;
  ReadOptions options_;
  PointFileInfo info_;
  LineLayout layout_;
  std::vector<Scan> scans_;  ///< ascending data_begin
  RefusedPoses refused_;
};

}  // namespace

bool looks_like_ptx(const ReadFile& file) {
  char bytes[4096];
  const std::uint64_t there = std::min<std::uint64_t>(file.size(), sizeof bytes);
  file.read_at(0, bytes, there);
  std::string_view text(bytes, static_cast<std::size_t>(there));
  const char end = text.find('\n') == std::string_view::npos ? '\r' : '\n';
  Scan scan;
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < 2 + kHeaderNumbers.size(); ++i) {
    const std::size_t at = text.find(end);
    if (at == std::string_view::npos) return false;
    const std::string_view line = text.substr(0, at);
    text.remove_prefix(at + 1);
    if (!(i < 2 ? is_lone_count(line, count) : parse_header_line(line, i - 2, scan))) return false;
  }
  return true;
}

std::unique_ptr<PointFile> open_ptx_points(const ReadFile& file, const ReadOptions& options) {
  return std::make_unique<PtxPoints>(file, options);
}

}  // namespace tessera
