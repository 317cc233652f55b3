#include "stream/formats/points/ply_points.h"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "octree/error.h"
#include "stream/formats/closed_file.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/ply_header.h"
#include "stream/formats/points/point_records.h"

namespace tessera {

namespace {

/// What a property of the vertex is to us: 0..2 position, 3..5 normal, 6..8 colour, 9 intensity, kSkip.
constexpr int kSkip = -1;
constexpr int kSlots = 10;
constexpr std::size_t kIntensity = 9;
/// Bytes of records read at a time: they are still in the second-level cache when they are decoded.
constexpr std::size_t kWindow = std::size_t{1} << 18;
using PlyValues = std::array<double, kSlots>;

class PlyPoints final : public PointFile {
 public:
  PlyPoints(const ReadFile& file, const ReadOptions& options) : input_(file), options_(options) {
    header_ = read_ply_header(file);
    const int vertex = find_vertices();
    if (vertex < 0) fail("the PLY header has no element 'vertex', so there are no points to read");
    vertex_ = static_cast<std::size_t>(vertex);
    for (std::size_t i = vertex_ + 1; i < header_.elements.size(); ++i) {
      closing_ = closing_ && header_.elements[i].count == 0;
    }
    assign_slots();
    info_.path = input_.path();
    info_.format = "PLY " + header_.encoding_name() + input_.packed_words();
    const int face = header_.find("face");
    const std::uint64_t faces = face < 0 ? 0 : header_.elements[static_cast<std::size_t>(face)].count;
    if (faces > 0) info_.format += ", vertices of a mesh of " + std::to_string(faces) + " faces";
    info_.bytes = input_.size();
    info_.packed = !file.packed().empty();
    info_.declared_points = element().count;
    info_.attributes.normals = has_[3];
    info_.attributes.colour = has_[6];
    info_.attributes.intensity = info_.attributes.intensity_16 = has_[kIntensity];
    info_.warnings = header_.warnings;
    for (std::size_t p = 0; p < slots_.size(); ++p)
      if (slots_[p] == kSkip && !equal_any_case(element().properties[p].name, "alpha"))
        info_.left_out.push_back(element().properties[p].name);
    if (header_.encoding == PlyEncoding::kAscii) {
      open_ascii(file);
    } else {
      open_binary(file);
    }
  }

  const PointFileInfo& info() const override { return info_; }

  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const override {
    switch (mode_) {
      case Mode::kRecords:
        return even_slices(file, 0, count_.usable, layout_.stride, input_.slice_bytes(target_bytes));
      case Mode::kLines:
        return even_slices(file, header_.data_begin, input_.size(), 1, input_.slice_bytes(target_bytes));
      case Mode::kInOrder:
        break;
    }
    return {{file, header_.data_begin, input_.size(), input_.size() - header_.data_begin}};
  }

  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    ChunkSink out(options_.chunk_points, sink);
    ReadCounts counts;
    if (mode_ == Mode::kRecords) {
      read_records(slice, out, counts);
    } else if (header_.encoding == PlyEncoding::kAscii) {
      read_lines(slice, out, counts);
    } else {
      read_in_order(out, counts);
    }
    out.flush();
    counts.points = out.points();
    return counts;
  }

 private:
  enum class Mode {
    kRecords,  ///< binary, one size: slices count records
    kLines,    ///< ascii, vertices only: slices are byte ranges
    kInOrder,  ///< one slice
  };

  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(input_.path().string() + ": " + what);
  }
  const PlyElement& element() const { return header_.elements[vertex_]; }

  int find_vertices() const {
    const auto at = std::find_if(header_.elements.begin(), header_.elements.end(),
                                 [](const PlyElement& e) { return equal_any_case(e.name, "vertex"); });
    return at == header_.elements.end() ? -1 : static_cast<int>(at - header_.elements.begin());
  }

  /// Index of the property that is no list, or -1; what is spelt as `name` is comes first.
  int find_number(std::string_view name) const {
    const auto number = [&](int at) {
      return at >= 0 && !element().properties[static_cast<std::size_t>(at)].list;
    };
    if (const int exact = element().find(name); number(exact)) return exact;
    for (int i = 0; i < static_cast<int>(element().properties.size()); ++i)
      if (number(i) && equal_any_case(element().properties[static_cast<std::size_t>(i)].name, name)) return i;
    return -1;
  }

  bool assign(const FieldTriple& names, int first_slot) {
    std::array<int, 3> at{};
    for (std::size_t i = 0; i < 3; ++i) {
      at[i] = find_number(names[i]);
      if (at[i] < 0) return false;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      slots_[static_cast<std::size_t>(at[i])] = first_slot + static_cast<int>(i);
      types_[static_cast<std::size_t>(first_slot) + i] =
          element().properties[static_cast<std::size_t>(at[i])].type;
    }
    has_[static_cast<std::size_t>(first_slot)] = true;
    return true;
  }

