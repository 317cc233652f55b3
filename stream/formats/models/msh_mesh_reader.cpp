/// Gmsh's MSH 4.1, binary (Gmsh reference manual, "MSH file format"): triangles and quads of all surfaces. Nodes must be numbered one
/// after the other, as Gmsh writes them; elements of other kinds are counted.
#include <algorithm>
#include <charconv>
#include <string>
#include <vector>

#include "stream/formats/byte_window.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"

namespace tessera {
namespace {

constexpr const char* kSaveBinary = "; save it as version 4.1, binary (gmsh -format msh41 -bin)";

/// Nodes of an element by its type; 0 for kinds that are not known.
std::uint64_t element_nodes(std::int32_t type) {
  constexpr std::uint64_t kNodes[] = {0, 2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13};
  return type > 0 && type < 20 ? kNodes[type] : type == 21 || type == 26 ? (type == 21 ? 10 : 4) : 0;
}

struct NodeBlock {
  std::uint64_t coordinates = 0;  ///< offset
  std::uint64_t count = 0, stride = 0;
};
struct ElementBlock {
  std::uint64_t rows = 0;  ///< offset
  std::uint64_t count = 0, nodes = 0;
};

class MshMeshReader : public MeshReader {
 public:
  MshMeshReader(ReadFile file, const MeshReadOptions& options)
      : file_(std::move(file)),
        options_(options),
        polygons_([this](const VertexSink& sink) { read_vertices(sink); }, options.temp) {
    read_format();
    find_sections();
    if (elements_at_ == 0) fail(file_.size(), "it has no elements");
    header_.double_positions = true;
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, false);
    for (const NodeBlock& block : nodes_) {
      ByteWindow window(file_, block.coordinates, block.coordinates + block.count * block.stride,
                        ByteWindow::kDefaultCapacity, true);
      for (std::uint64_t i = 0; i < block.count; ++i) {
        const char* const p = window.peek(static_cast<std::size_t>(block.stride)).data();
        batch.add({load_scalar<double>(p), load_scalar<double>(p + 8), load_scalar<double>(p + 16)});
        window.skip(block.stride);
      }
    }
    batch.flush();
  }

  void read_faces(const FaceSink& sink) override {
    std::uint64_t at = 0;
    FaceBatch batch(
        sink, options_, header_.vertices,
        [&] { return file_.path().string() + ": byte " + std::to_string(at); }, &polygons_);
    for (const ElementBlock& block : faces_) {
      const std::uint64_t stride = 8 * (1 + block.nodes);
      ByteWindow window(file_, block.rows, block.rows + block.count * stride, ByteWindow::kDefaultCapacity,
                        true);
      for (std::uint64_t i = 0; i < block.count; ++i) {
        at = window.offset();
        const char* const p = window.peek(static_cast<std::size_t>(stride)).data();
        batch.begin_polygon();
        // A tag below the first is beyond all.
        for (std::uint64_t k = 1; k <= block.nodes; ++k)
          batch.corner(load_scalar<std::uint64_t>(p + 8 * k) - first_tag_);
        batch.end_polygon();
        window.skip(stride);
      }
    }
    batch.flush();
  }

  std::vector<std::string> warnings() const override {
    std::vector<std::string> all;
    if (others_ > 0)
      all.push_back(std::to_string(others_) + " elements that are no triangles or quads are left out");
    if (const std::string folded = polygons_.warning(); !folded.empty()) all.push_back(folded);
    return all;
  }

 private:
  [[noreturn]] void fail(std::uint64_t at, const std::string& what) const {
    throw InputError(file_.path().string() + ": byte " + std::to_string(at) + ": " + what);
  }
  template <class Number>
  Number get(std::uint64_t& at) const {
    char bytes[sizeof(Number)];
    if (at > file_.size() || file_.size() - at < sizeof bytes)
      fail(file_.size(), "it ends too early; it is cut off");
    file_.read_at(at, bytes, sizeof bytes);
    at += sizeof bytes;
    return load_scalar<Number>(bytes);
  }
  /// A range of so many records lies in the file.
  void require(std::uint64_t at, std::uint64_t count, std::uint64_t bytes) const {
    if (count > (file_.size() - std::min(at, file_.size())) / bytes)
      fail(at, std::to_string(count) + " records do not fit the file, which is cut off or damaged");
  }

