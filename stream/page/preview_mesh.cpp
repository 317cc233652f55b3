#include "stream/page/preview_mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "kernels/decimate/vertex_clustering.h"
#include "octree/error.h"
#include "octree/key_table.h"
#include "octree/lanes.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/vertex_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

// A surface has about two faces a vertex; where it has more, the next larger cell serves.
constexpr std::uint64_t kMaxCells = kMaxPreviewFaces * 19 / 40;
constexpr std::uint64_t kStoreBytes = std::uint64_t{8} << 20;
// Of a fine mesh so many faces a cell, on average, tell its shape, and the figures of all faces.
constexpr std::uint64_t kShapesPerCell = 12;
constexpr double kNextCell = 1.189207115002721;  // fourth root of two, as ClusterSize tries them

/// Counts what faces have, whatever becomes of them. Positions are floats, so that squares of their differences neither vanish nor
/// overflow in doubles.
class FaceFigures {
 public:
  /// The three sides lie in the lanes of a vector.
  void add(const std::array<Double3, 3>& corner) {
    Double4 squares{};
    for (std::size_t a = 0; a < 3; ++a) {
      const Double4 side = Double4{corner[1][a], corner[2][a], corner[0][a], 0.0} -
                           Double4{corner[0][a], corner[1][a], corner[2][a], 0.0};
      squares += side * side;
    }
    const std::array<double, 3> square = {squares[0], squares[1], squares[2]};
    if (!std::isfinite(square[0] + square[1] + square[2])) return;
    // A table for each side: counting twice in one place would wait for the first.
    for (std::size_t k = 0; k < 3; ++k) ++lengths_[k][std::bit_cast<std::uint64_t>(square[k]) >> 52];
    // The smallest angle lies opposite the shortest side; its cosine, by the law of cosines, grows as it shrinks.
    const double low = std::min(square[0], square[1]), high = std::max(square[0], square[1]);
    const double shortest = std::min(low, square[2]), longest = std::max(high, square[2]),
                 middle = std::max(low, std::min(high, square[2]));
    const double sum = middle + (longest - shortest), product = 4.0 * middle * longest;
    // Its square, times that product; a face without size has no angle at all.
    const Double4 cosine = Double4{} + (product > 0.0 ? sum * sum : 1.0);
    sharper_[0] -= cosine > kSquaredCosines[0] * product;  // what holds is minus one
    sharper_[1] -= cosine > kSquaredCosines[1] * product;
    sharper_[2] -= cosine > kSquaredCosines[2] * product;
    ++faces_;
  }
  void store(PreviewMesh& preview) const {
    std::array<std::uint64_t, 12> sharper{};
    for (std::size_t i = 0; i < sharper.size(); ++i)
      sharper[i] = static_cast<std::uint64_t>(sharper_[i / 4][i % 4]);
    sharper.back() = faces_;  // no smallest angle is over 60 degrees, but for rounding
    for (std::size_t i = 0; i < sharper.size(); ++i)
      preview.smallest_angle[i] = sharper[i] - (i > 0 ? sharper[i - 1] : 0);
    std::vector<std::uint64_t> lengths(lengths_[0].size(), 0);
    for (const auto& table : lengths_)
      for (std::size_t i = 1; i < table.size(); ++i) lengths[i] += table[i];  // the first: no length at all
    const auto none = [](std::uint64_t count) { return count == 0; };
    const auto first = std::find_if_not(lengths.begin(), lengths.end(), none);
    if (first == lengths.end()) return;
    const auto last = std::find_if_not(lengths.rbegin(), lengths.rend(), none).base();
    preview.shortest_edge_bin =
        std::sqrt(std::ldexp(1.0, static_cast<int>(first - lengths.begin()) - kExponentOfOne));
    preview.edge_length.assign(first, last);
  }

 private:
  static constexpr int kExponentOfOne =
      1023;  ///< as doubles have it: half octaves of a length are octaves of its square
  /// Of 5, 10, ..., 60 degrees.
  static constexpr Double4 kSquaredCosines[3] = {
      {0.9924038765061041, 0.9698463103929542, 0.9330127018922194, 0.883022221559489},
      {0.8213938048432696, 0.75, 0.6710100716628344, 0.5868240888334653},
      {0.5, 0.41317591116653485, 0.32898992833716567, 0.2500000000000001}};
  Mask4 sharper_[3] = {};  ///< faces whose smallest angle is below each of these
  std::uint64_t faces_ = 0;
  std::array<std::array<std::uint64_t, 2048>, 3> lengths_{};
};

