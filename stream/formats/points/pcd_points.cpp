#include "stream/formats/points/pcd_points.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "octree/error.h"
#include "stream/formats/closed_file.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/lzf_reader.h"
#include "stream/formats/points/point_records.h"
#include "stream/formats/points/pose_look.h"

namespace tessera {

namespace {

constexpr std::size_t kHeaderBuffer = std::size_t{1} << 16;
constexpr int kMaxHeaderLines = 1000;
constexpr std::uint64_t kLongestRecord = std::uint64_t{1} << 16;
constexpr std::size_t kBlockBytes = std::size_t{1} << 18;  ///< of records unpacked at a time
/// Points that tell how colours of lines and packed blocks are scaled.
constexpr std::uint64_t kSampled = 10000;

struct PcdField {
  std::string name;
  ScalarType type = ScalarType::kFloat32;
  std::uint64_t count = 1;
  std::uint64_t offset = 0;  ///< in a record
  std::uint64_t bytes() const { return count * scalar_bytes(type); }
};

std::vector<std::string> words_of(std::string_view line) {
  std::vector<std::string> words;
  constexpr std::string_view kBlanks = " \t\r";
  for (std::size_t at = line.find_first_not_of(kBlanks); at != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kBlanks, at), line.size());
    words.emplace_back(line.substr(at, end - at));
    at = line.find_first_not_of(kBlanks, end);
  }
  return words;
}

std::optional<ScalarType> scalar_type(const std::string& type, const std::string& size) {
  constexpr std::array<std::pair<std::string_view, ScalarType>, 10> kTypes = {{
      {"I1", ScalarType::kInt8},
      {"U1", ScalarType::kUint8},
      {"I2", ScalarType::kInt16},
      {"U2", ScalarType::kUint16},
      {"I4", ScalarType::kInt32},
      {"U4", ScalarType::kUint32},
      {"I8", ScalarType::kInt64},
      {"U8", ScalarType::kUint64},
      {"F4", ScalarType::kFloat32},
      {"F8", ScalarType::kFloat64},
  }};
  for (const auto& [name, scalar] : kTypes) {
    if (name == type + size) return scalar;
  }
  return std::nullopt;
}

enum class PcdData { kAscii, kBinary, kCompressed };

struct PcdHeader {
  std::vector<PcdField> fields;
  std::uint64_t stride = 0;
  std::uint64_t points = 0;
  std::optional<std::uint64_t> grid;  ///< width * height
  std::optional<Double3> viewpoint;   ///< unless it is the default
  std::uint64_t row_points =
      0;  ///< of a cloud with rows and the default viewpoint, which may be where its camera was
  PcdData data = PcdData::kAscii;
  std::uint64_t data_begin = 0;
  std::uint64_t lines = 0;
};

/// Reads the header line by line; knows where it is for messages.
class HeaderParser {
 public:
  explicit HeaderParser(const ReadFile& file) : file_(file) {}

  PcdHeader parse() {
    const LineLayout layout{0, 1, '\n'};
    LineReader reader(file_, layout, 0, file_.size(), false, kHeaderBuffer);
    std::string_view text;
    while (reader.next(text)) {
      if (++header_.lines > kMaxHeaderLines) break;
      std::vector<std::string> words = words_of(text);
      if (words.empty() || words[0][0] == '#') continue;
      const std::string keyword = words[0];
      words.erase(words.begin());
      if (keyword == "DATA") {
        data(words);
        finish();
        header_.data_begin = reader.next_offset();
        return std::move(header_);
      }
      line(keyword, std::move(words));
    }
    fail("there is no DATA line, which ends the header of a PCD file; it is truncated or no PCD file");
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(file_.path().string() + ": line " + std::to_string(header_.lines) +
                     " of the PCD header: " + what);
  }

  void line(const std::string& keyword, std::vector<std::string> words) {
    if (keyword == "FIELDS" || keyword == "COLUMNS") {
      names_ = std::move(words);
    } else if (keyword == "SIZE") {
      sizes_ = std::move(words);
    } else if (keyword == "TYPE") {
      types_ = std::move(words);
    } else if (keyword == "COUNT") {
      counts_ = std::move(words);
    } else if (keyword == "WIDTH") {
      width_ = whole(words);
    } else if (keyword == "HEIGHT") {
      height_ = whole(words);
    } else if (keyword == "POINTS") {
      points_ = whole(words);
    } else if (keyword == "VIEWPOINT") {
      viewpoint(words);
    } else if (keyword != "VERSION") {
      fail("unknown keyword '" + keyword.substr(0, 40) + "'");
    }
  }

