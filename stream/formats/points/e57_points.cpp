#include "stream/formats/points/e57_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "octree/error.h"
#include "octree/points.h"
#include "octree/portable_math.h"
#include "stream/formats/closed_file.h"
#include "stream/formats/e57/e57_packets.h"
#include "stream/formats/e57/e57_pages.h"
#include "stream/formats/e57/e57_scans.h"
#include "stream/formats/e57/e57_values.h"
#include "stream/formats/points/grid_stream.h"
#include "stream/formats/points/point_records.h"
#include "stream/formats/points/pose_look.h"

namespace tessera {

namespace {

constexpr std::size_t kReadAhead = 512;        ///< pages
constexpr std::size_t kDecodedRecords = 1024;  ///< records decoded at a time, so that they stay in the cache
constexpr std::size_t kRead = static_cast<std::size_t>(E57Use::kUses);
constexpr std::uint64_t kLooked = 4096;     ///< records that tell whether rows or columns are lines
constexpr std::uint64_t kPoseWindows = 32;  ///< places of a scan at which its pose is checked

/// Bytes between marks: a megabyte, for huge files so many that there are about 16384 marks.
std::uint64_t mark_spacing(std::uint64_t file_bytes) {
  return std::max(std::uint64_t{1} << 20, file_bytes >> 14);
}

/// The use that comes `i` places later: y and z after x.
constexpr E57Use after(E57Use first, std::size_t i) {
  return static_cast<E57Use>(static_cast<std::size_t>(first) + i);
}

/// Rotation, then translation.
struct Motion {
  std::array<double, 9> rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< rows
  Double3 translation{};

  Double3 rotated(const Double3& p) const {
    const auto& r = rotation;
    return {r[0] * p[0] + r[1] * p[1] + r[2] * p[2], r[3] * p[0] + r[4] * p[1] + r[5] * p[2],
            r[6] * p[0] + r[7] * p[1] + r[8] * p[2]};
  }
};

/// How one component of a colour becomes 0..255.
struct ColourRange {
  double low = 0.0;
  double factor = 1.0;
  ColourScale scale = ColourScale::kByte;
  std::uint32_t byte(double value) const { return colour_byte((value - low) * factor, scale); }
};

/// By the limits of the scan, else by those of the field; floats without either are 0..1.
ColourRange colour_range(double low, double high, const E57Field& field) {
  if (!std::isfinite(low) || !std::isfinite(high) || !(high > low)) {
    low = field.min_value;
    high = field.max_value;
  }
  if (!(high > low)) return {0.0, 1.0, ColourScale::kUnit};
  if (high - low == 255.0) return {low, 1.0, ColourScale::kByte};
  if (high - low == 65535.0) return {low, 1.0, ColourScale::kHighByte};
  return {low, 1.0 / (high - low), ColourScale::kUnit};
}

/// Whole numbers of 16 bits stay; all else is stretched from the limits of the scan, or of the field, to them.
struct IntensityRange {
  double low = 0.0, factor = 65535.0;
  std::uint16_t word(double value) const {
    const double v = (value - low) * factor;
    return v > 0.0 ? static_cast<std::uint16_t>(std::min(v, 65535.0) + 0.5) : std::uint16_t{0};
  }
};
IntensityRange intensity_range(double low, double high, const E57Field& field) {
  const bool whole = field.code == E57Code::kInteger;
  if (whole && field.min_value >= 0.0 && field.max_value <= 65535.0) return {0.0, 1.0};
  if (!std::isfinite(low) || !std::isfinite(high) || !(high > low)) {
    low = field.min_value;
    high = field.max_value;
  }
  if (!(high > low) || !std::isfinite(high - low)) return {};  // 0..1
  return {low, 65535.0 / (high - low)};
}

/// A scan, ready to be read.
struct Part {
  E57Section section;
  std::uint64_t first;           ///< its first record among those of all scans
  std::vector<E57Field> fields;  ///< those that are read
  Motion motion;
  bool moved = false;  ///< the motion is not the identity
  std::uint16_t sensor = kNoSensor;
  std::array<ColourRange, 3> colours;
  IntensityRange intensities;
  /// Its records lie line by line: normals come from them. The field of lines, of cells, and how many a line has.
  bool grid = false;
  E57Use line = E57Use::kColumn, cell = E57Use::kRow;
  std::uint64_t cells = 0;
  std::array<bool, kRead> has{};

