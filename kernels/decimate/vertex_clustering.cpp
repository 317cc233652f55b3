#include "kernels/decimate/vertex_clustering.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

ClusterCell cluster_cell(const Double3& p, double cell) {
  ClusterCell found;
  found.key = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    constexpr double kFarthest = std::numeric_limits<double>::infinity();
    constexpr auto kFirst = -static_cast<double>(kMiddle), kLast = static_cast<double>(kMiddle - 1);
    const double at = std::clamp(std::floor(p[a] / cell), kFirst, kLast);
    found.key |= static_cast<std::uint64_t>(static_cast<std::int64_t>(at) + kMiddle) << (kBits * a);
    found.low[a] = at == kFirst ? -kFarthest : at * cell;
    found.high[a] = at == kLast ? kFarthest : (at + 1.0) * cell;
  }
  return found;
}

std::uint64_t cluster_key(const Double3& p, double cell) {
  return cluster_cell(p, cell).key;
}

void ClusterSize::insert(Grid& grid, const Double3& p) const {
  const auto coarsen = [&] {
    KeyTable coarse;
    for (const std::uint64_t key : grid.occupied.keys()) coarse.add(parent(key));
    grid.occupied = std::move(coarse);
    grid.cell *= 2.0;
    grid.last = {};
  };
  if (grid.last.holds(p)) return;
  // A cell within the range of keys, so that no two cells of one key lie apart.
  const double farthest = std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2])});
  while (farthest / grid.cell >= static_cast<double>(kMiddle - 1)) coarsen();
  grid.last = cluster_cell(p, grid.cell);
  grid.occupied.add(grid.last.key);
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
const VertexClustering::Recent& VertexClustering::find(const Double3& corner) {
  for (const Recent& recent : recent_)
    if (recent.cell.holds(corner)) return recent;
  Recent& recent = recent_[next_recent_++ % recent_.size()];
  recent.cell = cluster_cell(corner, cell_);
  const auto [number, is_new] = number_.add(recent.cell.key);
  recent.number = number;
  if (is_new) {
    clusters_.emplace_back();
    clusters_.back().first = corner;
  }
  return recent;
}

bool VertexClustering::add(const std::array<Double3, 3>& corners, const std::array<std::uint32_t, 3>& rgba) {
  if (!finite(corners[0]) || !finite(corners[1]) || !finite(corners[2])) return true;
  // Weighted by the area squared, as Lindstrom does.
  const Double3 wide = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const bool coloured = (rgba[0] | rgba[1] | rgba[2]) != 0;
  const Recent& recent = find(corners[0]);
  std::array<std::uint32_t, 3> face{};
  face.fill(recent.number);
  // Most faces of a fine mesh lie in one cell.
  if (recent.cell.holds(corners[1]) && recent.cell.holds(corners[2])) {
    Cluster& cluster = clusters_[face[0]];
    const Double3 at = corners[0] - cluster.first;
    const Double3 mean = (corners[0] + corners[1] + corners[2]) * (1.0 / 3.0);
    cluster.vertex.quadric += plane_quadric(wide, at, 3.0);
    cluster.vertex.add(mean - cluster.first, 3.0);
    if (coloured)
      for (const std::uint32_t colour : rgba) cluster.vertex.add_colour(colour, 1.0);
  } else {
    for (std::size_t k = 0; k < 3; ++k) {
      face[k] = find(corners[k]).number;
      Cluster& cluster = clusters_[face[k]];
      cluster.vertex.quadric += plane_quadric(wide, corners[0] - cluster.first, 1.0);
      cluster.vertex.add(corners[k] - cluster.first, 1.0);
      if (coloured) cluster.vertex.add_colour(rgba[k], 1.0);
    }
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
