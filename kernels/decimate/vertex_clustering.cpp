#include "kernels/decimate/vertex_clustering.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr int kBits = 21;  // of a coordinate in a key
constexpr std::int64_t kMiddle = std::int64_t{1} << (kBits - 1);

bool finite(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// The same cell on a grid twice as coarse.
std::uint64_t parent(std::uint64_t key) {
  std::uint64_t up = 0;
  for (int a = 0; a < 3; ++a) {
    const auto biased = static_cast<std::int64_t>((key >> (kBits * a)) & ((1u << kBits) - 1));
    up |= static_cast<std::uint64_t>(((biased - kMiddle) >> 1) + kMiddle) << (kBits * a);
  }
  return up;
}

}  // namespace

std::uint64_t cluster_key(const Double3& p, double cell) {
  std::uint64_t key = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    const double at =
        std::clamp(std::floor(p[a] / cell), -static_cast<double>(kMiddle), static_cast<double>(kMiddle - 1));
    key |= static_cast<std::uint64_t>(static_cast<std::int64_t>(at) + kMiddle) << (kBits * a);
  }
  return key;
}

void ClusterSize::insert(Grid& grid, const Double3& p) const {
  const auto coarsen = [&] {
    KeyTable coarse;
    for (const std::uint64_t key : grid.occupied.keys()) coarse.add(parent(key));
    grid.occupied = std::move(coarse);
    grid.cell *= 2.0;
    grid.last = ~std::uint64_t{0};
  };
  // A cell within the range of keys, so that no two cells of one key lie apart.
  const double farthest = std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2])});
  while (farthest / grid.cell >= static_cast<double>(kMiddle - 1)) coarsen();
  const std::uint64_t key = cluster_key(p, grid.cell);
  if (key == grid.last) return;
  grid.last = key;
  grid.occupied.add(key);
  while (grid.occupied.size() > max_) coarsen();
}

void ClusterSize::add(const Double3& p) {
  if (!finite(p)) return;
  if (!has_first_) {
    first_ = p;
    has_first_ = true;
  }
  if (grids_[0].cell == 0.0) {
    const double apart =
        std::max({std::abs(p[0] - first_[0]), std::abs(p[1] - first_[1]), std::abs(p[2] - first_[2])});
    if (!(apart > 1e-280) || !(apart < 1e280)) return;
    constexpr double kFourthRoots[] = {1.0, 1.189207115002721, 1.4142135623730951, 1.681792830507429};
    for (std::size_t g = 0; g < grids_.size(); ++g) {
      grids_[g].cell = apart * kFourthRoots[g];
      insert(grids_[g], first_);
    }
  }
  for (Grid& grid : grids_) insert(grid, p);
}

double ClusterSize::cell() const {
  double minimum = grids_[0].cell;
  for (const Grid& grid : grids_) minimum = std::min(minimum, grid.cell);
  return minimum;
}

VertexClustering::VertexClustering(double cell, std::size_t max_faces)
    : cell_(cell), max_faces_(max_faces), max_cells_(max_faces * 5 / 8 + 3) {
  clusters_.reserve(max_cells_);
}

/// Faces that follow one another mostly lie in the same cells.
std::uint32_t VertexClustering::cluster_of(std::uint64_t key, const Double3& corner) {
  for (const Recent& recent : recent_)
    if (recent.key == key) return recent.number;
  const auto [number, is_new] = number_.add(key);
  if (is_new) {
    clusters_.emplace_back();
    clusters_.back().first = corner;
  }
  recent_[next_recent_++ % recent_.size()] = {key, number};
  return number;
}

bool VertexClustering::add(const std::array<Double3, 3>& corners, const std::array<std::uint32_t, 3>& rgba) {
  if (!finite(corners[0]) || !finite(corners[1]) || !finite(corners[2])) return true;
  // Weighted by the area squared, as Lindstrom does. Most faces of a fine mesh lie in one cell: looked up once.
  const Double3 wide = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const double square = dot(wide, wide);
  const Double3 normal = square > 0.0 ? wide * (1.0 / std::sqrt(square)) : Double3{};
  std::array<std::uint64_t, 3> key{};
  for (std::size_t k = 0; k < 3; ++k) key[k] = cluster_key(corners[k], cell_);
  const bool one_cell = key[0] == key[1] && key[1] == key[2];
  std::array<std::uint32_t, 3> face{};
  for (std::size_t k = 0; k < 3; ++k) {
    if (k == 0 || !one_cell) {
      face[k] = cluster_of(key[k], corners[k]);
      Cluster& cluster = clusters_[face[k]];
      cluster.vertex.quadric +=
          plane_quadric(normal, corners[0] - cluster.first, one_cell ? 3.0 * square : square);
    } else {
      face[k] = face[0];
    }
    Cluster& cluster = clusters_[face[k]];
    cluster.vertex.add(corners[k] - cluster.first, 1.0);
    cluster.vertex.add_colour(rgba[k], 1.0);
  }
  if (clusters_.size() + 3 > max_cells_) return false;
  if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) return true;
  std::rotate(face.begin(), std::min_element(face.begin(), face.end()), face.end());
  const std::uint64_t name =
      face[0] | std::uint64_t{face[1]} << kBits | std::uint64_t{face[2]} << (2 * kBits);
  if (!seen_.add(name).second) return true;
  if (faces_.size() == max_faces_) return false;
  faces_.push_back(face);
  return true;
}

ClusteredMesh VertexClustering::finish() const {
  ClusteredMesh mesh;
  std::vector<std::uint32_t> number(clusters_.size(), ~0u);
  mesh.faces = faces_;
  for (auto& face : mesh.faces)
    for (std::uint32_t& corner : face) {
      const Cluster& cluster = clusters_[corner];
      if (number[corner] == ~0u) {
        number[corner] = static_cast<std::uint32_t>(mesh.position.size());
        mesh.position.push_back(cluster.first + cluster.vertex.position(cell_));
        mesh.rgba.push_back(cluster.vertex.rgba());
      }
      corner = number[corner];
    }
  return mesh;
}

}  // namespace tessera