  bool with(E57Use use) const { return has[static_cast<std::size_t>(use)]; }
  bool normals() const { return with(E57Use::kNormalX); }
  bool coloured() const { return with(E57Use::kRed); }
  bool echoes() const { return with(E57Use::kReturn); }
  bool intense() const { return with(E57Use::kIntensity); }
};

/// Decoded values of a block of records, by use.
class Block {
 public:
  Block() : values_(kRead * kDecodedRecords), bytes_(kDecodedRecords * 8 + 8 + kE57Slack) {}
  double* operator[](E57Use use) { return values_.data() + static_cast<std::size_t>(use) * kDecodedRecords; }

  /// Records [first, first + count) of a part; cursors as the section's columns are.
  void decode(const Part& part, E57Packets& packets, std::vector<E57Cursor>& cursors, std::uint64_t first,
              std::size_t count) {
    std::size_t column = 0;
    for (const E57Field& field : part.fields) {
      const std::uint64_t begin = first * field.bits;
      const std::uint64_t end = (first + count) * field.bits;
      if (field.bits > 0) {
        cursors[column++].read(packets, begin / 8, bytes_.data(),
                               static_cast<std::size_t>((end + 7) / 8 - begin / 8));
      }
      unpack_e57(field, bytes_.data(), static_cast<unsigned>(begin % 8), count, (*this)[field.use]);
    }
  }

 private:
  std::vector<double> values_;
  std::vector<char> bytes_;
};

class E57Points final : public PointFile {
 public:
  E57Points(const ReadFile& file, const ReadOptions& options) : input_(file), options_(options) {
    const E57Header header = read_e57_header(file);
    E57Pages pages(file, 1);
    const E57Scans all = read_e57_scans(pages, header);
    info_.path = input_.path();
    info_.placeholders = true;
    info_.format = "E57 with " + std::to_string(all.count) + (all.count == 1 ? " scan" : " scans");
    info_.bytes = input_.size();
    if (!header.warning.empty()) info_.warnings.push_back(header.warning);
    for (const E57Scan& scan : all.scans) add(scan, pages);
    refused_.tell(all.scans.size(), info_.warnings);
    declare_bounds(all.scans);
  }

  const PointFileInfo& info() const override { return info_; }

  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const override {
    const std::uint64_t record =
        std::max<std::uint64_t>(1, input_.size() / std::max<std::uint64_t>(1, records_));
    return even_slices(file, 0, records_, record, target_bytes);
  }

  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    ChunkSink out(options_.chunk_points, sink);
    ReadCounts counts;
    const std::uint64_t end = std::min(slice.end, records_);
    const std::uint64_t begin = std::min(slice.begin, end);
    const ReadFile file = input_.open();
    E57Pages pages(file, kReadAhead, options_.release_cache);
    Block block;
    auto part = std::upper_bound(parts_.begin(), parts_.end(), begin,
                                 [](std::uint64_t at, const Part& p) { return at < p.first; });
    for (std::uint64_t at = begin; at < end; ++part) {
      const Part& here = *(part - 1);
      const std::uint64_t stop = std::min(end - here.first, here.section.records());
      if (here.grid)
        read_grid(here, at - here.first, stop, pages, block, out, counts.empty);
      else
        read_records(here, at - here.first, stop, pages, block, out, counts.empty);
      at = here.first + stop;
    }
    out.flush();
    file.require_unchanged();
    counts.points = out.points();
    if (slice.end >= records_) counts.missing = missing_;
    return counts;
  }

 private:
  [[noreturn]] void fail(const E57Scan& scan, const std::string& what) const {
    throw InputError(input_.path().string() + ": scan " + std::to_string(scan.number) + ": " + what);
  }

