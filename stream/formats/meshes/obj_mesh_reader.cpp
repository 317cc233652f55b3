/// Wavefront OBJ: `v x y z [r g b]` and `f` lines with v, v/t, v//n, v/t/n corners, positive or relative
/// indices, polygons of any shape, lines continued by a backslash. Of everything else warnings() tells what is left out.
#include <array>
#include <charconv>
#include <optional>
#include <string>
#include <utility>

#include "stream/formats/colour_range.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"
#include "stream/formats/text_scanner.h"

namespace tessera {
namespace {

/// What is read past, by the keyword of its lines.
struct ObjLeftOut {
  const char* keyword;
  const char* what;
};
constexpr std::array kLeftOut = {ObjLeftOut{"vt", "texture coordinates"},
                                 ObjLeftOut{"usemtl", "materials"},
                                 ObjLeftOut{"l", "lines"},
                                 ObjLeftOut{"curv", "free-form curves"},
                                 ObjLeftOut{"surf", "free-form surfaces"},
                                 ObjLeftOut{"#MRGB", "polypaint colours (#MRGB)"}};

class ObjMeshReader : public MeshReader {
 public:
  ObjMeshReader(ReadFile file, const MeshReadOptions& options)
      : file_(std::move(file)),
        options_(options),
        line_end_(detect_line_end(file_)),
        begin_(byte_order_mark(file_)),
        polygons_([this](const VertexSink& sink) { read_vertices(sink); }, options.temp) {
    header_.double_positions = true;
    read_comments();
    look_at_colours();
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, header_.colour);
    TextScanner text = scanner();
    std::uint64_t count = 0;
    do {
      const std::string_view keyword = word(text);
      if (keyword != "v") {
        note(keyword);
        continue;
      }
      const Double3 p = position(text);
      std::array<double, 3> rgb{};
      const bool known = header_.colour && colour(text, rgb) >= 3;
      batch.add(p,
                known ? pack_rgba(colours_.byte(rgb[0]), colours_.byte(rgb[1]), colours_.byte(rgb[2])) : 0);
      ++count;
    } while (text.next_line());
    batch.flush();
    vertices_ = count;
  }

  void read_faces(const FaceSink& sink) override {
    if (!vertices_) read_vertices([](auto, auto) {});
    TextScanner text = scanner();
    FaceBatch batch(
        sink, options_, *vertices_, [&] { return text.where(); }, &polygons_);
    std::uint64_t seen = 0;
    do {
      const std::string_view keyword = word(text);
      if (keyword == "v") ++seen;
      if (keyword != "f" && keyword != "fo") continue;
      batch.begin_polygon();
      for (std::string_view corner = word(text); !corner.empty(); corner = word(text)) {
        batch.corner(index_of(text, corner, seen));
      }
      batch.end_polygon();
    } while (text.next_line());
    batch.flush();
  }

  std::vector<std::string> warnings() const override {
    std::vector<std::string> all = list_left_out(left_out_names());
    if (header_.colour && !colours_.note().empty()) all.push_back(colours_.note());
    if (const std::string folded = polygons_.warning(); !folded.empty()) all.push_back(folded);
    return all;
  }

 private:
  // Comments are words here, since one kind of them holds colours.
  TextScanner scanner() const { return TextScanner(file_, begin_, 1, line_end_, '\0'); }

  /// The next word of the line, empty at its end or before a comment; a backslash at its end joins the next line to it.
  std::string_view word(TextScanner& text) {
    for (;;) {
      const std::string_view found = text.word_in_line();
      if (found.starts_with("#")) return found.starts_with("#MRGB") ? found.substr(0, 5) : std::string_view();
      if (found.empty() || found.back() != '\\') return found;
      joined_ = found;
      if (!text.line_done()) return joined_;  // as in a path of Windows
      joined_.pop_back();
      if (!text.next_line() || !joined_.empty()) return joined_;
    }
  }

