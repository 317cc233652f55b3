/// Object File Format, text: optional ST, C and N before OFF, or none where lines of vertices hold more than a position all
/// the same; comments; polygons. After the position come a normal, a colour and texture coordinates, in this order.
/// Source: Geomview, "The OOGL File Formats".
#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "stream/formats/colour_range.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"
#include "stream/formats/text_scanner.h"

namespace tessera {
namespace {

class OffMeshReader : public MeshReader {
 public:
  OffMeshReader(ReadFile file, const MeshReadOptions& options)
      : file_(std::move(file)),
        options_(options),
        line_end_(detect_line_end(file_)),
        polygons_([this](const VertexSink& sink) { read_vertices(sink); }, options.temp) {
    header_.double_positions = true;
    TextScanner text = scanner();
    read_header(text);
    layout_ = declared_;
    if (!declared_.colour && !declared_.texture) look_at_lines(text);
    header_.colour = layout_.colour && look_at_colours();
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }

  void read_vertices(const VertexSink& sink) override {
    TextScanner text = scanner();
    read_header(text);
    VertexBatch batch(sink, header_.colour);
    pass_vertices(text, &batch);
    batch.flush();
  }

  void read_faces(const FaceSink& sink) override {
    TextScanner text = scanner();
    read_header(text);
    pass_vertices(text, nullptr);
    FaceBatch batch(
        sink, options_, header_.vertices, [&] { return text.where(); }, &polygons_);
    for (std::uint64_t i = 0; i < header_.faces; ++i) {
      const std::uint64_t corners = text.count("the number of corners of a face");
      batch.begin_polygon();
      for (std::uint64_t k = 0; k < corners; ++k) batch.corner(text.count("a vertex index"));
      batch.end_polygon();
      face_colours_ = face_colours_ || !text.line_done();
      text.next_line();  // the rest is a colour
    }
    batch.flush();
  }

  std::vector<std::string> warnings() const override {
    std::vector<std::string> left_out;
    if (layout_.texture) left_out.emplace_back("texture coordinates");
    if (face_colours_) left_out.emplace_back("colours of faces");
    if (layout_.unknown) left_out.emplace_back("further numbers of vertices");
    std::vector<std::string> all = list_left_out(left_out);
    if (!layout_.note.empty()) all.push_back(layout_.note);
    if (header_.colour && !colours_.note().empty()) all.push_back(colours_.note());
    if (const std::string folded = polygons_.warning(); !folded.empty()) all.push_back(folded);
    return all;
  }

 private:
  /// What follows a position on its line.
  struct Layout {
    bool normal = false, colour = false, texture = false;
    bool by_line = false;  ///< every vertex has a line of its own, to its end
    bool unknown = false;  ///< it holds more than is known of
    std::string note;      ///< what was decided
  };

  TextScanner scanner() const { return TextScanner(file_, byte_order_mark(file_), 1, line_end_, '#'); }

  void read_header(TextScanner& text) {
    std::string word(text.word());
    std::string upper = word;  // "4" and "n" stay as they are
    if (word.find("OFF") == std::string::npos)
      for (char& c : upper) c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
    const std::size_t off = upper.find("OFF");
    if (off == std::string::npos) throw InputError(text.where() + ": the file does not begin with OFF");
    const std::string prefix = upper.substr(0, off);
    if (prefix.find_first_not_of("STCN") != std::string::npos) {
      throw InputError(text.where() + ": OFF files with the prefix '" + prefix +
                       "' are not read (no 4D or nD vertices); convert it to PLY");
    }
    const auto has = [&](char c) { return prefix.find(c) != std::string::npos; };
    declared_ = {has('N'), has('C'), has('S'), has('C') || has('S'), false, {}};
    std::string_view rest = std::string_view(word).substr(off + 3);
    if (rest.empty()) {
      header_.vertices = count_or_binary(text);
    } else if (!take_count(rest, header_.vertices) || !rest.empty()) {  // "OFF8": some files lack the space
      throw InputError(text.where() + ": a count should follow OFF");
    }
    header_.faces = text.count("the number of faces");
    text.word_in_line();  // the number of edges, often wrong or missing
  }

  static std::uint64_t count_or_binary(TextScanner& text) {
    const std::string word(text.word());
    if (word == "BINARY") throw InputError(text.where() + ": binary OFF is not read; convert it to PLY");
    std::string_view rest = word;
    std::uint64_t count = 0;
    if (!take_count(rest, count) || !rest.empty()) {
      throw InputError(text.where() + ": the number of vertices should follow OFF");
    }
    return count;
  }

  /// Numbers that a line of a vertex may hold behind its position.
  static constexpr std::size_t kMaxExtra = 16;

