#include "kernels/decimate/vertex_clustering.h"

#include <algorithm>
#include <cmath>

#include "octree/lanes.h"

namespace tessera {
namespace {

constexpr int kBits = 21;  // of a coordinate in a key: x in the lowest
constexpr std::int64_t kMiddle = std::int64_t{1} << (kBits - 1);
using Long4 = Mask4;

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

/// Where a key is looked for among those that came last.
std::size_t recent_slot(std::uint64_t key) {
  static_assert(kRecentCells == 1u << 11);
  return static_cast<std::size_t>((key * 0x9e3779b97f4a7c15u) >> (64 - 11));
}

/// Coordinates of cells, from 0 on. \pre finite
Long4 cells_of(Double4 position, double inverse) {
  using Int4 [[gnu::vector_size(4 * sizeof(std::int32_t))]] = std::int32_t;
  constexpr auto kFirst = -static_cast<double>(kMiddle), kLast = static_cast<double>(kMiddle - 1);
  const Double4 first = Double4{} + kFirst, last = Double4{} + kLast;
  Double4 at = position * inverse;
  at = at < first ? first : at;
  at = at > last ? last : at;
  const Int4 towards_zero = __builtin_convertvector(at, Int4);
  const Long4 cell = __builtin_convertvector(towards_zero, Long4);
  return cell + (__builtin_convertvector(towards_zero, Double4) > at) + kMiddle;  // what holds is minus one
}

/// plane_quadric() of a plane through a point at `distance` along its normal, side by side: numbers that are stored one by one and loaded
/// four at a time are waited for.
struct PlaneQuadric {
  Double4 first, second;  ///< as Quadric has them
  double bz, c;

  PlaneQuadric(const Double3& n, double distance, double weight) {
    const double x = n[0] * weight, y = n[1] * weight, z = n[2] * weight;
    first = Double4{x, x, x, y} * Double4{n[0], n[1], n[2], n[1]};
    second = Double4{y, z, x, y} * Double4{n[2], n[2], distance, distance};
    bz = z * distance;
    c = weight * distance * distance;
  }
  void add_to(Quadric& q) const {
    store4(&q.xx, load4(&q.xx) + first);
    store4(&q.yz, load4(&q.yz) + second);
    q.bz += bz;
    q.c += c;
  }
};

}  // namespace

std::uint64_t ClusterLattice::key(const Double3& p) const {
  const Long4 cell = cells_of(Double4{p[0], p[1], p[2], 0.0}, inverse_);
  return static_cast<std::uint64_t>(cell[0] | cell[1] << kBits | cell[2] << (2 * kBits));
}

ClusterSize::ClusterSize(std::size_t max_cells, double first_cell) : max_(max_cells) {
  occupied_.reserve(max_cells + 1);
  coarse_.reserve(max_cells + 1);
  begin(first_cell);
}

void ClusterSize::begin(double cell) {
  cell_ = cell;
  farthest_ = cell_ * static_cast<double>(kMiddle - 1);
  recent_.fill(~std::uint64_t{0});
}

void ClusterSize::coarsen() {
  coarse_.clear();
  for (const std::uint64_t key : occupied_.keys()) coarse_.add(parent(key));
  std::swap(occupied_, coarse_);
  begin(2.0 * cell_);
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
    begin(apart);
    add(first_);
  }
  // A cell within the range of keys, so that no two cells of one key lie apart.
  const double from_zero = std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2])});
  while (from_zero >= farthest_) coarsen();
  const std::uint64_t key = ClusterLattice(cell_).key(p);
  std::uint64_t& recent = recent_[recent_slot(key)];
  if (recent == key) return;
  recent = key;
  occupied_.add(key);
  while (occupied_.size() > max_) {
    coarsen();
    is_settled_ = true;
  }
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
  number_.reserve(max_cells_ + 1);
  seen_.reserve(max_faces + 1);
  faces_.reserve(max_faces);
}

std::uint32_t VertexClustering::add_vertex(const Double3& p, std::uint32_t rgba) {
  if (!finite(p) || !fits_) return kNoCell;
  const std::uint64_t key = grid_.key(p);
  Recent& recent = recent_[recent_slot(key)];
  if (recent.key != key) {
    const auto [number, is_new] = number_.add(key);
    if (is_new) {
      fits_ = clusters_.size() < max_cells_;
      if (!fits_) return kNoCell;
      clusters_.emplace_back();
      clusters_.back().first = p;
    }
    recent = {key, number};
  }
  Cluster& cluster = clusters_[recent.number];
  cluster.vertex.add(p - cluster.first, 1.0);
  if (rgba != 0) cluster.vertex.add_colour(rgba, 1.0);
  return recent.number;
}

std::uint32_t VertexClustering::cell_of(const Double3& p) const {
  if (!finite(p)) return kNoCell;
  const std::uint64_t key = grid_.key(p);
  const Recent& recent = recent_[recent_slot(key)];
  if (recent.key == key) return recent.number;
  const std::size_t number = number_.find(key);
  return number < clusters_.size() ? static_cast<std::uint32_t>(number) : kNoCell;
}

void VertexClustering::add_face(const std::array<std::uint32_t, 3>& cells) {
  if (cells[0] == cells[1] || cells[1] == cells[2] || cells[2] == cells[0]) return;
  std::array<std::uint32_t, 3> face = cells;
  std::rotate(face.begin(), std::min_element(face.begin(), face.end()), face.end());
  if (*std::max_element(face.begin(), face.end()) == kNoCell || !fits_) return;
  const std::uint64_t name =
      face[0] | std::uint64_t{face[1]} << kBits | std::uint64_t{face[2]} << (2 * kBits);
  if (!seen_.add(name).second) return;
  fits_ = faces_.size() < max_faces_;
  if (fits_) faces_.push_back(face);
}

void VertexClustering::add_shape(const std::array<Double3, 3>& corners,
                                 const std::array<std::uint32_t, 3>& cells) {
  if (std::max({cells[0], cells[1], cells[2]}) == kNoCell) return;
  // Weighted by the area squared, as Lindstrom does.
  const Double3 wide = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const auto add = [&](std::uint32_t cell, double corners_in_it) {
    Cluster& cluster = clusters_[cell];
    PlaneQuadric(wide, dot(wide, corners[0] - cluster.first), corners_in_it).add_to(cluster.vertex.quadric);
  };
  // Most faces of a fine mesh lie in one cell.
  if (cells[0] == cells[1] && cells[0] == cells[2]) return add(cells[0], 3.0);
  for (const std::uint32_t cell : cells) add(cell, 1.0);
}

ClusteredMesh VertexClustering::finish() const {
  ClusteredMesh mesh;
  std::vector<std::uint32_t> number(clusters_.size(), ~0u);
  mesh.position.reserve(clusters_.size());
  mesh.rgba.reserve(clusters_.size());
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