  void read_format() {
    std::string text(static_cast<std::size_t>(std::min<std::uint64_t>(file_.size(), 256)), '\0');
    file_.read_at(0, text.data(), text.size());
    const std::size_t line = std::min(text.find('\n'), text.size());
    const std::size_t end = std::min(text.find('\n', std::min(line + 1, text.size())), text.size());
    std::string words = text.substr(std::min(line + 1, text.size()), end - std::min(line + 1, end));
    if (!words.empty() && words.back() == '\r') words.pop_back();
    if (words != "4.1 1 8")
      fail(line, "its format is '" + words.substr(0, 40) + "', not '4.1 1 8'" + kSaveBinary);
    std::uint64_t at = end + 1;
    if (get<std::int32_t>(at) != 1) fail(end, "its bytes are not little endian, the only order that is read");
    after_format_ = at;
  }

  /// Sections that matter are walked, all others passed over.
  void find_sections() {
    ByteWindow window(file_, after_format_, file_.size(), std::size_t{1} << 18);
    for (;;) {
      const std::string name = next_section(window);
      if (name.empty()) return;
      std::uint64_t at = window.offset();
      if (name == "Nodes") find_nodes(at);
      if (name == "Elements") find_elements(at);
      window.skip(at - window.offset());
    }
  }
  /// Passes over what lies before the next line that begins a section, and over that line.
  static std::string next_section(ByteWindow& window) {
    while (window.remaining() > 0) {
      const std::string_view bytes = window.peek(std::min<std::size_t>(window.capacity(), 4096));
      const std::size_t at = bytes.find('$');
      if (at == std::string_view::npos || at > 0) {
        window.skip(std::min(at, bytes.size()));
        continue;
      }
      const std::size_t end = bytes.substr(0, 64).find('\n');
      std::string name(bytes.substr(1, end == std::string_view::npos ? 0 : end - 1));
      if (!name.empty() && name.back() == '\r') name.pop_back();
      if (name == "Nodes" || name == "Elements") {
        window.skip(end + 1);
        return name;
      }
      window.skip(1);
    }
    return {};
  }

  void find_nodes(std::uint64_t& at) {
    if (!nodes_.empty()) fail(at, "a second section of nodes");
    const auto blocks = get<std::uint64_t>(at);
    get<std::uint64_t>(at);
    first_tag_ = get<std::uint64_t>(at);
    get<std::uint64_t>(at);
    for (std::uint64_t b = 0; b < blocks; ++b) {
      const auto dimension = get<std::int32_t>(at);
      get<std::int32_t>(at);
      const auto parametric = get<std::int32_t>(at);
      const auto count = get<std::uint64_t>(at);
      const std::uint64_t stride =
          24 + (parametric != 0 ? 8u * static_cast<std::uint64_t>(std::clamp(dimension, 0, 3)) : 0u);
      require(at, count, 8 + stride);
      check_tags(at, count);
      at += 8 * count;
      if (count > 0) nodes_.push_back({at, count, stride});
      at += stride * count;
      header_.vertices += count;
    }
  }
  void check_tags(std::uint64_t at, std::uint64_t count) const {
    ByteWindow window(file_, at, at + 8 * count, std::size_t{1} << 18, true);
    for (std::uint64_t i = 0; i < count; ++i) {
      if (load_scalar<std::uint64_t>(window.peek(8).data()) != first_tag_ + header_.vertices + i)
        fail(window.offset(),
             "its nodes are not numbered one after the other; let Gmsh renumber them (Mesh.Renumber) and "
             "save it "
             "again");
      window.skip(8);
    }
  }

  void find_elements(std::uint64_t& at) {
    if (elements_at_ != 0) fail(at, "a second section of elements");
    elements_at_ = at;
    const auto blocks = get<std::uint64_t>(at);
    for (int k = 0; k < 3; ++k) get<std::uint64_t>(at);
    for (std::uint64_t b = 0; b < blocks; ++b) {
      get<std::int32_t>(at), get<std::int32_t>(at);
      const auto type = get<std::int32_t>(at);
      const auto count = get<std::uint64_t>(at);
      const std::uint64_t nodes = element_nodes(type);
      if (nodes == 0) fail(at, "elements of type " + std::to_string(type) + ", which Tessera does not know");
      require(at, count, 8 * (1 + nodes));
      const bool face = type == 2 || type == 3;
      if (face && count > 0) faces_.push_back({at, count, nodes}), header_.faces += count;
      if (!face) others_ += count;
      at += count * 8 * (1 + nodes);
    }
  }

  const ReadFile file_;
  const MeshReadOptions options_;
  MeshHeader header_;
  const std::string format_ = "MSH";
  PolygonFaces polygons_;
  std::uint64_t after_format_ = 0, elements_at_ = 0, first_tag_ = 0, others_ = 0;
  std::vector<NodeBlock> nodes_;
  std::vector<ElementBlock> faces_;
};

}  // namespace

std::unique_ptr<MeshReader> open_msh_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<MshMeshReader>(std::move(file), options);
}

}  // namespace tessera
