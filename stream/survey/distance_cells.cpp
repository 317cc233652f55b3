#include "stream/survey/distance_cells.h"

#include <algorithm>
#include <cmath>

#include "kernels/mesh/signed_distance.h"

namespace tessera {
namespace {

constexpr std::uint64_t kLeastCellFaces = 1u << 16;
/// Every open cell costs a buffer of points: huge meshes get larger cells, not more of them.
constexpr std::uint64_t kMostCells = 4096;
/// A cell beside the mesh may hold little of it and touch much.
constexpr std::uint64_t kNearFaces = 4;
/// While no more than so many times the faces of a cell are near, a wider reach settles more points at once.
constexpr std::uint64_t kReachFaces = 2;
/// What is loaded around a cell at least, in edges of patches: most points of a scan lie far nearer to its mesh than
/// this, and the ring costs little beside the cell.
constexpr double kLeastReach = 1.0 / 8;

}  // namespace

DistanceCells::DistanceCells(const MeshStore& mesh, double max_distance)
    : mesh_(mesh),
      max_distance_(max_distance),
      patch_edge_(mesh.info().lattice.h * kBrickCells),
      cell_faces_(std::max(kLeastCellFaces, mesh.face_count() / kMostCells)),
      reached_(grown(mesh.box(), max_distance)) {
  least_reach_ = std::min(max_distance, kLeastReach * patch_edge_);
  // Cells meet where patches meet. Each shares its planes with its neighbours bit by bit: corner + edge * (an exact fraction).
  double extent = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    corner_[a] = std::floor(reached_.low[a] / patch_edge_) * patch_edge_;
    while (corner_[a] > reached_.low[a]) corner_[a] -= patch_edge_;
    extent = std::max(extent, reached_.high[a] - corner_[a]);
  }
  edge_ = patch_edge_;
  while (edge_ < extent * (1.0 + 0x1p-30)) edge_ *= 2.0;
  std::vector<std::size_t> all(mesh.patches().size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  nodes_.emplace_back();
  split(0, {0, 0, 0}, 0, all);
}

double DistanceCells::plane(std::size_t axis, std::uint64_t at, int level) const {
  return corner_[axis] + std::ldexp(edge_ * static_cast<double>(at), -level);
}

std::uint64_t DistanceCells::faces_of(std::span<const std::size_t> patches) const {
  std::uint64_t faces = 0;
  for (const std::size_t p : patches) faces += mesh_.patches()[p].faces;
  return faces;
}

/// Of the patches whose middle lies in the box.
std::uint64_t DistanceCells::faces_inside(std::span<const std::size_t> patches, const MeshBox& box) const {
  std::uint64_t faces = 0;
  for (const std::size_t p : patches) {
    const MeshPatchEntry& e = mesh_.patches()[p];
    bool inside = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const double middle = 0.5 * (e.box.low[a] + e.box.high[a]);
      inside = inside && middle >= box.low[a] && middle < box.high[a];
    }
    if (inside) faces += e.faces;
  }
  return faces;
}

std::uint64_t DistanceCells::load_bytes(const MeshStore& mesh, std::span<const std::size_t> patches) {
  std::uint64_t vertices = 0, faces = 0;
  for (const std::size_t p : patches)
    vertices += mesh.patches()[p].vertices, faces += mesh.patches()[p].faces;
  return mesh.block_bytes(patches) + SignedDistance::bytes(vertices, faces);
}

DistanceCell DistanceCells::make_cell(const MeshBox& box) const {
  DistanceCell cell{box, max_distance_, 0};
  std::vector<std::size_t> near = mesh_.select(grown(box, cell.reach));
  while (cell.reach > least_reach_ && faces_of(near) > kReachFaces * cell_faces_) {
    cell.reach = std::max(least_reach_, 0.5 * cell.reach);
    near = mesh_.select(grown(box, cell.reach));
  }
  cell.bytes = cell.wide_bytes = load_bytes(mesh_, near);
  cell.wide_reach = cell.reach;
  while (cell.wide_reach < max_distance_) {
    const double wider = std::min(max_distance_, 2.0 * cell.wide_reach);
    near = mesh_.select(grown(box, wider));
    if (faces_of(near) > kNearFaces * cell_faces_) break;
    cell.wide_reach = wider;
    cell.wide_bytes = load_bytes(mesh_, near);
  }
  return cell;
}

void DistanceCells::split(std::size_t node, const std::array<std::uint64_t, 3>& at, int level,
                          const std::vector<std::size_t>& patches) {
  MeshBox box;
  for (std::size_t a = 0; a < 3; ++a)
    box.low[a] = plane(a, at[a], level), box.high[a] = plane(a, at[a] + 1, level);
  std::vector<std::size_t> near;
  for (const std::size_t p : patches)
    if (overlap(mesh_.patches()[p].box, grown(box, least_reach_))) near.push_back(p);
  const bool small = faces_inside(near, box) <= cell_faces_ && faces_of(near) <= kNearFaces * cell_faces_;
  if (small || std::ldexp(edge_, -level) <= patch_edge_) {
    nodes_[node].cell = cells_.size();
    cells_.push_back(make_cell(box));
    return;
  }
  const std::size_t child = nodes_.size();
  nodes_[node].child = child;
  nodes_.resize(child + 8);
  for (std::uint64_t k = 0; k < 8; ++k)
    split(child + k, {2 * at[0] + (k & 1), 2 * at[1] + (k >> 1 & 1), 2 * at[2] + (k >> 2)}, level + 1, near);
}

std::size_t DistanceCells::find(const Double3& p) const {
  for (std::size_t a = 0; a < 3; ++a)
    if (!(p[a] >= reached_.low[a] && p[a] <= reached_.high[a])) return kNone;
  std::array<std::uint64_t, 3> at = {0, 0, 0};
  std::size_t node = 0;
  for (int level = 1; nodes_[node].cell == kNone; ++level) {
    std::size_t k = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const bool upper = p[a] >= plane(a, 2 * at[a] + 1, level);
      at[a] = 2 * at[a] + (upper ? 1 : 0);
      k |= static_cast<std::size_t>(upper ? 1 : 0) << a;
    }
    node = nodes_[node].child + k;
  }
  return nodes_[node].cell;
}

}  // namespace tessera
