#include "stream/formats/points/text_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/formats/closed_file.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/points/point_records.h"
#include "stream/formats/points/text_columns.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

constexpr std::size_t kSampleBytes = std::size_t{1} << 16;
constexpr std::uint64_t kSamples = 64;
constexpr int kSampleLines = 64;
constexpr std::size_t kFirstRows = 10000;
constexpr std::size_t kMaxColumns = 64;  ///< columns looked at when there are no names

using Values = std::array<double, kTextSlots>;

bool is_comment(std::string_view line) {
  const std::size_t at = line.find_first_not_of(" \t");
  return at != std::string_view::npos && (line[at] == '#' || line.substr(at, 2) == "//");
}

std::string_view without_comment_mark(std::string_view line) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t#/"), line.size()));
  return line;
}

/// How many numbers are at the front of the line, at most kMaxColumns.
std::size_t count_numbers(std::string_view line) {
  std::size_t n = 0;
  double value = 0;
  while (n < kMaxColumns && next_number(line, value)) ++n;
  return n;
}

/// What the rows that were looked at hold, column by column, to tell columns without names.
class RowStats {
 public:
  void add(std::string_view line) {
    std::array<double, kMaxColumns> v{};
    std::size_t n = 0;
    for (std::string_view rest = line; n < kMaxColumns && next_number(rest, v[n]); ++n) {
      const std::string_view token = line.substr(0, line.size() - rest.size());
      pointed_[n] = pointed_[n] || token.find_first_of(".eEdD") != std::string_view::npos;
      line = rest;
    }
    for (std::size_t i = 0; i < n; ++i) {
      ++rows_[i];
      bytes_[i] = bytes_[i] && v[i] >= 0 && v[i] <= 255 && v[i] == std::floor(v[i]);
      up_to_one_[i] = up_to_one_[i] && v[i] >= 0 && v[i] <= 1;
    }
    for (std::size_t i = 0; i + 3 <= n; ++i) {
      const double squared = v[i] * v[i] + v[i + 1] * v[i + 1] + v[i + 2] * v[i + 2];
      unit_[i] = unit_[i] && (squared == 0 || std::abs(squared - 1) < 0.05);
      any_[i] = any_[i] || squared != 0;
    }
    ++all_;
  }
  /// Three columns of unit vectors, of zeros at most a part.
  bool normals(std::size_t at) const { return in_all_rows(at, 3) && unit_[at] && any_[at]; }
  /// Three columns of whole numbers up to 255.
  bool bytes(std::size_t at) const { return in_all_rows(at, 3) && every(bytes_, at); }
  /// Three columns of 0..1, written as fractions.
  bool fractions(std::size_t at) const {
    return in_all_rows(at, 3) && every(up_to_one_, at) && every(pointed_, at);
  }

 private:
  using Flags = std::array<bool, kMaxColumns>;
  static Flags all_true() {
    Flags flags;
    flags.fill(true);
    return flags;
  }
  static bool every(const Flags& flags, std::size_t at) {
    return flags[at] && flags[at + 1] && flags[at + 2];
  }
  bool in_all_rows(std::size_t at, std::size_t n) const {
    return at + n <= kMaxColumns && rows_[at + n - 1] == all_;
  }

  std::size_t all_ = 0;
  std::array<std::size_t, kMaxColumns> rows_{};
  Flags bytes_ = all_true(), up_to_one_ = all_true(), unit_ = all_true();
  Flags any_{}, pointed_{};
};

/// The line is one whole number: the count line of PTS.
bool is_count(std::string_view line, std::uint64_t& count) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  return take_count(line, count) && is_blank(line);
}

TextColumns columns_by_name(std::string_view line) {
  std::vector<std::string> names;
  const char delimiter =
      line.find_first_of(",;\t") == std::string_view::npos ? ' ' : line[line.find_first_of(",;\t")];
  std::string_view field;
  if (delimiter == ' ') {
    while (!is_blank(line)) {
      line.remove_prefix(line.find_first_not_of(" \r"));
      const std::size_t end = std::min(line.find_first_of(" \r"), line.size());
      names.emplace_back(line.substr(0, end));
      line.remove_prefix(end);
    }
  } else {
    while (next_field(line, delimiter, field)) names.emplace_back(field);
    if (!names.empty() && names.back().empty()) names.pop_back();  // a separator at the end
  }
  return TextColumns::named(names);
}