  void add(const E57Scan& scan, E57Pages& pages) {
    const auto all = [&](E57Use first) {
      for (std::size_t i = 0; i < 3; ++i) {
        if (!scan.find(after(first, i))) return false;
      }
      return true;
    };
    std::vector<E57Field> fields;
    const auto take = [&](E57Use first, int count) {
      for (int i = 0; i < count; ++i) {
        if (const E57Field* f = scan.find(static_cast<E57Use>(static_cast<int>(first) + i)))
          fields.push_back(*f);
      }
    };
    const bool cartesian = all(E57Use::kX);
    if (!cartesian && !all(E57Use::kRange)) {
      fail(scan,
           "its records have neither cartesianX, Y and Z nor sphericalRange, Azimuth and Elevation, so " +
               std::to_string(scan.declared) + " points have no positions");
    }
    take(cartesian ? E57Use::kX : E57Use::kRange, 3);
    take(cartesian ? E57Use::kCartesianState : E57Use::kSphericalState, 1);
    if (all(E57Use::kNormalX)) take(E57Use::kNormalX, 3);
    if (all(E57Use::kRed)) {
      take(E57Use::kRed, 3);
      take(E57Use::kColourState, 1);
    }
    if (scan.find(E57Use::kReturn) && scan.find(E57Use::kReturns)) take(E57Use::kReturn, 2);
    if (options_.intensities) take(E57Use::kIntensity, 1);
    if (options_.grid_normals && !all(E57Use::kNormalX)) take(E57Use::kRow, 2);
    Part part = make_part(scan, std::move(fields), pages);
    for (std::size_t c = 0; c < 3 && part.coloured(); ++c) {
      part.colours[c] = colour_range(scan.colour_limits[2 * c], scan.colour_limits[2 * c + 1],
                                     *scan.find(after(E57Use::kRed, c)));
    }
    if (part.intense())
      part.intensities =
          intensity_range(scan.intensity_limits[0], scan.intensity_limits[1], *scan.find(E57Use::kIntensity));
    if (scan.has_pose) set_motion(scan, part);
    if (part.with(E57Use::kRow) && part.with(E57Use::kColumn)) find_lines(scan, part, pages);
    if (part.moved || !cartesian || scan.has_range_bounds ||
        (scan.find(E57Use::kRow) && scan.find(E57Use::kColumn)))
      take_sensor(scan, part, pages);
    count(scan, part);
    parts_.push_back(std::move(part));
  }

  Part make_part(const E57Scan& scan, std::vector<E57Field> fields, E57Pages& pages) const {
    std::vector<E57Column> columns;
    for (const E57Field& f : fields) {
      if (f.bits > 0) columns.push_back({f.stream, f.bits});
    }
    Part part{E57Section(pages, scan.section, scan.streams, std::move(columns), scan.declared,
                         mark_spacing(input_.size())),
              records_,
              std::move(fields),
              {},
              false,
              kNoSensor,
              {},
              {},
              false,
              E57Use::kColumn,
              E57Use::kRow,
              0,
              {}};
    for (const E57Field& f : part.fields) part.has[static_cast<std::size_t>(f.use)] = true;
    return part;
  }

  /// The sensor of a scan that says where it was taken from, unless its points refute that.
  void take_sensor(const E57Scan& scan, Part& part, E57Pages& pages) {
    // Ranges and angles are measured from the scanner, wherever it stood.
    const ScanPose pose = part.with(E57Use::kX) ? check_pose(scan, part, pages) : ScanPose::kHolds;
    if (pose == ScanPose::kHolds) {
      part.sensor = static_cast<std::uint16_t>(info_.sensors.size());
      info_.sensors.push_back(part.motion.translation);
      return;
    }
    part.grid = false;  // normals by rows and columns need the scanner
    refused_.add(scan.number, pose, part.motion.translation);
  }

