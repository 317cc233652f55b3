#include "stream/page/preview_mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "kernels/decimate/vertex_clustering.h"
#include "octree/error.h"
#include "octree/key_table.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/vertex_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

// A surface has about two faces a vertex; where it has more, the next larger cell serves.
constexpr std::uint64_t kMaxCells = kMaxPreviewFaces * 19 / 40;
constexpr std::uint64_t kStoreBytes = std::uint64_t{8} << 20;
constexpr double kNextCell = 1.189207115002721;  // fourth root of two, as ClusterSize tries them

/// Counts what every face has, whatever becomes of it.
class FaceFigures {
 public:
  void add(const std::array<Double3, 3>& corner) {
    std::array<Double3, 3> side{};
    std::array<double, 3> square{};
    for (std::size_t k = 0; k < 3; ++k) {
      side[k] = corner[(k + 1) % 3] - corner[k];
      square[k] = dot(side[k], side[k]);
      if (!std::isfinite(square[k])) return;
    }
    for (const double s : square)
      if (s > 0.0) ++lengths_[static_cast<std::size_t>(half_octave(s) + kLeast)];
    // The smallest angle lies opposite the shortest side; its cosine grows as it shrinks.
    const auto minimum =
        static_cast<std::size_t>(std::min_element(square.begin(), square.end()) - square.begin());
    const std::size_t b = (minimum + 1) % 3, c = (minimum + 2) % 3;
    const double lengths = std::sqrt(square[b] * square[c]);
    const double cosine = lengths > 0.0 ? -dot(side[b], side[c]) / lengths : 1.0;
    std::size_t bin = 0;  // they descend
    for (std::size_t i = 0; i + 1 < kCosines.size(); ++i) bin += cosine <= kCosines[i];
    ++angles_[bin];
  }
  void store(PreviewMesh& preview) const {
    preview.smallest_angle = angles_;
    const auto none = [](std::uint64_t count) { return count == 0; };
    const auto first = std::find_if_not(lengths_.begin(), lengths_.end(), none);
    if (first == lengths_.end()) return;
    const auto last = std::find_if_not(lengths_.rbegin(), lengths_.rend(), none).base();
    preview.shortest_edge_bin =
        std::sqrt(std::ldexp(1.0, static_cast<int>(first - lengths_.begin()) - kLeast));
    preview.edge_length.assign(first, last);
  }

 private:
  static constexpr int kLeast = 1100, kMost = 1100;  ///< exponents of doubles lie between
  /// Of a length by its square: the exponent of the square, of frexp() less one. \pre finite, > 0
  static int half_octave(double square) {
    const auto biased = static_cast<int>(std::bit_cast<std::uint64_t>(square) >> 52);
    return biased > 0 ? biased - 1023 : std::ilogb(square);
  }
  /// Of 5, 10, ..., 60 degrees.
  static constexpr std::array<double, 12> kCosines = {
      0.9961946980917455, 0.984807753012208,  0.9659258262890683, 0.9396926207859084,
      0.9063077870366499, 0.8660254037844387, 0.8191520442889918, 0.766044443118978,
      0.7071067811865476, 0.6427876096865394, 0.573576436351046,  0.5};
  std::array<std::uint64_t, 12> angles_{};
  std::array<std::uint64_t, kLeast + kMost> lengths_{};
};

/// The vertices of a mesh by number, relative to the first finite one, and their colours.
class Vertices {
 public:
  Vertices(MeshReader& mesh, const std::filesystem::path& temp, std::uint64_t memory_bytes)
      : position_(temp, false, memory_bytes / (mesh.header().colour ? 2 : 1)), size_(kMaxCells) {
    if (mesh.header().colour) colour_.emplace(temp, false, memory_bytes / 2);
    bool has_origin = false;
    std::vector<Double3> local;
    mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t> rgba) {
      throw_if_stopped();
      local.clear();
      for (const Double3& p : batch) {
        if (!has_origin && std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])) {
          origin_ = p;
          has_origin = true;
        }
        Double3 q = p - origin_;
        for (double& c : q) c = static_cast<double>(static_cast<float>(c));  // as it will be read back
        size_.add(q);
        local.push_back(q);
      }
      position_.append(local);
      if (!colour_) return;
      local.clear();
      for (const std::uint32_t c : rgba)
        local.push_back({double(c & 0xff), double((c >> 8) & 0xff), double((c >> 16) & 0xff)});
      colour_->append(local);
    });
  }

  const Double3& origin() const { return origin_; }
  double cell() const { return size_.cell(); }
  bool has_colour() const { return colour_.has_value(); }
  Double3 at(std::uint64_t i) { return position_.at(i); }
  std::uint32_t rgba(std::uint64_t i) {
    if (!colour_) return 0;
    const Double3 c = colour_->at(i);
    return 0xff000000u | static_cast<std::uint32_t>(c[0]) | static_cast<std::uint32_t>(c[1]) << 8 |
           static_cast<std::uint32_t>(c[2]) << 16;
  }

 private:
  VertexStore position_;
  std::optional<VertexStore> colour_;
  ClusterSize size_;
  Double3 origin_{};
};