/// One face in so many, by a golden section of their numbers: even over any stretch of the file, and out of step with whatever pattern
/// faces follow (Weyl 1916).
class FaceSample {
 public:
  explicit FaceSample(std::uint64_t one_in)
      : limit_(~std::uint64_t{0} / std::max<std::uint64_t>(one_in, 1)) {}
  /// Of the next face.
  bool takes() { return (at_ += 0x9e3779b97f4a7c15u) <= limit_; }

 private:
  std::uint64_t limit_, at_ = 0;
};

Float3 to_float(const Double3& p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

/// The vertices of a mesh by number, relative to the first finite one, and their colours: side by side in memory where they fit.
class Vertices {
 public:
  Vertices(MeshReader& mesh, const std::filesystem::path& temp, std::uint64_t memory_bytes)
      : has_colour_(mesh.header().colour) {
    const std::uint64_t count = mesh.header().vertices;
    // Some formats do not say how many they have.
    constexpr std::uint64_t kWord = sizeof(std::uint32_t);  // a cell's number, or a colour
    if (count > 0 && count <= memory_bytes / (sizeof(Float3) + kWord + (has_colour_ ? kWord : 0))) {
      near_.reserve(count);
      if (has_colour_) near_rgba_.reserve(count);
    } else {
      far_.emplace(temp, false, memory_bytes / (has_colour_ ? 2 : 1));
      if (has_colour_) far_rgba_.emplace(temp, false, memory_bytes / 2);
    }
    bool has_origin = false;
    mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t> rgba) {
      throw_if_stopped();
      local_.resize(batch.size());
      for (std::size_t i = 0; i < batch.size(); ++i) {
        const Double3& p = batch[i];
        if (!has_origin && std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])) {
          origin_ = p;
          has_origin = true;
        }
        Double3 q = p - origin_;
        for (double& c : q) c = static_cast<double>(static_cast<float>(c));  // as it will be read back
        local_[i] = q;
      }
      keep(rgba);
    });
  }

  const Double3& origin() const { return origin_; }
  bool has_colour() const { return has_colour_; }

  /// Calls use(corners, colours, face) for every face.
  template <class Use>
  void each_face(MeshReader& mesh, const Use& use) {
    with_vertices([&](const auto& at, const auto& colour) {
      mesh.read_faces([&](std::span<const MeshFace> batch) {
        throw_if_stopped();
        for (const MeshFace& face : batch) {
          std::array<std::uint32_t, 3> rgba{};
          if (has_colour_) rgba = {colour(face[0]), colour(face[1]), colour(face[2])};
          use(std::array<Double3, 3>{at(face[0]), at(face[1]), at(face[2])}, rgba, face);
        }
      });
    });
  }
  /// The edge of cells of which there are as many as may be; 0 without two different vertices.
  double find_cell() {
    constexpr double kFiner = 1024.0;
    double first = 0.0, cell = 0.0;
    with_vertices([&](const auto& at, const auto&) {
      // Anew where the first two vertices lie farther apart than others do, as of a sphere that was divided again and again.
      for (int round = 0; round < 4; ++round, first = cell / kFiner) {
        ClusterSize size(kMaxCells, first);
        for (std::uint64_t i = 0; i < count(); ++i) {
          if (i % kChecked == 0) throw_if_stopped();
          size.add(at(i));
        }
        cell = size.cell();
        if (count() <= kMaxCells || size.is_settled() || !(cell > 0.0)) return;
      }
    });
    return cell;
  }
  /// All vertices and faces into the cells; those that the sample takes shape them, and are counted in the figures.
  /// \return how many faces there are, as far as cells fit
  std::uint64_t cluster(MeshReader& mesh, FaceSample sample, VertexClustering& clustering,
                        FaceFigures& figures) {
    std::uint64_t faces = 0;
    with_vertices([&](const auto& at, const auto& colour) {
      std::vector<std::uint32_t> cells;  // by vertex, where that is in memory
      if (!far_) cells.resize(count());
      for (std::uint64_t i = 0; i < count() && clustering.fits(); ++i) {
        if (i % kChecked == 0) throw_if_stopped();
        const std::uint32_t cell = clustering.add_vertex(at(i), has_colour_ ? colour(i) : 0);
        if (!far_) cells[i] = cell;
      }
      if (!clustering.fits()) return;
      mesh.read_faces([&](std::span<const MeshFace> batch) {
        throw_if_stopped();
        faces += batch.size();
        for (const MeshFace& face : batch) {
          const bool taken = sample.takes();
          std::array<Double3, 3> corners;
          if (taken || far_) corners = {at(face[0]), at(face[1]), at(face[2])};
          std::array<std::uint32_t, 3> in;
          for (std::size_t k = 0; k < 3; ++k) in[k] = far_ ? clustering.cell_of(corners[k]) : cells[face[k]];
          clustering.add_face(in);
          if (!taken) continue;
          clustering.add_shape(corners, in);
          figures.add(corners);
        }
      });
    });
    return faces;
  }

 private:
  static constexpr std::uint64_t kChecked = std::uint64_t{1} << 16;  ///< vertices between two looks at a stop

  std::uint64_t count() const { return far_ ? far_->size() : near_.size(); }
  void keep(std::span<const std::uint32_t> rgba) {
    if (!far_) {
      for (const Double3& p : local_) near_.push_back(to_float(p));
      if (has_colour_) near_rgba_.insert(near_rgba_.end(), rgba.begin(), rgba.end());
      return;
    }
    far_->append(local_);
    if (!has_colour_) return;
    local_.clear();
    for (const std::uint32_t c : rgba)
      local_.push_back({double(c & 0xff), double((c >> 8) & 0xff), double((c >> 16) & 0xff)});
    far_rgba_->append(local_);
  }
  /// Calls use(at, colour), both of the number of a vertex.
  template <class Use>
  void with_vertices(const Use& use) {
    if (far_)
      use([&](std::uint64_t i) { return far_->at(i); },
          [&](std::uint64_t i) {
            const Double3 c = far_rgba_->at(i);
            return 0xff000000u | static_cast<std::uint32_t>(c[0]) | static_cast<std::uint32_t>(c[1]) << 8 |
                   static_cast<std::uint32_t>(c[2]) << 16;
          });
    else
      use(
          [&](std::uint64_t i) {
            const Float3& p = near_[i];
            return Double3{p[0], p[1], p[2]};
          },
          [&](std::uint64_t i) { return near_rgba_[i] | 0xff000000u; });
  }

  bool has_colour_;
  std::vector<Float3> near_;
  std::vector<std::uint32_t> near_rgba_;
  std::optional<VertexStore> far_, far_rgba_;
  std::vector<Double3> local_;  ///< of a batch
  Double3 origin_{};
};