  std::uint64_t whole(const std::vector<std::string>& words) const {
    std::string_view text = words.empty() ? std::string_view() : words[0];
    std::uint64_t value = 0;
    if (!take_count(text, value) || !text.empty())
      fail("'" + (words.empty() ? "" : words[0].substr(0, 40)) + "' is not a number from 0 to 2^64-1");
    return value;
  }

  /// Position, then a quaternion w x y z.
  void viewpoint(const std::vector<std::string>& words) {
    constexpr std::array<double, 7> kDefault = {0, 0, 0, 1, 0, 0, 0};
    std::array<double, 7> v = kDefault;
    for (std::size_t i = 0; i < std::min(words.size(), v.size()); ++i) {
      std::string_view text = words[i];
      if (!take_number(text, v[i]) || !text.empty()) fail("'" + words[i].substr(0, 40) + "' is no number");
    }
    if (v != kDefault && std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]))
      header_.viewpoint = Double3{v[0], v[1], v[2]};
  }

  void data(const std::vector<std::string>& words) {
    const std::string kind = words.empty() ? "" : words[0];
    if (kind == "ascii") {
      header_.data = PcdData::kAscii;
    } else if (kind == "binary") {
      header_.data = PcdData::kBinary;
    } else if (kind == "binary_compressed") {
      header_.data = PcdData::kCompressed;
    } else {
      fail("unknown data '" + kind.substr(0, 40) + "', expected ascii, binary or binary_compressed");
    }
  }

  void finish() {
    if (names_.empty()) fail("there is no FIELDS line before DATA");
    if (header_.data == PcdData::kAscii && sizes_.empty() && types_.empty()) {  // version 0.5
      sizes_.assign(names_.size(), "4");
      types_.assign(names_.size(), "F");
    }
    if (counts_.empty()) counts_.assign(names_.size(), "1");
    if (sizes_.size() != names_.size() || types_.size() != names_.size() || counts_.size() != names_.size()) {
      fail("there are " + std::to_string(names_.size()) + " FIELDS, but " + std::to_string(sizes_.size()) +
           " SIZEs, " + std::to_string(types_.size()) + " TYPEs and " + std::to_string(counts_.size()) +
           " COUNTs");
    }
    for (std::size_t i = 0; i < names_.size(); ++i) {
      const auto type = scalar_type(types_[i], sizes_[i]);
      if (!type) {
        fail("field '" + names_[i].substr(0, 40) + "' has type " + types_[i].substr(0, 8) + " of " +
             sizes_[i].substr(0, 8) + " bytes, which is not known");
      }
      PcdField f{names_[i], *type, whole({counts_[i]}), header_.stride};
      if (f.count > kLongestRecord || f.bytes() + header_.stride > kLongestRecord)
        fail("records of more than 65536 bytes");
      header_.stride += f.bytes();
      header_.fields.push_back(std::move(f));
    }
    if (header_.stride == 0) fail("records of no bytes");
    if (!header_.viewpoint && height_.value_or(1) > 1 && width_.value_or(1) > 1) header_.row_points = *width_;
    if (width_ && height_)
      header_.grid =
          *height_ == 0 || *width_ <= ~std::uint64_t{0} / *height_ ? *width_ * *height_ : ~std::uint64_t{0};
    header_.points = points_.value_or(header_.grid.value_or(0));
  }

  const ReadFile& file_;
  PcdHeader header_;
  std::vector<std::string> names_, sizes_, types_, counts_;
  std::optional<std::uint64_t> width_, height_, points_;
};

