/// Binary STL: every facet repeats its corners, so positions wait in a store of bounded memory while faces
/// come. Meshes in an order where near faces name near vertices (ours are) read each part of it about once.
/// Positions count from the header's origin, which stands in the 80 bytes as `tessera_origin X Y Z`.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "octree/error.h"
#include "octree/vector.h"
#include "stream/formats/meshes/mesh_writer_base.h"
#include "stream/formats/vertex_store.h"

namespace tessera {
namespace {

constexpr std::size_t kHeaderBytes = 84;
constexpr std::size_t kFacetBytes = 50;
constexpr std::size_t kTitleBytes = 79;
constexpr std::uint64_t kStoreBytes = std::uint64_t{64} << 20;  // 5.6 million vertices never touch the disk

class StlMeshWriter : public MeshWriterBase {
 public:
  StlMeshWriter(const std::filesystem::path& path, const MeshHeader& header)
      : MeshWriterBase(path, header, true, true),
        store_(path.has_parent_path() ? path.parent_path() : ".", false, kStoreBytes) {
    // The 80 bytes must not begin with "solid", by which readers know text files.
    char start[kHeaderBytes] = {};
    std::string title = "Tessera";
    // What the coordinates are comes first: there is room for it, not for all comments.
    if (header.origin != Double3{0, 0, 0}) title += "; " + triple_line(kStlOrigin, header.origin);
    std::vector<std::string> lines = comment_lines(header);
    if (header.shift != Double3{0, 0, 0}) std::rotate(lines.begin(), lines.end() - 1, lines.end());
    for (const std::string& line : lines) title += "; " + line;
    std::memcpy(start, title.data(), std::min(title.size(), kTitleBytes));
    const auto count = static_cast<std::uint32_t>(header.faces);
    std::memcpy(start + 80, &count, sizeof count);
    file_.append(start, sizeof start);
  }

 private:
  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t>) override {
    if (header_.origin == Double3{0, 0, 0}) {
      store_.append(positions);  // which rounds as local() does
      return;
    }
    for (const Double3& p : positions) {
      const Float3 q = local(p);
      const Double3 rounded = {q[0], q[1], q[2]};
      store_.append({&rounded, 1});
    }
  }

  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t>) override {
    for (const MeshFace& face : faces) {
      const Double3 a = store_.at(face[0]), b = store_.at(face[1]), c = store_.at(face[2]);
      const Double3 u = b - a, v = c - a;
      const Double3 n = cross(u, v);
      const double length = norm(n);
      const double scale = length > 0.0 && std::isfinite(length) ? 1.0 / length : 0.0;
      float facet[12];
      for (std::size_t k = 0; k < 3; ++k) {
        facet[k] = scale > 0.0 ? static_cast<float>(n[k] * scale) : 0.0f;
        facet[3 + k] = static_cast<float>(a[k]);
        facet[6 + k] = static_cast<float>(b[k]);
        facet[9 + k] = static_cast<float>(c[k]);
      }
      char* to = file_.reserve(kFacetBytes);
      std::memcpy(to, facet, sizeof facet);
      std::memset(to + sizeof facet, 0, 2);
      file_.commit(kFacetBytes);
    }
  }

  VertexStore store_;
};

}  // namespace

std::unique_ptr<MeshWriter> create_stl_mesh(const std::filesystem::path& path, const MeshHeader& header) {
  if (header.faces > 0xffffffffULL) {
    throw UsageError(path.string() + ": STL ends at 4294967295 faces and the mesh has " +
                     std::to_string(header.faces) + "; write .ply instead");
  }
  return std::make_unique<StlMeshWriter>(path, header);
}

}  // namespace tessera