/// The mesh itself, while it is small enough: faces beyond are counted and no more.
void copy_faces(PreviewMesh& preview, MeshReader& mesh, Vertices& vertices) {
  FaceFigures figures;
  KeyTable number;
  const auto most = static_cast<std::size_t>(std::min(mesh.header().vertices, 3 * kMaxPreviewFaces));
  number.reserve(most);
  preview.position.reserve(most), preview.rgba.reserve(most);
  preview.faces.reserve(static_cast<std::size_t>(mesh.header().faces));
  vertices.each_face(mesh, [&](const auto& corners, const auto& rgba, const MeshFace& face) {
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

/// \param faces  of the mesh
void cluster_faces(PreviewMesh& preview, MeshReader& mesh, Vertices& vertices, std::uint64_t faces) {
  preview.position.clear(), preview.rgba.clear(), preview.faces.clear();
  for (preview.cell = vertices.find_cell(); preview.cell > 0.0; preview.cell *= kNextCell) {
    FaceFigures figures;
    VertexClustering clustering(preview.cell, kMaxPreviewFaces);
    preview.mesh_faces =
        vertices.cluster(mesh, FaceSample(faces / (kMaxCells * kShapesPerCell)), clustering, figures);
    if (!clustering.fits()) continue;
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
  std::uint64_t faces = mesh->header().faces;
  if (faces <= kMaxPreviewFaces) {
    copy_faces(preview, *mesh, vertices);
    faces = preview.mesh_faces;  // some formats do not say how many they have
  }
  if (faces > kMaxPreviewFaces) cluster_faces(preview, *mesh, vertices, faces);
  if (!vertices.has_colour()) preview.rgba.clear();
  preview.origin = vertices.origin();
  return preview;
}

}  // namespace tessera