  /// Looks at samples from all over the scan, with rows and columns where it has them, whether they are read later or not.
  ScanPose check_pose(const E57Scan& scan, const Part& part, E57Pages& pages) const {
    std::vector<E57Field> fields;
    for (const E57Field& f : part.fields)
      if (f.use <= E57Use::kZ || f.use == E57Use::kCartesianState) fields.push_back(f);
    const bool gridded = scan.find(E57Use::kRow) && scan.find(E57Use::kColumn);
    for (const E57Use use : {E57Use::kRow, E57Use::kColumn})
      if (gridded) fields.push_back(*scan.find(use));
    Part probe = make_part(scan, std::move(fields), pages);
    probe.motion = part.motion;
    probe.moved = part.moved;
    if (gridded) find_lines(scan, probe, pages);
    const std::uint64_t records = probe.section.records();
    // A window holds a pair of lines wherever it begins.
    const std::uint64_t window = std::max<std::uint64_t>(64, probe.grid ? 3 * probe.cells : 0);
    const std::uint64_t windows = std::clamp<std::uint64_t>(records / window, 1, kPoseWindows);
    const PairChoice cells(probe.cells, kPoseCellPairs);
    PoseLook look(part.motion.translation, 0, 0);
    Block block;
    PointChunk valid;
    std::vector<std::uint32_t> valid_rows;
    for (std::uint64_t w = 0; w < windows; ++w) {
      const std::uint64_t begin = windows == 1 ? 0 : (records - window) / (windows - 1) * w;
      for_each_block(probe, begin, std::min(records, begin + window), pages, block,
                     [&](std::uint64_t first, std::size_t n) {
                       valid.clear();
                       valid_rows.clear();
                       append(probe, block, 0, n, valid, &valid_rows);
                       for (std::size_t v = 0; v < valid_rows.size(); ++v) {
                         const Double3 p = {valid.x[v], valid.y[v], valid.z[v]};
                         const std::uint64_t record = first + valid_rows[v];
                         const auto at = [&](E57Use use) { return index_of(block[use][valid_rows[v]]); };
                         if (!probe.grid) {
                           look.add(0, 0, p, true, false);
                           continue;
                         }
                         const std::int64_t cell = at(probe.cell);
                         const bool of_pair = cells.takes(static_cast<std::uint64_t>(std::abs(cell)));
                         look.add(at(probe.line), cell, p, record % 16 == 0, of_pair);
                       }
                     });
    }
    return look.verdict(part.moved || scan.has_range_bounds, probe.grid);
  }

  /// Indices beyond 2^52 are all one: doubles do not tell them apart.
  static std::int64_t index_of(double value) {
    return static_cast<std::int64_t>(std::clamp(value, -0x1p52, 0x1p52));
  }

  /// Whether the records lie row by row or column by column: what most of the first ones share with the one before.
  void find_lines(const E57Scan& scan, Part& part, E57Pages& pages) const {
    for (const E57Use use : {E57Use::kRow, E57Use::kColumn})
      if (scan.find(use)->code != E57Code::kInteger) return;
    const std::uint64_t end = std::min(part.section.records(), kLooked);
    std::array<std::uint64_t, 2> same{};  // rows, columns
    std::array<double, 2> last{};
    Block block;
    for_each_block(part, 0, end, pages, block, [&](std::uint64_t first, std::size_t n) {
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = 0; k < 2; ++k) {
          const double now = block[after(E57Use::kRow, k)][i];
          same[k] += first + i > 0 && now == last[k] ? 1 : 0;
          last[k] = now;
        }
    });
    const std::size_t by = same[1] >= same[0] ? 1 : 0;
    part.line = after(E57Use::kRow, by);
    part.cell = after(E57Use::kRow, 1 - by);
    const E57Field& cells = *scan.find(part.cell);
    part.cells = static_cast<std::uint64_t>(
        std::min(cells.max_value - cells.min_value + 1.0, static_cast<double>(kMaxGridCells)));
    part.grid = 2 * same[by] > end && same[0] != same[1];
  }

  void set_motion(const E57Scan& scan, Part& part) {
    const auto& q = scan.rotation;
    const double squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    const bool finite =
        std::isfinite(squared) && std::all_of(scan.translation.begin(), scan.translation.end(),
                                              [](double v) { return std::isfinite(v); });
    if (!finite || !(squared > 1e-12))
      fail(scan, "its pose is no motion: the quaternion is zero, or a number is not finite");
    if (std::abs(squared - 1) > 1e-3) {
      info_.warnings.push_back("scan " + std::to_string(scan.number) +
                               ": the quaternion of its pose is no unit; it is made one");
    }
    const double s = 2.0 / squared;
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    part.motion.rotation = {1 - s * (y * y + z * z), s * (x * y - w * z),     s * (x * z + w * y),
                            s * (x * y + w * z),     1 - s * (x * x + z * z), s * (y * z - w * x),
                            s * (x * z - w * y),     s * (y * z + w * x),     1 - s * (x * x + y * y)};
    part.motion.translation = scan.translation;
    part.moved = x != 0 || y != 0 || z != 0 || scan.translation != Double3{};
  }

