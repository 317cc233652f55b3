/// Wavefront OBJ: shortest decimals that read back to the same double, of floats too; colour as `v x y z r g b`,
/// 0..1. Text has no limit on counts.
#include <charconv>

#include "stream/formats/meshes/mesh_writer_base.h"

namespace tessera {
namespace {

constexpr std::size_t kLineBytes = 160;  // "v", three doubles of at most 24, three colours of at most 8
constexpr std::size_t kBatchBytes = std::size_t{1} << 20;

class ObjMeshWriter : public MeshWriterBase {
 public:
  ObjMeshWriter(const std::filesystem::path& path, const MeshHeader& header)
      : MeshWriterBase(path, header, !header.double_positions) {
    for (const std::string& line : comment_lines(header)) file_.append("# " + line + "\n");
  }

  void group(const std::string& name) override {
    close();
    file_.append("g " + name + "\n");
  }

 private:
  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) override {
    for (std::size_t i = 0; i < positions.size(); ++i) {
      open_line();
      *to_++ = 'v';
      for (const double value : positions[i]) {
        *to_++ = ' ';
        put(decimal_value(header_, value));
      }
      for (int shift = 0; header_.colour && shift < 24; shift += 8) {
        *to_++ = ' ';
        // Four decimals give the byte back exactly.
        to_ = std::to_chars(to_, end_, (rgba[i] >> shift & 255u) / 255.0, std::chars_format::fixed, 4).ptr;
      }
      *to_++ = '\n';
    }
    close();
  }

  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t>) override {
    for (const MeshFace& face : faces) {
      open_line();
      *to_++ = 'f';
      for (const std::uint64_t v : face) {
        *to_++ = ' ';
        put(v + 1);
      }
      *to_++ = '\n';
    }
    close();
  }

  template <class Number>
  void put(Number value) {
    to_ = std::to_chars(to_, end_, value).ptr;
  }
  void open_line() {
    if (to_ != nullptr && static_cast<std::size_t>(end_ - to_) >= kLineBytes) return;
    close();
    begin_ = to_ = file_.reserve(kBatchBytes);
    end_ = begin_ + kBatchBytes;
  }
  void close() {
    if (to_ != nullptr) file_.commit(static_cast<std::size_t>(to_ - begin_));
    begin_ = to_ = end_ = nullptr;
  }

  char* begin_ = nullptr;
  char* to_ = nullptr;
  char* end_ = nullptr;
};

}  // namespace

std::unique_ptr<MeshWriter> create_obj_mesh(const std::filesystem::path& path, const MeshHeader& header) {
  return std::make_unique<ObjMeshWriter>(path, header);
}

}  // namespace tessera