class PcdPoints final : public PointFile {
 public:
  PcdPoints(const ReadFile& file, const ReadOptions& options) : input_(file), options_(options) {
    header_ = HeaderParser(file).parse();
    set_layout();
    info_.path = input_.path();
    info_.bytes = input_.size();
    info_.declared_points = header_.points;
    info_.placeholders = true;
    if (header_.grid && *header_.grid != header_.points) {
      info_.warnings.push_back("the header has two counts that differ: " + std::to_string(header_.points) +
                               " points, width times height " + std::to_string(*header_.grid));
    }
    info_.attributes.normals = layout_.normal[0].there();
    info_.attributes.colour = packed_ || layout_.colour[0].there();
    info_.attributes.intensity = find("intensity") != nullptr;
    info_.attributes.sensor = header_.viewpoint.has_value();
    if (header_.viewpoint) info_.sensors.push_back(*header_.viewpoint);
    if (header_.data == PcdData::kAscii) {
      info_.format = "PCD ascii";
      set_slots();
    } else if (header_.data == PcdData::kBinary) {
      info_.format = "PCD binary";
      count_ = verified_count(file, header_.data_begin, input_.size(), header_.points, layout_, true);
      if (!count_.warning.empty()) info_.warnings.push_back(count_.warning);
    } else {
      info_.format = "PCD binary compressed";
      find_fields(file);
    }
    if (layout_.colour[0].there() && !packed_)
      layout_.colour_scale = header_.data == PcdData::kBinary
                                 ? sample_colour_scale(file, header_.data_begin, count_.usable, layout_)
                                 : colour_scale_for(layout_.colour[0].type, largest_colour(file));
    if (header_.row_points > 0 && header_.grid == header_.points && is_seen_from_origin()) {
      info_.attributes.sensor = true;
      info_.sensors.push_back({});
    }
    for (const PcdField& f : header_.fields)
      if (f.name != "_" && !equal_any_case(f.name, "intensity") &&
          std::find(used_.begin(), used_.end(), &f) == used_.end())
        info_.left_out.push_back(f.name);
  }