std::size_t count_fields(std::string_view line) {
  std::size_t n = 0;
  while (n < kMaxColumns && skip_field(line)) ++n;
  return n;
}

/// What stands before the first point.
struct Opening {
  TextColumns named;         ///< by a header line, if there is one
  std::string first_header;  ///< the line of names that was not understood
  bool has_count = false;    ///< PTS
  std::uint64_t count = 0;
  std::string first_line;  ///< the first point
  LineLayout layout;
  bool found = false;  ///< there is a first point
};

/// \param given  columns that the user named; a line that fits them is a point, whatever it starts with
Opening read_opening(const ReadFile& file, const TextColumns& given) {
  Opening o;
  TextColumns commented;
  o.layout.line_end = detect_line_end(file);
  char mark[3] = {};
  if (file.size() >= 3) file.read_at(0, mark, 3);
  if (std::string_view(mark, 3) == "\xef\xbb\xbf") o.layout.data_begin = 3;  // UTF-8 byte order mark
  LineReader reader(file, o.layout, o.layout.data_begin, file.size(), false);
  std::string_view line;
  for (std::uint64_t number = 1; reader.next(line); ++number) {
    if (is_blank(line)) continue;
    if (is_comment(line)) {
      const std::string_view text = without_comment_mark(line);
      // Names start with x, or are names all of them; prose may have an x, y and z anywhere.
      const TextColumns names = columns_by_name(text);
      if (names.positions() &&
          (names.all_known() || text_column(text.substr(0, text.find_first_of(" ,;\t"))) == TextColumn::kX))
        commented = names;
      continue;
    }
    std::uint64_t count = 0;
    if (is_count(line, count)) {
      o.has_count = true;
      o.count = count;
      continue;
    }
    std::string_view rest = line;
    double value = 0;
    Values values{};
    TextDialectVote vote;
    vote.add(line);
    const TextDialect dialect = vote.decide(line);
    std::string buffer;
    const bool fits =
        given.positions() && given.parse(dialect.plain(line, buffer), dialect.delimiter, values);
    if (!fits && !next_number(rest, value) && o.first_header.empty()) {
      o.first_header = line.substr(0, 200);
      o.named = columns_by_name(line);
      continue;
    }
    if (!o.named.positions() && commented.positions() && commented.count() <= count_fields(line))
      o.named = commented;
    o.first_line = line;
    o.found = true;
    o.layout.data_begin = reader.line_offset();
    o.layout.first_line = number;
    return o;
  }
  o.layout.data_begin = file.size();
  return o;
}

/// Of the file, or of what was packed into it.
std::string text_extension(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".gz" || extension == ".zst" ? lower_extension(path.stem()) : extension;
}

class TextPoints final : public PointFile {
 public:
  TextPoints(const ReadFile& file, const ReadOptions& options) : input_(file), options_(options) {
    TextColumns given;
    if (!options_.columns.empty()) {
      given = TextColumns::named(options_.columns);
      if (!given.positions()) throw UsageError("--columns must name x, y and z");
    }
    const Opening opening = read_opening(file, given);
    layout_ = opening.layout;
    counted_ = opening.has_count;
    TextDialectVote vote;
    for_first_rows([&](std::string_view line) { vote.add(line); });
    dialect_ = vote.decide(opening.first_line);
    name_columns(opening, given);
    if (columns_.colours()) colour_scale_ = colour_scale();
    info_.path = input_.path();
    info_.bytes = input_.size();
    info_.packed = true;
    info_.declared_points = opening.has_count ? opening.count : 0;
    info_.attributes.normals = columns_.normals();
    info_.attributes.colour = columns_.colours();
    info_.attributes.intensity = columns_.has(TextColumn::kIntensity);
    info_.left_out = columns_.left_out();
    if (columns_.geographic()) info_.crs = longitude_and_latitude();
    info_.format = std::string(counted_ ? "PTS" : "text") + " with columns " + columns_.names() +
                   (dialect_.decimal_comma ? ", decimal commas" : "") + input_.packed_words();
  }

