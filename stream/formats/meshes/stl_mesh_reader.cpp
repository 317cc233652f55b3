/// STL, text and binary. Triangles have no shared vertices: three per face, in order.
#include <algorithm>
#include <cctype>
#include <optional>
#include <string>
#include <utility>

#include "stream/formats/line_reader.h"
#include "stream/formats/meshes/mesh_reader_base.h"
#include "stream/formats/scalar.h"
#include "stream/formats/text_scanner.h"

namespace tessera {
namespace {

constexpr std::uint64_t kHeaderBytes = 84;
constexpr std::uint64_t kFacetBytes = 50;

class StlMeshReader : public MeshReader {
 public:
  StlMeshReader(ReadFile file, const MeshReadOptions&) : file_(std::move(file)) {
    char start[kHeaderBytes] = {};
    file_.read_at(0, start, std::min<std::uint64_t>(file_.size(), kHeaderBytes));
    const std::uint64_t count = load_scalar<std::uint32_t>(start + 80);
    const bool solid = std::string_view(start, 5) == "solid";
    const bool has_header = file_.size() >= kHeaderBytes;
    // Many binary files begin with "solid" too: the size decides.
    text_ = solid && !(has_header && file_.size() == kHeaderBytes + count * kFacetBytes);
    if (text_) {
      format_ = "STL text";
      line_end_ = detect_line_end(file_);
      return;
    }
    format_ = "STL binary";
    if (!has_header || (file_.size() - kHeaderBytes) / kFacetBytes < count) {
      throw InputError(file_.path().string() + ": byte " + std::to_string(file_.size()) +
                       ": the file ends before all " + std::to_string(count) + " facets of the header (" +
                       std::to_string(kHeaderBytes + count * kFacetBytes) +
                       " bytes); it is truncated or no STL file");
    }
    header_.faces = count;
    header_.vertices = 3 * count;
  }

  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }
  bool shared_vertices() const override { return false; }

  void read_vertices(const VertexSink& sink) override {
    VertexBatch batch(sink, false);
    facets_ = text_ ? read_text(batch) : read_binary(batch);
    batch.flush();
  }

  void read_faces(const FaceSink& sink) override {
    if (!facets_) read_vertices([](auto, auto) {});
    FaceBatch batch(sink, {}, 3 * *facets_, [this] { return file_.path().string(); });
    for (std::uint64_t i = 0; i < *facets_; ++i) batch.triangle(3 * i, 3 * i + 1, 3 * i + 2);
    batch.flush();
  }

 private:
  std::uint64_t read_binary(VertexBatch& batch) const {
    ByteWindow window(file_, kHeaderBytes, file_.size(), ByteWindow::kDefaultCapacity, true);
    for (std::uint64_t i = 0; i < header_.faces; ++i) {
      const char* facet = window.peek(kFacetBytes).data();
      for (std::size_t corner = 1; corner <= 3; ++corner) {
        const char* p = facet + 12 * corner;
        batch.add({load_scalar<float>(p), load_scalar<float>(p + 4), load_scalar<float>(p + 8)});
      }
      window.skip(kFacetBytes);
    }
    return header_.faces;
  }

  /// Only `vertex` lines and the ends of loops matter; normals are derived data.
  std::uint64_t read_text(VertexBatch& batch) const {
    TextScanner text(file_, 0, 1, line_end_, '\0');
    std::uint64_t facets = 0;
    int corners = 0;
    bool open = false;
    for (bool more = true; more; more = text.next_line()) {
      std::string keyword(text.word_in_line());
      std::transform(keyword.begin(), keyword.end(), keyword.begin(),
                     [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
      if (keyword == "vertex") {
        if (!open) throw InputError(text.where() + ": a vertex stands outside of any facet");
        if (++corners > 3) throw InputError(text.where() + ": a facet has more than three vertices");
        Double3 p;
        // STL holds floats; text of more digits is rounded as binary files would.
        for (double& value : p) value = static_cast<float>(text.number("a coordinate", true));
        batch.add(p);
      } else if (keyword == "facet") {
        if (open) throw InputError(text.where() + ": a facet begins before the last one ended");
        open = true;
        corners = 0;
      } else if (keyword == "endfacet") {
        if (!open || corners != 3) {
          throw InputError(text.where() + ": a facet ends with " + std::to_string(corners) +
                           " vertices, not three");
        }
        open = false;
        ++facets;
      }
    }
    if (open) throw InputError(text.where() + ": the file ends inside a facet; it is truncated");
    return facets;
  }

  const ReadFile file_;
  bool text_ = false;
  char line_end_ = '\n';
  MeshHeader header_;
  std::string format_;
  std::optional<std::uint64_t> facets_;  ///< known after a first pass
};

}  // namespace

std::unique_ptr<MeshReader> open_stl_mesh(ReadFile file, const MeshReadOptions& options) {
  return std::make_unique<StlMeshReader>(std::move(file), options);
}

}  // namespace tessera
