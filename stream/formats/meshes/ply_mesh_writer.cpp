/// Binary little endian PLY. Positions are float or double, colour is uchar rgba, faces are
/// `list uchar uint vertex_indices`. PLY has no 64-bit type, so indices end at 2^32-1; counts are text and do
/// not.
#include <algorithm>
#include <bit>
#include <cstring>

#include "octree/error.h"
#include "stream/formats/mesh_parts.h"
#include "stream/formats/meshes/mesh_writer_base.h"

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little, "records are stored as they lie in memory");
constexpr std::size_t kBatch = 65536;  // records formatted per reservation; 28 bytes each at most
constexpr std::size_t kFaceBytes = 1 + 3 * sizeof(std::uint32_t);

template <typename Real>
void pack_positions(std::span<const Double3> positions, const std::uint32_t* rgba, char* to) {
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Double3& p = positions[i];
    const Real xyz[3] = {static_cast<Real>(p[0]), static_cast<Real>(p[1]), static_cast<Real>(p[2])};
    std::memcpy(to, xyz, sizeof xyz);
    to += sizeof xyz;
    if (rgba != nullptr) {
      std::memcpy(to, rgba + i, 4);
      to += 4;
    }
  }
}

class PlyMeshWriter : public MeshWriterBase, public MeshPartWriter {
 public:
  PlyMeshWriter(const std::filesystem::path& path, const MeshHeader& header)
      : MeshWriterBase(path, header, !header.double_positions),
        face_bytes_(kFaceBytes + (header.synthetic ? 1u : 0u)),
        vertex_bytes_((header.double_positions ? 24u : 12u) + (header.colour ? 4u : 0u)) {
    const std::string real = header.double_positions ? "double" : "float";
    file_.append("ply\nformat binary_little_endian 1.0\n");
    for (const std::string& line : comment_lines(header)) file_.append("comment " + line + "\n");
    file_.append("element vertex " + std::to_string(header.vertices) + "\n");
    for (const char* axis : {"x", "y", "z"}) file_.append("property " + real + " " + axis + "\n");
    if (header.colour) {
      for (const char* name : {"red", "green", "blue", "alpha"}) {
        file_.append(std::string("property uchar ") + name + "\n");
      }
    }
    file_.append("element face " + std::to_string(header.faces) +
                 "\nproperty list uchar uint vertex_indices\n");
    if (header.synthetic) file_.append("property uchar synthetic\n");
    file_.append("end_header\n");
  }

  void encode(MeshVertexPart& part) const override {
    part.bytes.resize(part.position.size() * vertex_bytes_);
    pack_vertices(part.position, part.rgba, part.bytes.data());
    part.moved = moved_by_rounding(part.position);
  }
  void encode(MeshFacePart& part) const override {
    part.bytes.resize(part.faces.size() * face_bytes_);
    pack_faces(part.faces, part.synthetic, part.bytes.data());
    part.beyond = find_beyond(part.faces);
  }
  void append(const MeshVertexPart& part) override {
    accept_vertices(part.position, part.rgba.size(), part.moved);
    file_.append_direct(part.bytes.data(), part.bytes.size());
  }
  void append(const MeshFacePart& part) override {
    accept_faces(part.faces, part.synthetic.size(), part.beyond);
    file_.append_direct(part.bytes.data(), part.bytes.size());
  }
  void digest(std::span<const char> bytes) override { file_.digest(bytes.data(), bytes.size()); }

 private:
  void pack_vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba,
                     char* to) const {
    const std::uint32_t* colours = header_.colour && rgba.size() == positions.size() ? rgba.data() : nullptr;
    if (header_.double_positions) {
      pack_positions<double>(positions, colours, to);
    } else {
      pack_positions<float>(positions, colours, to);
    }
  }

  void pack_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic, char* to) const {
    const bool flagged = header_.synthetic && synthetic.size() == faces.size();
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const MeshFace& face = faces[i];
      *to = 3;
      const std::uint32_t indices[3] = {static_cast<std::uint32_t>(face[0]),
                                        static_cast<std::uint32_t>(face[1]),
                                        static_cast<std::uint32_t>(face[2])};
      std::memcpy(to + 1, indices, sizeof indices);
      if (flagged) to[kFaceBytes] = static_cast<char>(synthetic[i]);
      to += face_bytes_;
    }
  }

  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t> rgba) override {
    for (std::size_t first = 0; first < positions.size(); first += kBatch) {
      const std::size_t count = std::min(kBatch, positions.size() - first);
      pack_vertices(positions.subspan(first, count), header_.colour ? rgba.subspan(first, count) : rgba,
                    file_.reserve(count * vertex_bytes_));
      file_.commit(count * vertex_bytes_);
    }
  }

  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) override {
    for (std::size_t first = 0; first < faces.size(); first += kBatch) {
      const std::size_t count = std::min(kBatch, faces.size() - first);
      pack_faces(faces.subspan(first, count), header_.synthetic ? synthetic.subspan(first, count) : synthetic,
                 file_.reserve(count * face_bytes_));
      file_.commit(count * face_bytes_);
    }
  }

  const std::size_t face_bytes_;
  const std::size_t vertex_bytes_;
};

}  // namespace

std::unique_ptr<MeshWriter> create_ply_mesh(const std::filesystem::path& path, const MeshHeader& header) {
  if (header.vertices > 0xffffffffULL) {
    throw UsageError(path.string() + ": PLY indices end at 4294967295 and the mesh has " +
                     std::to_string(header.vertices) + " vertices; write .obj instead");
  }
  return std::make_unique<PlyMeshWriter>(path, header);
}

}  // namespace tessera