  void pass_vertices(TextScanner& text, VertexBatch* batch) const {
    std::array<double, kMaxExtra> extra{};
    for (std::uint64_t i = 0; i < header_.vertices; ++i) {
      Double3 p;
      for (double& value : p) value = text.number("a coordinate");
      if (layout_.normal) {
        for (int k = 0; k < 3; ++k) text.number("a normal", true);
      }
      std::uint32_t rgba = 0;
      if (layout_.by_line) {
        const std::size_t given = rest_of_line(text, extra);
        if (header_.colour && batch != nullptr) rgba = pack(extra, colours_in(given));
      }
      if (batch != nullptr) batch->add(p, rgba);
    }
  }

  /// The numbers up to the end of the line; returns how many there are, of which at most kMaxExtra are kept.
  static std::size_t rest_of_line(TextScanner& text, std::array<double, kMaxExtra>& extra) {
    std::size_t given = 0;
    for (std::string_view word = text.word_in_line(); !word.empty(); word = text.word_in_line()) {
      double value = 0.0;
      if (!take_number(word, value) || !word.empty())
        throw InputError(text.where() + ": a colour is no number");
      if (given < kMaxExtra) extra[given++] = value;
    }
    return given;
  }
  std::size_t colours_in(std::size_t given) const {
    return std::min<std::size_t>(layout_.texture && given >= 2 ? given - 2 : given, 4);
  }
  std::uint32_t pack(const std::array<double, kMaxExtra>& c, std::size_t given) const {
    if (given < 3) return 0;
    return pack_rgba(colours_.byte(c[0]), colours_.byte(c[1]), colours_.byte(c[2]),
                     colours_.byte(given > 3 ? c[3] : colours_.opaque()));
  }

  /// Where every vertex has a line of its own and all hold as many numbers, other than the keyword tells: those decide.
  /// Colours are never negative, normals of a mesh are somewhere. \param text  behind the counts
  void look_at_lines(TextScanner& text) {
    const std::size_t declared = declared_.normal ? 6 : 3;
    std::size_t columns = 0;
    bool negative = false;
    for (std::uint64_t i = 0; i < header_.vertices; ++i) {
      std::string_view word = text.word();
      std::size_t given = 0;
      for (; !word.empty(); word = text.word_in_line(), ++given) {
        double value = 0.0;
        if (!take_number(word, value) || !word.empty()) return;  // told of when it is read
        if (given >= 3 && given < 6) negative = negative || value < 0.0;
      }
      if (i == 0) columns = given;
      if (given < 3 || given == declared || given != columns) return;
    }
    if (columns < 3) return;
    const std::size_t more = columns - 3;
    Layout& l = layout_;
    l.by_line = true;
    l.texture = more == 2 || more == 5 || more == 8;
    l.normal = more >= 6 || (more >= 3 && declared_.normal) || (negative && (more == 3 || more == 5));
    const std::size_t left = more - (l.normal ? 3 : 0) - (l.texture ? 2 : 0);
    l.colour = left == 3 || left == 4;
    l.unknown = left > 0 && !l.colour;
    l.note = "lines of vertices hold " + std::to_string(columns) + " numbers, not " +
             std::to_string(declared) + " as the keyword says: after the position there is " +
             (l.normal && l.colour ? "a normal and a colour"
              : l.normal           ? "a normal"
              : l.colour           ? "a colour"
                                   : "neither a normal nor a colour");
  }

  /// The range of the colours of the first vertices; false if none has one.
  bool look_at_colours() {
    TextScanner text = scanner();
    read_header(text);
    std::array<double, kMaxExtra> extra{};
    bool any = false;
    for (std::uint64_t i = 0; i < std::min(header_.vertices, ColourRange::kRows); ++i) {
      for (int k = layout_.normal ? 6 : 3; k > 0; --k) {
        double ignored = 0.0;
        std::string_view word = text.word();
        if (!take_number(word, ignored)) return any;  // told of when it is read
      }
      const std::size_t given = colours_in(rest_of_line(text, extra));
      any = any || given >= 3;
      for (std::size_t c = 0; given >= 3 && c < given; ++c) colours_.add(extra[c]);
    }
    return any;
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  const char line_end_;
  Layout declared_;  ///< by the keyword
  Layout layout_;
  bool face_colours_ = false;
  MeshHeader header_;
  const std::string format_ = "OFF";
  ColourRange colours_;
  PolygonFaces polygons_;
};

}  // namespace

std::unique_ptr<MeshReader> open_off_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<OffMeshReader>(std::move(file), options);
}

}  // namespace tessera
