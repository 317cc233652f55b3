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
constexpr double kNextCell = 1.189207115002721;  // fourth root of two, as ClusterSize tries them

/// Counts what every face has, whatever becomes of it. Positions are floats, so that squares of their differences neither vanish nor
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

Float3 to_float(const Double3& p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

/// The vertices of a mesh by number, relative to the first finite one, and their colours: side by side in memory where they fit.
class Vertices {
 public:
  Vertices(MeshReader& mesh, const std::filesystem::path& temp, std::uint64_t memory_bytes)
      : has_colour_(mesh.header().colour), size_(kMaxCells) {
    const std::uint64_t count = mesh.header().vertices;
    // Some formats do not say how many they have.
    if (count > 0 && count <= memory_bytes / (sizeof(Float3) + (has_colour_ ? sizeof(std::uint32_t) : 0))) {
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
        size_.add(q);
        local_[i] = q;
      }
      keep(rgba);
    });
    find_finer_cell();
  }

  const Double3& origin() const { return origin_; }
  double cell() const { return size_.cell(); }
  bool has_colour() const { return has_colour_; }

  /// Calls use(corners, colours, face) for every face.
  template <class Use>
  void each_face(MeshReader& mesh, const Use& use) {
    if (far_)
      each_face_of(
          mesh, [&](std::uint64_t i) { return far_->at(i); },
          [&](std::uint64_t i) {
            const Double3 c = far_rgba_->at(i);
            return 0xff000000u | static_cast<std::uint32_t>(c[0]) | static_cast<std::uint32_t>(c[1]) << 8 |
                   static_cast<std::uint32_t>(c[2]) << 16;
          },
          use);
    else
      each_face_of(
          mesh,
          [&](std::uint64_t i) {
            const Float3& p = near_[i];
            return Double3{p[0], p[1], p[2]};
          },
          [&](std::uint64_t i) { return near_rgba_[i] | 0xff000000u; }, use);
  }

 private:
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
  /// Where the first two vertices lie farther apart than others do, as of a sphere that was divided again and again.
  void find_finer_cell() {
    constexpr double kFiner = 1024.0;
    const std::uint64_t count = far_ ? far_->size() : near_.size();
    for (int round = 0; round < 3 && count > kMaxCells && !size_.is_settled() && size_.cell() > 0.0;
         ++round) {
      size_ = ClusterSize(kMaxCells, size_.cell() / kFiner);
      for (std::uint64_t i = 0; i < count; ++i)
        size_.add(far_ ? far_->at(i) : Double3{near_[i][0], near_[i][1], near_[i][2]});
    }
  }
  template <class At, class Colour, class Use>
  void each_face_of(MeshReader& mesh, const At& at, const Colour& colour, const Use& use) {
    mesh.read_faces([&](std::span<const MeshFace> batch) {
      throw_if_stopped();
      for (const MeshFace& face : batch) {
        std::array<std::uint32_t, 3> rgba{};
        if (has_colour_) rgba = {colour(face[0]), colour(face[1]), colour(face[2])};
        use(std::array<Double3, 3>{at(face[0]), at(face[1]), at(face[2])}, rgba, face);
      }
    });
  }

  bool has_colour_;
  std::vector<Float3> near_;
  std::vector<std::uint32_t> near_rgba_;
  std::optional<VertexStore> far_, far_rgba_;
  std::vector<Double3> local_;  ///< of a batch
  ClusterSize size_;
  Double3 origin_{};
};

/// The mesh itself, while it is small enough: faces beyond are counted and no more.
void copy_faces(PreviewMesh& preview, MeshReader& mesh, Vertices& vertices) {
  FaceFigures figures;
  KeyTable number;
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

void cluster_faces(PreviewMesh& preview, MeshReader& mesh, Vertices& vertices) {
  preview.position.clear(), preview.rgba.clear(), preview.faces.clear();
  for (preview.cell = vertices.cell(); preview.cell > 0.0; preview.cell *= kNextCell) {
    FaceFigures figures;
    VertexClustering clustering(preview.cell, kMaxPreviewFaces);
    preview.mesh_faces = 0;
    bool fits = true;
    vertices.each_face(mesh, [&](const auto& corners, const auto& rgba, const MeshFace&) {
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
