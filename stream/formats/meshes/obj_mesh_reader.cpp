/// Wavefront OBJ: `v x y z [r g b]` and `f` lines with v, v/t, v//n, v/t/n corners, positive or relative
/// indices, polygons of any length, lines continued by a backslash. Everything else is passed over.
#include <charconv>
#include <optional>
#include <string>
#include <utility>

#include "stream/formats/line_reader.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"
#include "stream/formats/text_scanner.h"

namespace tessera {
namespace {

class ObjMeshReader : public MeshReader {
 public:
  ObjMeshReader(ReadFile file, const MeshReadOptions& options)
      : file_(std::move(file)), options_(options), line_end_(detect_line_end(file_)) {
    header_.double_positions = true;
    read_front();
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, header_.colour);
    TextScanner text = scanner();
    std::uint64_t count = 0;
    do {
      if (word(text) != "v") continue;
      Double3 p;
      for (double& value : p) value = text.number("a coordinate", true);
      double rgb[3] = {0, 0, 0};
      std::size_t given = 0;
      while (header_.colour && given < 3) {
        const std::string_view found = word(text);
        if (found.empty()) break;
        if (!parse(found, rgb[given++])) throw InputError(text.where() + ": a colour is no number");
      }
      const bool known = given == 3;
      batch.add(p, known ? pack_rgba(colour_byte(rgb[0]), colour_byte(rgb[1]), colour_byte(rgb[2])) : 0);
      ++count;
    } while (text.next_line());
    batch.flush();
    vertices_ = count;
  }

  void read_faces(const FaceSink& sink) override {
    if (!vertices_) read_vertices([](auto, auto) {});
    TextScanner text = scanner();
    FaceBatch batch(sink, options_, *vertices_, [&] { return text.where(); });
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

 private:
  TextScanner scanner() const { return TextScanner(file_, 0, 1, line_end_, '#'); }

  /// The next word of the line; a lone backslash joins the next line to it.
  static std::string_view word(TextScanner& text) {
    std::string_view found = text.word_in_line();
    while (found == "\\") {
      if (!text.next_line()) return {};
      found = text.word_in_line();
    }
    return found;
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

  /// Comments before the first vertex, and whether that one has a colour.
  void read_front() {
    LineReader lines(file_, {0, 1, line_end_}, 0, file_.size(), false);
    constexpr std::size_t kMostComments = 100;
    std::string_view line;
    while (lines.next(line)) {
      if (line.starts_with("#")) {
        line.remove_prefix(1);
        if (line.starts_with(" ")) line.remove_prefix(1);
        if (!parse_shift(line, header_.shift) && header_.comments.size() < kMostComments) {
          header_.comments.emplace_back(line);
        }
      } else if (line.starts_with("v ")) {
        line.remove_prefix(2);
        int numbers = 0;
        for (double value = 0; next_number(line, value);) ++numbers;
        header_.colour = numbers >= 6;
        return;
      } else if (line.starts_with("f ")) {
        return;
      }
    }
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  const char line_end_;
  MeshHeader header_;
  const std::string format_ = "OBJ";
  std::optional<std::uint64_t> vertices_;  ///< known after a first pass
};

}  // namespace

std::unique_ptr<MeshReader> open_obj_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<ObjMeshReader>(std::move(file), options);
}

}  // namespace tessera
