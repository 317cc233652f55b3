/// Object File Format, text: optional ST, C, N and 4 before OFF; comments; colours of vertices; polygons.
#include <string>
#include <utility>

#include "stream/formats/line_reader.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"
#include "stream/formats/text_scanner.h"

namespace tessera {
namespace {

class OffMeshReader : public MeshReader {
 public:
  OffMeshReader(ReadFile file, const MeshReadOptions& options)
      : file_(std::move(file)), options_(options), line_end_(detect_line_end(file_)) {
    header_.double_positions = true;
    TextScanner text = scanner();
    read_header(text);
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
    FaceBatch batch(sink, options_, header_.vertices, [&] { return text.where(); });
    for (std::uint64_t i = 0; i < header_.faces; ++i) {
      const std::uint64_t corners = text.count("the number of corners of a face");
      batch.begin_polygon();
      for (std::uint64_t k = 0; k < corners; ++k) batch.corner(text.count("a vertex index"));
      batch.end_polygon();
      text.next_line();  // the rest is a colour
    }
    batch.flush();
  }

 private:
  TextScanner scanner() const { return TextScanner(file_, 0, 1, line_end_, '#'); }

  void read_header(TextScanner& text) {
    std::string word(text.word());
    const std::size_t off = word.find("OFF");
    if (off == std::string::npos) throw InputError(text.where() + ": the file does not begin with OFF");
    const std::string prefix = word.substr(0, off);
    if (prefix.find_first_not_of("STCN") != std::string::npos) {
      throw InputError(text.where() + ": OFF files with the prefix '" + prefix +
                       "' are not read (no 4D or nD vertices); convert it to PLY");
    }
    header_.colour = prefix.find('C') != std::string::npos;
    normals_ = prefix.find('N') != std::string::npos;
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

  void pass_vertices(TextScanner& text, VertexBatch* batch) const {
    for (std::uint64_t i = 0; i < header_.vertices; ++i) {
      Double3 p;
      for (double& value : p) value = text.number("a coordinate");
      if (normals_) {
        for (int k = 0; k < 3; ++k) text.number("a normal", true);
      }
      std::uint32_t rgba = 0;
      if (header_.colour) rgba = read_colour(text);
      if (batch != nullptr) batch->add(p, rgba);
    }
  }

  /// Three or four numbers up to the end of the line: bytes where all are whole and one exceeds 1, else 0..1.
  static std::uint32_t read_colour(TextScanner& text) {
    double c[4] = {0, 0, 0, 0};
    int given = 0;
    bool bytes = false, whole = true;
    for (std::string_view word = text.word_in_line(); !word.empty() && given < 4;
         word = text.word_in_line()) {
      double& value = c[given++];
      if (!take_number(word, value) || !word.empty())
        throw InputError(text.where() + ": a colour is no number");
      bytes = bytes || value > 1.0;
      whole =
          whole && value >= 0.0 && value <= 255.0 && value == static_cast<double>(static_cast<int>(value));
    }
    const double scale = bytes && whole ? 255.0 : 1.0;
    if (given < 3) return 0;
    if (given == 3) c[3] = scale;
    return pack_rgba(colour_byte(c[0] / scale), colour_byte(c[1] / scale), colour_byte(c[2] / scale),
                     colour_byte(c[3] / scale));
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  const char line_end_;
  bool normals_ = false;
  MeshHeader header_;
  const std::string format_ = "OFF";
};

}  // namespace

std::unique_ptr<MeshReader> open_off_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<OffMeshReader>(std::move(file), options);
}

}  // namespace tessera
