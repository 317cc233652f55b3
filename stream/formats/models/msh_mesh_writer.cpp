/// Gmsh's MSH 4.1, binary (Gmsh reference manual, "MSH file format"): one discrete surface, positions in doubles. Its box, which the
/// format wants before the vertices, is patched in at the end.
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "octree/error.h"
#include "stream/formats/meshes/mesh_writer_base.h"

namespace tessera {
namespace {

constexpr std::int32_t kSurface = 2, kSurfaceTag = 1, kTriangleType = 2;

class MshMeshWriter : public MeshWriterBase {
 public:
  MshMeshWriter(const std::filesystem::path& path, const MeshHeader& header)
      : MeshWriterBase(path, header, false) {
    file_.append("$MeshFormat\n4.1 1 8\n");
    put(std::int32_t{1});
    file_.append("\n$EndMeshFormat\n");
    if (const auto lines = comment_lines(header); !lines.empty()) {
      file_.append("$Comments\n");
      for (const std::string& line : lines) file_.append((line[0] == '$' ? " " : "") + line + "\n");
      file_.append("$EndComments\n");
    }
    file_.append("$Entities\n");
    for (const std::uint64_t count : {0, 0, 1, 0}) put(count);
    put(kSurfaceTag);
    box_at_ = file_.size();
    for (int k = 0; k < 6; ++k) put(0.0);
    for (int k = 0; k < 2; ++k) put(std::uint64_t{0});  // no physical groups, no bounding curves
    file_.append("\n$EndEntities\n$Nodes\n");
    put_block_head(header.vertices);
    put(std::int32_t{0});  // not parametric
    put(header.vertices);
    for (std::uint64_t v = 1; v <= header.vertices; ++v) put(v);
  }

 private:
  template <class Number>
  void put(Number value) {
    file_.append(&value, sizeof value);
  }
  /// One block of so many elements, numbered from 1 on.
  void put_block_head(std::uint64_t count) {
    put(std::uint64_t{1}), put(count), put(std::uint64_t{count > 0 ? 1u : 0u}), put(count);
    put(kSurface), put(kSurfaceTag);
  }

  void write_vertices(std::span<const Double3> positions, std::span<const std::uint32_t>) override {
    for (const Double3& p : positions)
      for (std::size_t k = 0; k < 3; ++k) {
        if (!std::isfinite(p[k]))
          throw InputError(
              file_.path().string() +
              ": solvers read finite positions only and the mesh has others; clean the mesh first, "
              "as tessera decimate does");
        low_[k] = std::min(low_[k], p[k]), high_[k] = std::max(high_[k], p[k]);
      }
    file_.append(positions.data(), positions.size_bytes());
  }

  void write_faces(std::span<const MeshFace> faces, std::span<const std::uint8_t>) override {
    open_faces();
    std::vector<std::uint64_t> rows;
    for (const MeshFace& face : faces) {
      rows.push_back(++faces_);
      for (const std::uint64_t v : face) rows.push_back(v + 1);
      if (rows.size() >= kRowsAtOnce) flush(rows);
    }
    flush(rows);
  }
  void flush(std::vector<std::uint64_t>& rows) {
    file_.append(rows.data(), rows.size() * sizeof rows[0]);
    rows.clear();
  }

  void write_end() override {
    open_faces();
    file_.append("\n$EndElements\n");
    if (header_.vertices == 0) return;
    const std::array<Double3, 2> box = {low_, high_};
    file_.patch(box_at_, box.data(), sizeof box);
  }

  void open_faces() {
    if (faces_open_) return;
    faces_open_ = true;
    file_.append("\n$EndNodes\n$Elements\n");
    put_block_head(header_.faces);
    put(kTriangleType);
    put(header_.faces);
  }

  static constexpr std::size_t kRowsAtOnce = 65536;
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  std::uint64_t box_at_ = 0;  ///< offset of the surface's box
  Double3 low_ = {kFar, kFar, kFar}, high_ = {-kFar, -kFar, -kFar};
  std::uint64_t faces_ = 0;
  bool faces_open_ = false;
};

}  // namespace

std::unique_ptr<MeshWriter> create_msh_mesh(const std::filesystem::path& path, const MeshHeader& header) {
  return std::make_unique<MshMeshWriter>(path, header);
}

}  // namespace tessera
