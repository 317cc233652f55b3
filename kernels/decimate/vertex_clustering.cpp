#include "kernels/decimate/vertex_clustering.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

constexpr int kBits = ClusterLattice::kBits;
constexpr std::int64_t kMiddle = ClusterLattice::kMiddle;

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

void ClusterSize::coarsen() {
  KeyTable coarse;
  for (const std::uint64_t key : occupied_.keys()) coarse.add(parent(key));
  occupied_ = std::move(coarse);
  cell_ *= 2.0;
  farthest_ = cell_ * static_cast<double>(kMiddle - 1);
  last_ = ~std::uint64_t{0};
}

void ClusterSize::add(const Double3& p) {
  if (!finite(p)) return;
  if (!has_first_) {
    first_ = p;
    has_first_ = true;
  }
  if (cell_ == 0.0) {
    const double apart =
        std::max({std::abs(p[0] - first_[0]), std::abs(p[1] - first_[1]), std::abs(p[2] - first_[2])});
    if (!(apart > 1e-280) || !(apart < 1e280)) return;
    cell_ = apart;
    farthest_ = cell_ * static_cast<double>(kMiddle - 1);
    add(first_);
  }
  // A cell within the range of keys, so that no two cells of one key lie apart.
  const double from_zero = std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2])});
  while (from_zero >= farthest_) coarsen();
  const std::uint64_t key = ClusterLattice(cell_).key(p);
  if (key == last_) return;
  last_ = key;
  occupied_.add(key);
  while (occupied_.size() > max_) coarsen();
}

double ClusterSize::cell() const {
  if (occupied_.size() == 0) return 0.0;
  KeyTable coarse;
  for (const std::uint64_t key : occupied_.keys()) coarse.add(parent(key));
  // By square roots, which every machine rounds alike.
  const auto count = static_cast<double>(occupied_.size());
  const double finer = std::sqrt(std::sqrt(count / static_cast<double>(coarse.size())));
  constexpr double kFourthRoot = 0.8408964152537145;  // of a half
  double cell = cell_, cells = count;
  for (int i = 0; i < 3 && cells * finer <= static_cast<double>(max_); ++i)
    cells *= finer, cell *= kFourthRoot;
  return cell;
}

VertexClustering::VertexClustering(double cell, std::size_t max_faces)
    : cell_(cell), grid_(cell), max_faces_(max_faces), max_cells_(max_faces * 5 / 8 + 3) {
  clusters_.reserve(max_cells_);
}

std::uint32_t VertexClustering::find(std::uint64_t key, const Double3& corner) {
  Recent& recent = recent_[(key * 0x9e3779b97f4a7c15u) >> 56];
  if (recent.key == key) return recent.number;
  const auto [number, is_new] = number_.add(key);
  if (is_new) {
    clusters_.emplace_back();
    clusters_.back().first = corner;
  }
  recent = {key, number};
  return number;
}

bool VertexClustering::add(const std::array<Double3, 3>& corners, const std::array<std::uint32_t, 3>& rgba) {
  if (!finite(corners[0]) || !finite(corners[1]) || !finite(corners[2])) return true;
  // Weighted by the area squared, as Lindstrom does.
  const Double3 wide = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const bool coloured = (rgba[0] | rgba[1] | rgba[2]) != 0;
  const std::array<std::uint64_t, 4> keys = grid_.keys(corners);
  // Most faces of a fine mesh lie in one cell.
  if (keys[0] == keys[1] && keys[0] == keys[2]) {
    Cluster& cluster = clusters_[find(keys[0], corners[0])];
    const Double3 at = corners[0] - cluster.first;
    const Double3 mean = (corners[0] + corners[1] + corners[2]) * (1.0 / 3.0);
    cluster.vertex.quadric += plane_quadric(wide, at, 3.0);
    cluster.vertex.add(mean - cluster.first, 3.0);
    if (coloured)
      for (const std::uint32_t colour : rgba) cluster.vertex.add_colour(colour, 1.0);
    return clusters_.size() + 3 <= max_cells_;
  }
  std::array<std::uint32_t, 3> face{};
  for (std::size_t k = 0; k < 3; ++k) {
    face[k] = find(keys[k], corners[k]);
    Cluster& cluster = clusters_[face[k]];
    cluster.vertex.quadric += plane_quadric(wide, corners[0] - cluster.first, 1.0);
    cluster.vertex.add(corners[k] - cluster.first, 1.0);
    if (coloured) cluster.vertex.add_colour(rgba[k], 1.0);
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