  void assign_slots() {
    slots_.assign(element().properties.size(), kSkip);
    if (!assign(kPositionFields, 0)) fail("element 'vertex' of the PLY header lacks x, y or z");
    for (const FieldTriple& names : kNormalFields) {
      if (assign(names, 3)) break;
    }
    for (const FieldTriple& names : kColourFields) {
      if (assign(names, 6)) break;
    }
    for (const std::string_view name : kIntensityFields) {
      const int at = find_number(name);
      if (at < 0) continue;
      slots_[static_cast<std::size_t>(at)] = kIntensity;
      types_[kIntensity] = element().properties[static_cast<std::size_t>(at)].type;
      has_[kIntensity] = true;
      break;
    }
  }

  bool vertices_only() const {
    for (std::size_t i = 0; i < header_.elements.size(); ++i) {
      if (i != vertex_ && header_.elements[i].count > 0) return false;
    }
    return true;
  }

  void open_ascii(const ReadFile& file) {
    lines_ = {header_.data_begin, header_.lines + 1, header_.line_end};
    mode_ = vertices_only() ? Mode::kLines : Mode::kInOrder;
    if (!has_[6] && !has_[kIntensity]) return;
    // The first 10,000 vertices tell how colours and intensities are scaled: see sample_colour_scale.
    double largest = 0, brightest = 0;
    LineReader reader(file, lines_, header_.data_begin, input_.size(), false);
    if (skip_elements_before(reader)) {
      std::string_view line;
      PlyValues values{};
      for (int i = 0; i < 10000 && reader.next(line); ++i) {
        if (is_blank(line) || !parse(line, values)) continue;
        largest = std::max({largest, values[6], values[7], values[8]});
        brightest = std::max(brightest, values[kIntensity]);
      }
    }
    layout_.colour_scale = colour_scale_for(types_[6], largest);
    unit_intensities_ = colour_scale_for(types_[kIntensity], brightest) == ColourScale::kUnit;
  }

  void open_binary(const ReadFile& file) {
    layout_.big_endian = header_.big_endian();
    ByteWindow window(file, header_.data_begin, input_.size());
    bool reached = true;
    for (std::size_t i = 0; i < vertex_ && reached; ++i) {
      const PlyElement& before = header_.elements[i];
      reached = skip_ply_elements(before, header_.big_endian(), before.count, window) == before.count;
    }
    begin_ = reached ? window.offset() : input_.size();
    if (!reached) info_.warnings.push_back("the file ends before its first vertex: it is truncated");
    if (element().has_list()) {
      mode_ = Mode::kInOrder;
      return;
    }
    mode_ = Mode::kRecords;
    layout_.stride = element().stride();
    for (std::size_t p = 0; p < slots_.size(); ++p) {
      if (slots_[p] == kSkip) continue;
      const auto slot = static_cast<std::size_t>(slots_[p]);
      if (slot == kIntensity) {
        intensity_ = {element().properties[p].type, static_cast<int>(element().offset(p))};
        continue;
      }
      auto& group = slot < 3 ? layout_.position : slot < 6 ? layout_.normal : layout_.colour;
      group[slot % 3] = {element().properties[p].type, static_cast<int>(element().offset(p))};
    }
    count_ = verified_count(file, begin_, input_.size(), element().count, layout_, closing_);
    if (!count_.warning.empty()) info_.warnings.push_back(count_.warning);
    if (has_[6]) layout_.colour_scale = sample_colour_scale(file, begin_, count_.usable, layout_);
    if (has_[kIntensity]) {
      PointRecordLayout grey = layout_;
      grey.colour.fill(intensity_);
      unit_intensities_ = sample_colour_scale(file, begin_, count_.usable, grey) == ColourScale::kUnit;
    }
  }

  void read_records(const InputSlice& slice, ChunkSink& out, ReadCounts& counts) const {
    const std::uint64_t end = std::min(slice.end, count_.usable);
    const std::uint64_t begin = std::min(slice.begin, end);
    const ReadFile file = input_.open();
    ByteWindow window(file, begin_ + begin * layout_.stride, begin_ + end * layout_.stride,
                      std::max(kWindow, layout_.stride), options_.release_cache);
    for (std::uint64_t left = end - begin; left > 0;) {
      const std::string_view bytes = window.peek(layout_.stride);
      const std::size_t n = std::min(bytes.size() / layout_.stride, out.remaining());
      append_records(layout_, bytes.data(), n, out.chunk());
      if (has_[kIntensity] && options_.intensities)
        for (std::size_t i = 0; i < n; ++i)
          out.chunk().intensity.push_back(intensity(
              load_double(intensity_.type, layout_.big_endian,
                          bytes.data() + i * layout_.stride + static_cast<std::size_t>(intensity_.offset))));
      window.skip(n * layout_.stride);
      out.added();
      left -= n;
    }
    if (slice.end >= count_.usable) counts.missing = count_.missing;
  }

  /// Whole numbers as they are, floats that never pass 1 stretched to 16 bits.
  std::uint16_t intensity(double value) const {
    const double v = unit_intensities_ ? value * 65535.0 : value;
    return v > 0.0 ? static_cast<std::uint16_t>(std::min(v, 65535.0) + 0.5) : std::uint16_t{0};
  }
  void append(const PlyValues& values, PointChunk& chunk) const {
    PointValues point_values;
    std::copy_n(values.begin(), point_values.size(), point_values.begin());
    append_values(point_values, info_.attributes, layout_.colour_scale, chunk);
    if (has_[kIntensity] && options_.intensities) chunk.intensity.push_back(intensity(values[kIntensity]));
  }