  Double3 position(TextScanner& text) {
    Double3 p;
    for (double& value : p) {
      const std::string_view found = word(text);
      if (!parse(found, value))
        throw InputError(
            text.where() + ": " +
            (found.empty() ? "the line ends" : "'" + std::string(found.substr(0, 40)) + "' stands") +
            " where a coordinate should be");
    }
    return p;
  }

  /// Takes up to three numbers of a colour; returns how many there are.
  std::size_t colour(TextScanner& text, std::array<double, 3>& rgb) {
    std::size_t given = 0;
    for (; given < 3; ++given) {
      const std::string_view found = word(text);
      if (found.empty()) break;
      if (!parse(found, rgb[given])) throw InputError(text.where() + ": a colour is no number");
    }
    return given;
  }

  static bool parse(std::string_view word, double& value) { return take_number(word, value) && word.empty(); }

  /// A corner's vertex, from 0. Relative indices count back from the last vertex before the line.
  static std::uint64_t index_of(const TextScanner& text, std::string_view corner, std::uint64_t seen) {
    std::int64_t index = 0;
    const auto [end, error] = std::from_chars(corner.data(), corner.data() + corner.size(), index);
    const bool whole = end == corner.data() + corner.size() || *end == '/';
    if (error != std::errc() || !whole || index == 0) {
      throw InputError(text.where() + ": a corner of a face is not a vertex number (they start at 1), but '" +
                       std::string(corner.substr(0, 40)) + "'");
    }
    return static_cast<std::uint64_t>(index > 0 ? index - 1 : static_cast<std::int64_t>(seen) + index);
  }

  void note(std::string_view keyword) {
    for (std::size_t i = 0; i < kLeftOut.size(); ++i)
      if (keyword == kLeftOut[i].keyword) left_out_[i] = true;
  }
  std::vector<std::string> left_out_names() const {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < kLeftOut.size(); ++i)
      if (left_out_[i]) names.emplace_back(kLeftOut[i].what);
    return names;
  }

  /// Comments before the first vertex.
  void read_comments() {
    LineReader lines(file_, {begin_, 1, line_end_}, begin_, file_.size(), false);
    constexpr std::size_t kMaxComments = 100;
    std::string_view line;
    while (lines.next(line)) {
      if (line.starts_with("v ") || line.starts_with("f ")) return;
      if (!line.starts_with("#")) continue;
      line.remove_prefix(1);
      if (line.starts_with(" ")) line.remove_prefix(1);
      if (!parse_shift(line, header_.shift) && header_.comments.size() < kMaxComments) {
        header_.comments.emplace_back(line);
      }
    }
  }

  /// Whether the first vertices have colours, and how wide their range is.
  void look_at_colours() {
    TextScanner text = scanner();
    std::uint64_t seen = 0;
    do {
      if (word(text) != "v") continue;
      ++seen;
      Double3 p;
      std::array<double, 3> rgb{};
      bool plain = true;  // what is no number is told of when it is read
      for (double& value : p) plain = plain && parse(word(text), value);
      for (double& value : rgb) plain = plain && parse(word(text), value);
      if (!plain) {
        if (seen == 1) return;  // a mesh of many vertices without colours is not searched for one
        continue;
      }
      header_.colour = true;
      for (const double value : rgb) colours_.add(value);
    } while (seen < ColourRange::kRows && text.next_line());
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  const char line_end_;
  const std::uint64_t begin_;  ///< of the text
  MeshHeader header_;
  const std::string format_ = "OBJ";
  ColourRange colours_;
  PolygonFaces polygons_;
  std::array<bool, kLeftOut.size()> left_out_{};
  std::string joined_;                     ///< a word that ends with a backslash
  std::optional<std::uint64_t> vertices_;  ///< known after a first pass
};

}  // namespace

std::unique_ptr<MeshReader> open_obj_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<ObjMeshReader>(std::move(file), options);
}

}  // namespace tessera