  const PointFileInfo& info() const override { return info_; }

  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const override {
    return even_slices(file, layout_.data_begin, input_.size(), 1, input_.slice_bytes(target_bytes));
  }

  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    ChunkSink out(options_.chunk_points, sink);
    ReadCounts counts;
    const ReadFile file = input_.open();
    LineReader reader(file, layout_, slice.begin, slice.end, options_.release_cache);
    std::string_view line;
    std::string buffer;
    Values values{};
    while (reader.next(line)) {
      if (is_comment(line)) continue;
      if (columns_.parse(dialect_.plain(line, buffer), dialect_.delimiter, values)) {
        append_values(values, info_.attributes, colour_scale_, out.chunk());
        out.added();
      } else if (!is_skipped(line)) {
        if (!reader.complete()) {
          counts.missing = 1;
          counts.warnings.push_back(reader.torn_line());
          break;
        }
        throw InputError(reader.where() + ": '" + std::string(line.substr(0, 60)) +
                         "' is not a point with columns " + columns_.names() +
                         "; correct or remove the line, or name the columns with --columns");
      }
    }
    out.flush();
    counts.points = out.points();
    return counts;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(input_.path().string() + ": " + what);
  }

  /// Blank lines, comments, and the count lines of files that were put together of several.
  bool is_skipped(std::string_view line) const {
    std::uint64_t count = 0;
    return is_blank(line) || is_comment(line) || (counted_ && is_count(line, count));
  }

  /// Calls f with the first rows, at most 10,000.
  template <class F>
  void for_first_rows(F&& f) const {
    const ReadFile file = input_.open();
    LineReader reader(file, layout_, layout_.data_begin, input_.size(), false);
    std::string_view line;
    for (std::size_t rows = 0; rows < kFirstRows && reader.next(line);) {
      if (is_skipped(line) || !(reader.complete() || rows == 0)) continue;
      f(line);
      ++rows;
    }
  }

  /// Calls f with the first rows and with lines at 64 places of the file, 64 at each, the same whatever slices are read;
  /// as parse() wants them.
  template <class F>
  void for_sampled_lines(F&& f) const {
    std::string buffer;
    const auto plain = [&](std::string_view line) { f(dialect_.plain(line, buffer)); };
    for_first_rows(plain);
    const ReadFile file = input_.open();
    const std::uint64_t bytes = input_.size() - layout_.data_begin;
    const std::uint64_t step = std::max<std::uint64_t>(bytes / kSamples, kSampleBytes);
    for (std::uint64_t at = 0; at < bytes; at += step) {
      const std::uint64_t begin = layout_.data_begin + at;
      const std::uint64_t end = std::min<std::uint64_t>(input_.size(), begin + kSampleBytes);
      LineReader reader(file, layout_, begin, end, false, kSampleBytes);
      std::string_view line;
      for (int i = 0; i < kSampleLines && reader.next(line); ++i) {
        const bool whole = reader.complete() || reader.line_offset() == layout_.data_begin;
        if (whole && !is_skipped(line)) plain(line);
      }
    }
  }

  void name_columns(const Opening& opening, const TextColumns& given) {
    std::string buffer;
    const std::size_t numbers = count_numbers(dialect_.plain(opening.first_line, buffer));
    if (given.positions()) {
      columns_ = given;
    } else if (opening.named.positions()) {
      columns_ = opening.named;
    } else if (!opening.first_header.empty()) {
      fail("the header line '" + opening.first_header.substr(0, 80) +
           "' does not name columns x, y and z; name all columns with --columns");
    } else if (numbers < 3) {
      fail(!opening.found
               ? "there is no line with a point"
               : "line " + std::to_string(layout_.first_line) + ": '" + opening.first_line.substr(0, 60) +
                     "' has fewer than three numbers; this is not a text file of points");
    } else if (text_extension(input_.path()) == ".neu") {
      fail(
          "north, east, up or x, y, z: nothing tells the order of the columns; name them with --columns, as "
          "y,x,z or x,y,z");
    } else {
      columns_ = guess(numbers);
    }
    if (columns_.repeated() != TextColumn::kOther) {
      const std::string what =
          "column " + std::string(text_column_name(columns_.repeated())) + " is named twice";
      if (!options_.columns.empty()) throw UsageError("--columns: " + what);
      fail("the header line: " + what);
    }
  }

  TextColumns guess(std::size_t count) const {
    RowStats rows;
    for_sampled_lines([&](std::string_view line) { rows.add(line); });
    std::vector<TextColumn> columns(count, TextColumn::kOther);
    const auto name = [&](std::size_t at, TextColumn first, std::size_t n) {
      for (std::size_t i = 0; i < n; ++i)
        columns[at + i] = static_cast<TextColumn>(static_cast<std::size_t>(first) + i);
    };
    name(0, TextColumn::kX, 3);
    const std::string extension = text_extension(input_.path());
    bool normals = false;
    bool colours = false;
    std::size_t at = 3;
    if (extension == ".xyzrgb" && count >= 6) {
      name(at, TextColumn::kRed, 3), colours = true, at += 3;
    } else if (extension == ".xyzn" && count >= 6) {
      name(at, TextColumn::kNx, 3), normals = true, at += 3;
    } else if ((counted_ || extension == ".pts") && (count == 4 || count >= 7) &&
               !(count == 9 && rows.bytes(3) && rows.normals(6))) {
      columns[at++] = TextColumn::kIntensity;
    }
    while (at + 3 <= count) {
      const bool is_normal = !normals && rows.normals(at) && !(count == 7 && at == 3 && rows.bytes(4));
      const bool is_colour = !is_normal && !colours && (rows.bytes(at) || rows.fractions(at));
      if (is_normal || is_colour) {
        name(at, is_normal ? TextColumn::kNx : TextColumn::kRed, 3);
        (is_normal ? normals : colours) = true;
        at += 3;
      } else {
        ++at;
      }
    }
    return TextColumns(std::move(columns));
  }

  ColourScale colour_scale() const {
    double largest = 0;
    bool pointed = false;
    Values values{};
    for_sampled_lines([&](std::string_view line) {
      if (!columns_.parse(line, dialect_.delimiter, values)) return;
      for (std::size_t c = 6; c < 9; ++c) largest = std::max(largest, values[c]);
      pointed = pointed || columns_.has_pointed_colours(line, dialect_.delimiter);
    });
    // Whole numbers up to 1 are the darkest of bytes, as far as nothing names them otherwise.
    const bool fractions = pointed || columns_.unit_colours();
    return colour_scale_for(fractions ? ScalarType::kFloat64 : ScalarType::kUint16, largest);
  }

  ClosedFile input_;
  ReadOptions options_;
  PointFileInfo info_;
  LineLayout layout_;
  TextColumns columns_;
  TextDialect dialect_;
  bool counted_ = false;  ///< a PTS file: lines of one whole number are counts
  ColourScale colour_scale_ = ColourScale::kByte;
};

}  // namespace

bool is_text_points_extension(const std::string& extension) {
  constexpr std::array<std::string_view, 9> kExtensions = {".xyz",  ".pts", ".csv", ".asc", ".xyzrgb",
                                                           ".xyzn", ".txt", ".dat", ".neu"};
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

bool is_printable(const ReadFile& file) {
  char bytes[1024];
  const std::uint64_t there = std::min<std::uint64_t>(file.size(), sizeof bytes);
  file.read_at(0, bytes, there);
  for (std::uint64_t i = 0; i < there; ++i) {
    const auto c = static_cast<unsigned char>(bytes[i]);
    if (c < 32 && c != '\t' && c != '\n' && c != '\r') return false;
  }
  return true;
}

bool looks_like_text_points(const ReadFile& file) {
  if (!is_printable(file)) return false;
  const Opening opening = read_opening(file, {});
  return opening.found && (opening.named.positions() || count_numbers(opening.first_line) >= 3);
}

std::unique_ptr<PointFile> open_text_points(const ReadFile& file, const ReadOptions& options) {
  return std::make_unique<TextPoints>(file, options);
}

}  // namespace tessera