  void count(const E57Scan& scan, const Part& part) {
    const std::uint64_t there = part.section.records();
    if (there < scan.declared) {
      info_.warnings.push_back("scan " + std::to_string(scan.number) + ": the header declares " +
                               std::to_string(scan.declared) + " points, the file holds " +
                               std::to_string(there) + ": it is truncated, or the count is wrong");
    }
    records_ += there;
    const auto add_to = [](std::uint64_t& sum, std::uint64_t n) {
      sum += std::min(n, ~std::uint64_t{0} - sum);
    };
    add_to(info_.declared_points, scan.declared);
    add_to(missing_, scan.declared - there);
    PointAttributes& has = info_.attributes;
    has.normals = has.normals || part.normals() || part.grid;
    has.grid_normals = has.grid_normals || part.grid;
    info_.packed = info_.packed || part.grid;  // made once
    has.intensity_16 = has.intensity_16 || scan.find(E57Use::kIntensity);
    has.colour = has.colour || part.coloured();
    has.echo = has.echo || part.echoes();
    has.sensor = has.sensor || part.sensor != kNoSensor;
    has.intensity = has.intensity || scan.find(E57Use::kIntensity);
  }

  /// Where every scan gives its bounds and no pose moves one: some writers give them before, some after it.
  void declare_bounds(const std::vector<E57Scan>& scans) {
    constexpr double kAbsurd = 1e300;  // limits of the type stand for bounds that nobody filled in
    info_.has_bounds = !scans.empty();
    for (std::size_t i = 0; i < scans.size(); ++i) {
      for (std::size_t a = 0; a < 3; ++a) {
        const double low = scans[i].bounds[2 * a];
        const double high = scans[i].bounds[2 * a + 1];
        info_.has_bounds =
            info_.has_bounds && !parts_[i].moved && low <= high && low > -kAbsurd && high < kAbsurd;
        info_.declared_min[a] = i == 0 ? low : std::min(info_.declared_min[a], low);
        info_.declared_max[a] = i == 0 ? high : std::max(info_.declared_max[a], high);
      }
    }
  }

  void read_records(const Part& part, std::uint64_t begin, std::uint64_t end, E57Pages& pages, Block& block,
                    ChunkSink& out, std::uint64_t& empty) const {
    for_each_block(part, begin, end, pages, block, [&](std::uint64_t, std::size_t n) {
      for (std::size_t i = 0; i < n;) {
        const std::size_t m = std::min(out.remaining(), n - i);
        empty += m - append(part, block, i, m, out.chunk(), nullptr);
        out.added();
        i += m;
      }
    });
  }