  /// Takes one ascii vertex from the line. False if that has too few values or something that is no number.
  bool parse(std::string_view& line, PlyValues& values) const {
    for (std::size_t p = 0; p < slots_.size(); ++p) {
      const PlyProperty& property = element().properties[p];
      if (property.list) {
        double items = 0;
        if (!next_number(line, items)) return false;
        for (; items > 0; --items) {
          if (!skip_field(line)) return false;
        }
      } else if (slots_[p] == kSkip) {
        if (!skip_field(line)) return false;
      } else if (!next_number(line, values[static_cast<std::size_t>(slots_[p])])) {
        return false;
      }
    }
    return true;
  }

  /// Moves past the ascii elements before the vertices. False if the file ends there.
  bool skip_elements_before(LineReader& reader) const {
    std::string_view line;
    for (std::size_t i = 0; i < vertex_; ++i) {
      for (std::uint64_t n = header_.elements[i].count; n > 0;) {
        if (!reader.next(line)) return false;
        if (!is_blank(line)) --n;
      }
    }
    return true;
  }

  void read_lines(const InputSlice& slice, ChunkSink& out, ReadCounts& counts) const {
    const bool in_order = mode_ == Mode::kInOrder;
    const ReadFile file = input_.open();
    LineReader reader(file, lines_, slice.begin, slice.end, options_.release_cache);
    std::uint64_t left = in_order ? element().count : ~std::uint64_t{0};
    std::string_view line;
    PlyValues values{};
    if (in_order && !skip_elements_before(reader)) {
      counts.missing = left;
      return;
    }
    while (left > 0 && reader.next(line)) {
      if (is_blank(line)) continue;
      std::string_view rest = line;
      const bool whole = parse(rest, values);
      // A last line without its end may be cut within a number: it is, where the header says that more
      // follows.
      if (!whole || (in_order && (left > 1 || !closing_) && !reader.complete())) {
        if (!reader.complete()) {
          if (!in_order) counts.missing = 1;
          counts.warnings.push_back(reader.torn_line());
          break;
        }
        throw InputError(reader.where() + ": '" + std::string(line.substr(0, 60)) +
                         "' is not a vertex with " + std::to_string(element().properties.size()) +
                         " values as the header declares; correct or remove the line");
      }
      if (!is_blank(rest)) ++counts.surplus;
      append(values, out.chunk());
      out.added();
      --left;
    }
    if (in_order) counts.missing = left;
  }

  /// Binary vertices with lists among their properties.
  void read_in_order(ChunkSink& out, ReadCounts& counts) const {
    const ReadFile file = input_.open();
    ByteWindow window(file, begin_, input_.size(), ByteWindow::kDefaultCapacity, options_.release_cache);
    PlyValues values{};
    std::uint64_t left = element().count;
    for (; left > 0; --left) {
      for (std::size_t p = 0; p < slots_.size(); ++p) {
        const PlyProperty& property = element().properties[p];
        const std::size_t head = scalar_bytes(property.list ? property.count_type : property.type);
        const std::string_view bytes = window.peek(head);
        if (bytes.size() < head) {
          counts.missing = left;
          return;
        }
        if (property.list) {
          const std::uint64_t items = load_integer(property.count_type, layout_.big_endian, bytes.data());
          const std::size_t item = scalar_bytes(property.type);
          window.skip(head);
          if (items > window.remaining() / item) {
            counts.missing = left;
            return;
          }
          window.skip(items * item);
        } else {
          if (slots_[p] != kSkip) {
            values[static_cast<std::size_t>(slots_[p])] =
                load_double(property.type, layout_.big_endian, bytes.data());
          }
          window.skip(head);
        }
      }
      append(values, out.chunk());
      out.added();
    }
  }

  ClosedFile input_;
  ReadOptions options_;
  PointFileInfo info_;
  PlyHeader header_;
  std::size_t vertex_ = 0;
  bool closing_ = true;                     ///< nothing is declared after the vertices
  std::vector<int> slots_;                  ///< per property of the vertex
  std::array<ScalarType, kSlots> types_{};  ///< per slot
  std::array<bool, kSlots> has_{};          ///< slots 0, 3, 6, 9: the group is there
  PointColumn intensity_;                   ///< binary: where it stands in a record
  bool unit_intensities_ = false;           ///< they are 0..1
  Mode mode_ = Mode::kInOrder;
  LineLayout lines_;
  std::uint64_t begin_ = 0;  ///< binary: byte offset of the first vertex
  PointRecordLayout layout_;
  RecordCount count_;
};

}  // namespace

std::unique_ptr<PointFile> open_ply_points(const ReadFile& file, const ReadOptions& options) {
  return std::make_unique<PlyPoints>(file, options);
}

}  // namespace tessera