/// Calls use(corners, colours, face) for every face; it may return false to end.
template <class Use>
void each_face(MeshReader& mesh, Vertices& vertices, const Use& use) {
  mesh.read_faces([&](std::span<const MeshFace> batch) {
    throw_if_stopped();
    for (const MeshFace& face : batch) {
      const std::array<Double3, 3> corners = {vertices.at(face[0]), vertices.at(face[1]),
                                              vertices.at(face[2])};
      use(corners, std::array{vertices.rgba(face[0]), vertices.rgba(face[1]), vertices.rgba(face[2])}, face);
    }
  });
}

Float3 to_float(const Double3& p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

/// The mesh itself, while it is small enough: faces beyond are counted and no more.
void copy_faces(PreviewMesh& preview, MeshReader& mesh, Vertices& vertices) {
  FaceFigures figures;
  KeyTable number;
  each_face(mesh, vertices, [&](const auto& corners, const auto& rgba, const MeshFace& face) {
    figures.add(corners);
    if (++preview.mesh_faces > kMaxPreviewFaces) return;
    std::array<std::uint32_t, 3> copy{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [copied, is_new] = number.add(face[k]);
      copy[k] = copied;
      if (!is_new) continue;
      preview.position.push_back(to_float(corners[k]));
      preview.rgba.push_back(rgba[k]);
    }
    preview.faces.push_back(copy);
  });
  figures.store(preview);
}

void cluster_faces(PreviewMesh& preview, MeshReader& mesh, Vertices& vertices) {
  preview.position.clear(), preview.rgba.clear(), preview.faces.clear();
  for (preview.cell = vertices.cell(); preview.cell > 0.0; preview.cell *= kNextCell) {
    FaceFigures figures;
    VertexClustering clustering(preview.cell, kMaxPreviewFaces);
    preview.mesh_faces = 0;
    bool fits = true;
    each_face(mesh, vertices, [&](const auto& corners, const auto& rgba, const MeshFace&) {
      ++preview.mesh_faces;
      figures.add(corners);
      fits = fits && clustering.add(corners, rgba);
    });
    if (!fits) continue;
    ClusteredMesh clustered = clustering.finish();
    for (const Double3& p : clustered.position) preview.position.push_back(to_float(p));
    preview.rgba = std::move(clustered.rgba);
    preview.faces = std::move(clustered.faces);
    figures.store(preview);
    return;
  }
}

}  // namespace

std::uint64_t preview_bytes() {
  return VertexClustering::bytes(kMaxPreviewFaces) + kStoreBytes;
}

PreviewMesh make_preview(const std::filesystem::path& path, const std::filesystem::path& temp,
                         std::uint64_t memory_bytes) {
  if (memory_bytes < preview_bytes())
    throw ResourceError("a preview takes " + format_bytes(preview_bytes()) +
                        " of memory, and the cap leaves " + format_bytes(memory_bytes));
  const auto mesh = open_mesh_file(path);
  Vertices vertices(*mesh, temp, memory_bytes - VertexClustering::bytes(kMaxPreviewFaces));
  PreviewMesh preview;
  if (mesh->header().faces <= kMaxPreviewFaces) copy_faces(preview, *mesh, vertices);
  // Some formats do not say how many faces they have.
  if (preview.mesh_faces == 0 || preview.mesh_faces > kMaxPreviewFaces)
    cluster_faces(preview, *mesh, vertices);
  if (!vertices.has_colour()) preview.rgba.clear();
  preview.origin = vertices.origin();
  return preview;
}

}  // namespace tessera