  /// Decodes records [begin, end), a block at a time. \param use  gets the first record and how many there are
  template <class Use>
  void for_each_block(const Part& part, std::uint64_t begin, std::uint64_t end, E57Pages& pages, Block& block,
                      const Use& use) const {
    if (begin == end) return;  // a section without packets has no place to begin at
    E57Packets packets(pages, part.section.streams());
    std::vector<E57Cursor> cursors;
    for (std::size_t c = 0; c < part.section.columns().size(); ++c)
      cursors.emplace_back(part.section, c, begin * part.section.columns()[c].bits / 8);
    while (begin < end) {
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(kDecodedRecords, end - begin));
      block.decode(part, packets, cursors, begin, n);
      use(begin, n);
      begin += n;
    }
  }

  /// The same with normals from the grid: reads the lines around too.
  void read_grid(const Part& part, std::uint64_t begin, std::uint64_t end, E57Pages& pages, Block& block,
                 ChunkSink& out, std::uint64_t& empty) const {
    const std::uint64_t around = GridStream::kLinesAround * part.cells;
    const std::uint64_t low = begin - std::min(begin, around);
    const std::uint64_t high = end + std::min(part.section.records() - end, around);
    GridStream stream(part.motion.translation, part.cells, low == 0, out);
    PointChunk valid;
    std::vector<std::uint32_t> valid_rows;
    for_each_block(part, low, high, pages, block, [&](std::uint64_t first, std::size_t n) {
      valid.clear();
      valid_rows.clear();
      append(part, block, 0, n, valid, &valid_rows);
      for (std::size_t i = 0, v = 0; i < n; ++i) {
        const bool wanted = first + i >= begin && first + i < end;
        stream.next(index_of(block[part.line][i]));
        if (v < valid_rows.size() && valid_rows[v] == i)
          stream.add(index_of(block[part.cell][i]), valid, v++, wanted);
        else
          empty += wanted ? 1 : 0;
      }
    });
    stream.finish(high == part.section.records());
  }

  /// Appends the valid ones of `count` records of the block. Returns how many they are.
  /// \param valid_rows  gets where in the block they are; where it is given they get no normals
  std::size_t append(const Part& part, Block& block, std::size_t first, std::size_t count, PointChunk& chunk,
                     std::vector<std::uint32_t>* valid_rows) const {
    const bool cartesian = part.with(E57Use::kX);
    const E57Use state = cartesian ? E57Use::kCartesianState : E57Use::kSphericalState;
    const double* invalid = part.with(state) ? block[state] : nullptr;
    const double* a = block[cartesian ? E57Use::kX : E57Use::kRange];
    const double* b = block[cartesian ? E57Use::kY : E57Use::kAzimuth];
    const double* c = block[cartesian ? E57Use::kZ : E57Use::kElevation];
    std::size_t added = 0;
    for (std::size_t i = first; i < first + count; ++i) {
      if (invalid && invalid[i] != 0) continue;
      Double3 p = cartesian ? Double3{a[i], b[i], c[i]} : from_spherical(a[i], b[i], c[i]);
      if (part.moved) p = part.motion.rotated(p) + part.motion.translation;
      chunk.x.push_back(p[0]), chunk.y.push_back(p[1]), chunk.z.push_back(p[2]);
      if (valid_rows) valid_rows->push_back(static_cast<std::uint32_t>(i));
      if (info_.attributes.normals && !valid_rows) append_normal(part, block, i, chunk);
      if (info_.attributes.colour) chunk.rgba.push_back(colour(part, block, i));
      if (info_.attributes.echo) chunk.echo.push_back(echo(part, block, i));
      if (options_.intensities && info_.attributes.intensity_16)
        chunk.intensity.push_back(part.intense() ? part.intensities.word(block[E57Use::kIntensity][i])
                                                 : std::uint16_t{0});
      ++added;
    }
    if (info_.attributes.sensor) chunk.sensor.resize(chunk.size(), part.sensor);
    return added;
  }

  /// Azimuth counts from x to y, elevation from the xy plane to z. Angles beyond 10^6 make no position.
  static Double3 from_spherical(double range, double azimuth, double elevation) {
    if (!(std::abs(azimuth) < 1e6) || !(std::abs(elevation) < 1e6)) {
      constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
      return {kNan, kNan, kNan};
    }
    const SinCos yaw = sin_cos(azimuth);
    const SinCos rise = sin_cos(elevation);
    return {range * rise.cos * yaw.cos, range * rise.cos * yaw.sin, range * rise.sin};
  }

  static void append_normal(const Part& part, Block& block, std::size_t i, PointChunk& chunk) {
    Double3 n{};
    if (part.normals())
      n = {block[E57Use::kNormalX][i], block[E57Use::kNormalY][i], block[E57Use::kNormalZ][i]};
    if (part.moved) n = part.motion.rotated(n);
    chunk.nx.push_back(static_cast<float>(n[0]));
    chunk.ny.push_back(static_cast<float>(n[1]));
    chunk.nz.push_back(static_cast<float>(n[2]));
  }

  /// 0 where the scan has none, or says that it is invalid.
  static std::uint32_t colour(const Part& part, Block& block, std::size_t i) {
    if (!part.coloured() || (part.with(E57Use::kColourState) && block[E57Use::kColourState][i] != 0))
      return 0;
    return pack_rgb(part.colours[0].byte(block[E57Use::kRed][i]),
                    part.colours[1].byte(block[E57Use::kGreen][i]),
                    part.colours[2].byte(block[E57Use::kBlue][i]));
  }

  /// Returns count from 0 here and from 1 in Echo; a count of 0 was not filled in.
  static Echo echo(const Part& part, Block& block, std::size_t i) {
    if (!part.echoes() || !(block[E57Use::kReturns][i] > 0)) return {};
    return {0, colour_byte(block[E57Use::kReturn][i] + 1, ColourScale::kByte),
            colour_byte(block[E57Use::kReturns][i], ColourScale::kByte)};
  }

  ClosedFile input_;
  ReadOptions options_;
  PointFileInfo info_;
  std::vector<Part> parts_;  ///< in the order of the file; those without records have the place of the next
  RefusedPoses refused_;
  std::uint64_t records_ = 0;  ///< of all parts
  std::uint64_t missing_ = 0;  ///< declared, not there
};

}  // namespace

std::unique_ptr<PointFile> open_e57_points(const ReadFile& file, const ReadOptions& options) {
  return std::make_unique<E57Points>(file, options);
}

}  // namespace tessera
