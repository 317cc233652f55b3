#include "stream/formats/points/text_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "octree/error.h"
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
constexpr int kMaxColumns = 64;  ///< columns looked at when there are no names

using Values = std::array<double, kTextSlots>;

bool is_comment(std::string_view line) {
  const std::size_t at = line.find_first_not_of(" \t");
  return at != std::string_view::npos && (line[at] == '#' || line.substr(at, 2) == "//");
}

std::string_view without_comment_mark(std::string_view line) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t#/"), line.size()));
  return line;
}

/// Numbers at the front of the line, at most kMaxColumns.
std::vector<double> numbers_of(std::string_view line) {
  std::vector<double> values;
  double value = 0;
  while (values.size() < kMaxColumns && next_number(line, value)) values.push_back(value);
  return values;
}

/// The line is one whole number: the count line of PTS.
bool is_count(std::string_view line, std::uint64_t& count) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  return take_count(line, count) && is_blank(line);
}

TextColumns columns_by_name(std::string_view line) {
  std::vector<TextColumn> columns;
  const char delimiter =
      line.find_first_of(",;\t") == std::string_view::npos ? ' ' : line[line.find_first_of(",;\t")];
  std::string_view field;
  if (delimiter == ' ') {
    while (!is_blank(line)) {
      line.remove_prefix(line.find_first_not_of(" \r"));
      const std::size_t end = std::min(line.find_first_of(" \r"), line.size());
      columns.push_back(text_column(line.substr(0, end)));
      line.remove_prefix(end);
    }
  } else {
    while (next_field(line, delimiter, field)) columns.push_back(text_column(field));
  }
  return TextColumns(std::move(columns));
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
      // Names start with x; prose may have an x, y and z anywhere.
      if (text_column(text.substr(0, text.find_first_of(" ,;\t"))) == TextColumn::kX) {
        commented = columns_by_name(text);
      }
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
    const bool fits = given.positions() && given.parse(line, text_delimiter(line), values);
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

class TextPoints final : public PointFile {
 public:
  TextPoints(const ReadFile& file, const ReadOptions& options) : input_(file), options_(options) {
    TextColumns given;
    if (!options_.columns.empty()) {
      std::vector<TextColumn> columns;
      for (const std::string& name : options_.columns) columns.push_back(text_column(name));
      given = TextColumns(std::move(columns));
      if (!given.positions()) throw UsageError("--columns must name x, y and z");
    }
    const Opening opening = read_opening(file, given);
    layout_ = opening.layout;
    counted_ = opening.has_count;
    delimiter_ = text_delimiter(opening.first_line);
    const std::vector<std::vector<double>> samples = sample();
    name_columns(opening, given, samples);
    if (columns_.colours()) colour_scale_ = colour_scale();
    info_.path = input_.path();
    info_.bytes = input_.size();
    info_.packed = true;
    info_.declared_points = opening.has_count ? opening.count : 0;
    info_.attributes.normals = columns_.normals();
    info_.attributes.colour = columns_.colours();
    info_.attributes.intensity = columns_.has(TextColumn::kIntensity);
    info_.format =
        std::string(counted_ ? "PTS" : "text") + " with columns " + columns_.names() + input_.packed_words();
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
    Values values{};
    while (reader.next(line)) {
      if (is_comment(line)) continue;
      if (columns_.parse(line, delimiter_, values)) {
        append_values(values, info_.attributes, colour_scale_, out.chunk());
        out.added();
      } else if (!passed_over(line)) {
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
  bool passed_over(std::string_view line) const {
    std::uint64_t count = 0;
    return is_blank(line) || is_comment(line) || (counted_ && is_count(line, count));
  }

  /// Calls f with lines at 64 places of the file, 64 at each, the same whatever slices are read.
  template <class F>
  void for_sampled_lines(F&& f) const {
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
        if (whole && !passed_over(line)) f(line);
      }
    }
  }

  std::vector<std::vector<double>> sample() const {
    std::vector<std::vector<double>> samples;
    for_sampled_lines([&](std::string_view line) { samples.push_back(numbers_of(line)); });
    return samples;
  }

  void name_columns(const Opening& opening, const TextColumns& given,
                    const std::vector<std::vector<double>>& samples) {
    if (given.positions()) {
      columns_ = given;
    } else if (opening.named.positions()) {
      columns_ = opening.named;
    } else if (!opening.first_header.empty()) {
      fail("the header line '" + opening.first_header.substr(0, 80) +
           "' does not name columns x, y and z; name all columns with --columns");
    } else if (numbers_of(opening.first_line).size() < 3) {
      fail(!opening.found
               ? "there is no line with a point"
               : "line " + std::to_string(layout_.first_line) + ": '" + opening.first_line.substr(0, 60) +
                     "' has fewer than three numbers; this is not a text file of points");
    } else {
      columns_ = guess(samples, numbers_of(opening.first_line).size());
    }
    if (columns_.repeated() != TextColumn::kOther) {
      const std::string what =
          "column " + std::string(text_column_name(columns_.repeated())) + " is named twice";
      if (!options_.columns.empty()) throw UsageError("--columns: " + what);
      fail("the header line: " + what);
    }
  }

  TextColumns guess(const std::vector<std::vector<double>>& samples, std::size_t count) const {
    std::vector<TextColumn> columns(count, TextColumn::kOther);
    std::copy_n(std::array{TextColumn::kX, TextColumn::kY, TextColumn::kZ}.begin(), 3, columns.begin());
    bool normals = false;
    bool colours = false;
    std::size_t at = 3;
    if (counted_ && (count == 4 || count == 7)) columns[at++] = TextColumn::kIntensity;
    while (at + 3 <= count) {
      const bool unit = !normals && all(samples, at, [](const double* v) {
        const double squared = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        return squared == 0 || std::abs(squared - 1) < 0.05;
      }) && any(samples, at, [](const double* v) { return v[0] != 0 || v[1] != 0 || v[2] != 0; });
      const bool bytes = !unit && !colours && all(samples, at, [](const double* v) {
        return std::all_of(v, v + 3, [](double c) { return c >= 0 && c <= 255 && c == std::floor(c); });
      });
      if (unit || bytes) {
        const auto first = static_cast<std::size_t>(unit ? TextColumn::kNx : TextColumn::kRed);
        for (std::size_t i = 0; i < 3; ++i) columns[at + i] = static_cast<TextColumn>(first + i);
        (unit ? normals : colours) = true;
        at += 3;
      } else {
        ++at;
      }
    }
    return TextColumns(std::move(columns));
  }

  template <class F>
  static bool all(const std::vector<std::vector<double>>& samples, std::size_t at, F&& f) {
    return std::all_of(samples.begin(), samples.end(),
                       [&](const std::vector<double>& v) { return v.size() >= at + 3 && f(v.data() + at); });
  }
  template <class F>
  static bool any(const std::vector<std::vector<double>>& samples, std::size_t at, F&& f) {
    return std::any_of(samples.begin(), samples.end(),
                       [&](const std::vector<double>& v) { return v.size() >= at + 3 && f(v.data() + at); });
  }

  ColourScale colour_scale() const {
    double largest = 0;
    bool whole = true;
    Values values{};
    for_sampled_lines([&](std::string_view line) {
      if (!columns_.parse(line, delimiter_, values)) return;
      for (std::size_t c = 6; c < 9; ++c) {
        if (values[c] > largest) largest = values[c];
        whole = whole && values[c] == std::floor(values[c]);
      }
    });
    if (largest > 255) return ColourScale::kHighByte;
    return largest <= 1 && !whole ? ColourScale::kUnit : ColourScale::kByte;
  }

  ClosedFile input_;
  ReadOptions options_;
  PointFileInfo info_;
  LineLayout layout_;
  TextColumns columns_;
  char delimiter_ = ' ';
  bool counted_ = false;  ///< a PTS file: lines of one whole number are counts
  ColourScale colour_scale_ = ColourScale::kByte;
};

}  // namespace

bool looks_like_text_points(const ReadFile& file) {
  char bytes[1024];
  const std::uint64_t there = std::min<std::uint64_t>(file.size(), sizeof bytes);
  file.read_at(0, bytes, there);
  for (std::uint64_t i = 0; i < there; ++i) {
    const auto c = static_cast<unsigned char>(bytes[i]);
    if (c < 32 && c != '\t' && c != '\n' && c != '\r') return false;
  }
  const Opening opening = read_opening(file, {});
  return opening.found && (opening.named.positions() || numbers_of(opening.first_line).size() >= 3);
}

std::unique_ptr<PointFile> open_text_points(const ReadFile& file, const ReadOptions& options) {
  return std::make_unique<TextPoints>(file, options);
}

}  // namespace tessera