  const PointFileInfo& info() const override { return info_; }

  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const override {
    if (header_.data == PcdData::kBinary)
      return even_slices(file, 0, count_.usable, layout_.stride, target_bytes);
    if (header_.data == PcdData::kAscii)
      return even_slices(file, header_.data_begin, input_.size(), 1, target_bytes);
    return {{file, 0, count_.usable, input_.size() - header_.data_begin}};
  }

  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    ChunkSink out(options_.chunk_points, sink);
    ReadCounts counts;
    const ReadFile file = input_.open();
    if (header_.data == PcdData::kAscii) {
      read_lines(file, slice, out, counts);
    } else {
      if (header_.data == PcdData::kBinary) {
        read_records(file, slice, out);
      } else {
        read_compressed(file, out);
      }
      if (slice.end >= count_.usable) counts.missing = count_.missing;
    }
    out.flush();
    counts.points = out.points();
    return counts;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(input_.path().string() + ": " + what);
  }

  /// The frame of a depth camera has the camera at its origin; clouds that were moved keep rows and the default viewpoint, too.
  bool is_seen_from_origin() const {
    PoseLook look({}, header_.points / header_.row_points, header_.row_points);
    std::uint64_t next = 0;
    for (const InputSlice& slice : slices(0, header_.data == PcdData::kAscii ? input_.size() : kBlockBytes))
      read(slice, [&](const PointChunk& chunk) {
        for (std::size_t i = 0; i < chunk.size(); ++i, ++next)
          if (look.wants_next(next) && std::isfinite(chunk.x[i]) && std::isfinite(chunk.y[i]) &&
              std::isfinite(chunk.z[i]))
            look.add(next, {chunk.x[i], chunk.y[i], chunk.z[i]});
      });
    return look.verdict(false, next == header_.points) == ScanPose::kHolds;
  }

  /// What is spelt as `name` is comes before what differs in capitals.
  const PcdField* find(std::string_view name) const {
    const PcdField* found = nullptr;
    for (const PcdField& f : header_.fields) {
      if (f.count == 0 || !equal_any_case(f.name, name)) continue;
      if (f.name == name) return &f;
      if (found == nullptr) found = &f;
    }
    return found;
  }

  bool take(std::array<PointColumn, 3>& columns, const FieldTriple& names) {
    for (const std::string_view name : names) {
      if (!find(name)) return false;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const PcdField* f = find(names[i]);
      columns[i] = {f->type, static_cast<int>(f->offset)};
      if (std::find(used_.begin(), used_.end(), f) == used_.end()) used_.push_back(f);
    }
    return true;
  }

  void set_layout() {
    layout_.stride = static_cast<std::size_t>(header_.stride);
    if (!take(layout_.position, kPositionFields)) fail("the FIELDS of the PCD header lack x, y or z");
    for (const FieldTriple& names : kNormalFields)
      if (take(layout_.normal, names)) break;
    packed_ = find("rgb") ? find("rgb") : find("rgba");
    if (packed_ && scalar_bytes(packed_->type) == 4) {
      // 0xaarrggbb, lowest byte first; alpha is 0 in half of the files.
      const auto at = static_cast<int>(packed_->offset);
      for (int c = 0; c < 3; ++c)
        layout_.colour[static_cast<std::size_t>(c)] = {ScalarType::kUint8, at + 2 - c};
      used_.push_back(packed_);
    } else {
      packed_ = nullptr;
      for (const FieldTriple& names : kColourFields)
        if (take(layout_.colour, names)) break;
    }
  }

  /// What the values of a line are: 0..8 position, normal and colour, kPacked, kSkip.
  void set_slots() {
    for (const PcdField& f : header_.fields) {
      int slot = kSkip;
      const std::array groups = {&layout_.position, &layout_.normal, &layout_.colour};
      for (std::size_t g = 0; g < 3; ++g) {
        for (std::size_t i = 0; i < 3 && !(g == 2 && packed_); ++i) {
          if ((*groups[g])[i].offset == static_cast<int>(f.offset) && f.count > 0)
            slot = static_cast<int>(3 * g + i);
        }
      }
      if (&f == packed_) slot = kPacked;
      slots_.push_back(slot);
      slots_.insert(slots_.end(), f.count > 1 ? static_cast<std::size_t>(f.count - 1) : 0, kSkip);
      if (f.count == 0) slots_.pop_back();
    }
    while (!slots_.empty() && slots_.back() == kSkip) slots_.pop_back();
  }

  /// Of the first points.
  double largest_colour(const ReadFile& file) const {
    double largest = 0;
    if (header_.data == PcdData::kAscii) {
      LineReader reader(file, {header_.data_begin, header_.lines + 1, '\n'}, header_.data_begin, file.size(),
                        false);
      std::string_view line;
      PointValues v{};
      for (std::uint64_t i = 0; i < kSampled && reader.next(line); ++i)
        if (!is_blank(line) && parse(line, v)) largest = std::max({largest, v[6], v[7], v[8]});
      return largest;
    }
    std::vector<char> column;
    for (std::size_t i = 0; i < used_.size(); ++i)
      for (const PointColumn& c : layout_.colour) {
        if (static_cast<int>(used_[i]->offset) != c.offset) continue;
        const auto bytes = static_cast<std::size_t>(used_[i]->bytes());
        const auto n = static_cast<std::size_t>(
            std::min({kSampled, count_.usable, std::max<std::uint64_t>(1, kBlockBytes / bytes)}));
        column.resize(n * bytes);
        LzfReader(file, starts_[i], packed_end_, false).read(column.data(), column.size());
        for (std::size_t r = 0; r < n; ++r)
          largest = std::max(largest, load_double(c.type, false, column.data() + r * bytes));
      }
    return largest;
  }

  bool parse(std::string_view line, PointValues& v) const {
    for (const int slot : slots_) {
      double value = 0;
      if (slot == kSkip) {
        if (!skip_field(line)) return false;
        continue;
      }
      if (!next_number(line, value)) return false;
      if (slot != kPacked) {
        v[static_cast<std::size_t>(slot)] = value;
        continue;
      }
      const std::uint32_t bits = scalar_is_float(packed_->type)
                                     ? std::bit_cast<std::uint32_t>(static_cast<float>(value))
                                 : value >= 0 && value < 0x1p32 ? static_cast<std::uint32_t>(value)
                                                                : 0;
      for (std::size_t c = 0; c < 3; ++c) v[6 + c] = bits >> (16 - 8 * c) & 0xffu;
    }
    return true;
  }

  void read_lines(const ReadFile& file, const InputSlice& slice, ChunkSink& out, ReadCounts& counts) const {
    const LineLayout layout{header_.data_begin, header_.lines + 1, '\n'};
    LineReader reader(file, layout, slice.begin, slice.end, options_.release_cache);
    std::string_view line;
    PointValues v{};
    while (reader.next(line)) {
      if (is_blank(line)) continue;
      if (!parse(line, v)) {
        if (!reader.complete()) {
          counts.missing = 1;
          counts.warnings.push_back(reader.torn_line());
          break;
        }
        throw InputError(
            reader.where() + ": '" + std::string(line.substr(0, 60)) +
            "' is not a point with the fields that the PCD header declares; correct or remove the line");
      }
      append_values(v, info_.attributes, layout_.colour_scale, out.chunk());
      append_sensors(out.chunk());
      out.added();
    }
  }

  void append_sensors(PointChunk& chunk) const {
    if (info_.attributes.sensor) chunk.sensor.resize(chunk.size(), 0);
  }

  void read_records(const ReadFile& file, const InputSlice& slice, ChunkSink& out) const {
    const std::uint64_t end = std::min(slice.end, count_.usable);
    const std::uint64_t begin = std::min(slice.begin, end);
    ByteWindow window(file, header_.data_begin + begin * layout_.stride,
                      header_.data_begin + end * layout_.stride, ByteWindow::kDefaultCapacity,
                      options_.release_cache);
    for (std::uint64_t left = end - begin; left > 0;) {
      const std::string_view bytes = window.peek(layout_.stride);
      const std::size_t n = std::min(bytes.size() / layout_.stride, out.remaining());
      append_records(layout_, bytes.data(), n, out.chunk());
      append_sensors(out.chunk());
      window.skip(n * layout_.stride);
      out.added();
      left -= n;
    }
  }

  /// Unpacks the block once to nowhere: where the fields start, and how far it goes.
  void find_fields(const ReadFile& file) {
    char sizes[8];
    if (file.size() - header_.data_begin < sizeof sizes)
      fail("byte " + std::to_string(file.size()) +
           ": the file ends before its compressed points; it is truncated");
    file.read_at(header_.data_begin, sizes, sizeof sizes);
    const std::uint64_t packed = load_scalar<std::uint32_t>(sizes);
    const std::uint64_t unpacked = load_scalar<std::uint32_t>(sizes + 4);
    LzfPosition at;
    at.packed = header_.data_begin + sizeof sizes;
    packed_end_ = at.packed + std::min(packed, file.size() - at.packed);
    std::uint64_t records = unpacked / header_.stride;
    if (unpacked % header_.stride != 0) {
      if (records < header_.points) {
        fail("byte " + std::to_string(header_.data_begin + 4) + ": the compressed points unpack to " +
             std::to_string(unpacked) + " bytes, which is no whole number of records of " +
             std::to_string(header_.stride) + "; the file is damaged");
      }
      records = header_.points;
    }
    LzfReader reader(file, at, packed_end_, false);
    std::sort(used_.begin(), used_.end(),
              [](const PcdField* a, const PcdField* b) { return a->offset < b->offset; });
    std::uint64_t whole = records;  // of every field that is used
    for (const PcdField* f : used_) {
      reader.read(nullptr, f->offset * records - reader.state().unpacked);
      starts_.push_back(reader.state());
      const std::uint64_t found = reader.read(nullptr, f->bytes() * records);
      whole = std::min(whole, starts_.back().unpacked == f->offset * records ? found / f->bytes() : 0);
    }
    count_.usable = std::min(whole, records);
    count_.missing = header_.points > count_.usable ? header_.points - count_.usable : 0;
    if (count_.usable != header_.points) {
      info_.warnings.push_back("the header declares " + std::to_string(header_.points) +
                               " points, the compressed block holds " + std::to_string(count_.usable));
    }
  }

  /// Puts the fields back beside each other, block by block.
  void read_compressed(const ReadFile& file, ChunkSink& out) const {
    const std::size_t block = std::max<std::size_t>(1, kBlockBytes / layout_.stride);
    std::vector<LzfReader> readers;
    readers.reserve(starts_.size());
    for (const LzfPosition& start : starts_)
      readers.emplace_back(file, start, packed_end_, options_.release_cache);
    std::vector<char> column;
    std::vector<char> records;
    for (std::uint64_t left = count_.usable; left > 0;) {
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>({block, out.remaining(), left}));
      records.resize(n * layout_.stride);
      for (std::size_t i = 0; i < used_.size(); ++i) {
        const auto bytes = static_cast<std::size_t>(used_[i]->bytes());
        column.resize(n * bytes);
        readers[i].read(column.data(), column.size());
        for (std::size_t r = 0; r < n; ++r)
          std::copy_n(column.data() + r * bytes, bytes,
                      records.data() + r * layout_.stride + used_[i]->offset);
      }
      append_records(layout_, records.data(), n, out.chunk());
      append_sensors(out.chunk());
      out.added();
      left -= n;
    }
    file.require_unchanged();
  }

  static constexpr int kSkip = -1;
  static constexpr int kPacked = 9;

  ClosedFile input_;
  ReadOptions options_;
  PointFileInfo info_;
  PcdHeader header_;
  PointRecordLayout layout_;
  const PcdField* packed_ = nullptr;   ///< red, green and blue in one
  std::vector<const PcdField*> used_;  ///< fields that are read
  std::vector<int> slots_;             ///< ascii: per value of a line
  RecordCount count_;                  ///< binary and compressed
  std::uint64_t packed_end_ = 0;       ///< compressed: file offset behind the block
  std::vector<LzfPosition> starts_;    ///< compressed: where the fields of used_ start
};

}  // namespace

std::unique_ptr<PointFile> open_pcd_points(const ReadFile& file, const ReadOptions& options) {
  return std::make_unique<PcdPoints>(file, options);
}

}  // namespace tessera
