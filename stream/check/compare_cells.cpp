#include "stream/check/compare_cells.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/mesh/closest_face.h"

namespace tessera {
namespace {

constexpr int kMaxSplits = 16;
constexpr double kCellsPerDistance = 4.0;  // smaller cells would mostly load what their neighbours load

/// Patches of one mesh that a cell needs, of those that its parent needed.
std::vector<std::size_t> near_patches(const MeshStore& store, const std::vector<std::size_t>& of,
                                      const MeshBox& box) {
  std::vector<std::size_t> out;
  for (const std::size_t p : of)
    if (overlap(store.patches()[p].box, box)) out.push_back(p);
  return out;
}

std::uint64_t face_count(const MeshStore& store, const std::vector<std::size_t>& patches) {
  std::uint64_t faces = 0;
  for (const std::size_t p : patches) faces += store.patches()[p].faces;
  return faces;
}

/// Of the patches whose middle lies in the box.
std::uint64_t faces_around(const MeshStore& store, const std::vector<std::size_t>& patches,
                           const MeshBox& box) {
  std::uint64_t faces = 0;
  for (const std::size_t p : patches) {
    const MeshPatchEntry& e = store.patches()[p];
    bool inside = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const double middle = 0.5 * (e.box.low[k] + e.box.high[k]);
      inside = inside && middle >= box.low[k] && middle < box.high[k];
    }
    if (inside) faces += e.faces;
  }
  return faces;
}

/// Octree over a cube around both meshes, aligned to the bricks of the finer one. A cell is split while the patches
/// in it hold too many faces; below the size of a patch the table says no more, and the count is taken to fall by
/// four per split, as surfaces do.
class CellMaker {
 public:
  CellMaker(const MeshStore& mesh, const MeshStore& reference, double max_distance, std::uint64_t cell_faces)
      : mesh_(mesh), reference_(reference), halo_(kCompareHalo * max_distance), cell_faces_(cell_faces) {
    const MeshStore& finer = mesh.face_count() > reference.face_count() ? mesh : reference;
    lattice_ = finer.info().lattice;
    patch_edge_ = lattice_.h * kBrickCells;
  }

  std::vector<CompareCell> make() {
    std::vector<std::size_t> all[2];
    for (std::size_t i = 0; i < mesh_.patches().size(); ++i) all[0].push_back(i);
    for (std::size_t i = 0; i < reference_.patches().size(); ++i) all[1].push_back(i);
    MeshBox box = mesh_.patches().empty() ? reference_.box() : mesh_.box();
    double edge = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!reference_.patches().empty()) {
        box.low[k] = std::min(box.low[k], reference_.box().low[k]);
        box.high[k] = std::max(box.high[k], reference_.box().high[k]);
      }
      corner_[k] = std::floor(box.low[k] / patch_edge_) * patch_edge_;
      while (corner_[k] > box.low[k]) corner_[k] -= patch_edge_;
      edge = std::max(edge, box.high[k] - corner_[k]);
    }
    // A whole number of bricks, so that cells meet where patches meet, for a power of two bricks an edge or more
    // of them. Each cell shares its planes with its neighbours bit by bit: corner + edge * (an exact fraction).
    edge_ = patch_edge_;
    while (edge_ < edge * (1.0 + 0x1p-30)) edge_ *= 2.0;
    split({0, 0, 0}, 0, all[0], all[1]);
    return std::move(cells_);
  }

 private:
  void split(const std::array<std::uint64_t, 3>& at, int level, const std::vector<std::size_t>& mesh_patches,
             const std::vector<std::size_t>& reference_patches) {
    const double size = std::ldexp(edge_, -level);
    MeshBox box;
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = corner_[k] + std::ldexp(edge_ * static_cast<double>(at[k]), -level);
      box.high[k] = corner_[k] + std::ldexp(edge_ * static_cast<double>(at[k] + 1), -level);
    }
    const std::vector<std::size_t> a = near_patches(mesh_, mesh_patches, grown(box, halo_));
    const std::vector<std::size_t> b = near_patches(reference_, reference_patches, grown(box, halo_));
    if (near_patches(mesh_, a, box).empty() && near_patches(reference_, b, box).empty()) return;
    const std::uint64_t faces = face_count(mesh_, a) + face_count(reference_, b);
    double expected = 0.0;
    if (size >= patch_edge_) {
      expected = static_cast<double>(faces_around(mesh_, a, box) + faces_around(reference_, b, box));
    } else {
      const int finer = static_cast<int>(std::ceil(std::log2(patch_edge_ / size)));
      expected = static_cast<double>(faces) * std::ldexp(1.0, -2 * finer);
    }
    if (expected <= static_cast<double>(cell_faces_) || level == kMaxSplits ||
        size < kCellsPerDistance * halo_) {
      cells_.push_back(
          {box, compare_cell_bytes(mesh_.block_bytes(a) + reference_.block_bytes(b), faces), faces});
      return;
    }
    for (std::uint64_t child = 0; child < 8; ++child)
      split({2 * at[0] + (child & 1), 2 * at[1] + (child >> 1 & 1), 2 * at[2] + (child >> 2)}, level + 1, a,
            b);
  }

  const MeshStore& mesh_;
  const MeshStore& reference_;
  const double halo_;
  const std::uint64_t cell_faces_;
  Lattice lattice_;
  double patch_edge_ = 0.0;
  Double3 corner_{};
  double edge_ = 0.0;
  std::vector<CompareCell> cells_;
};

}  // namespace

std::uint64_t compare_cell_bytes(std::uint64_t block_bytes, std::uint64_t faces) {
  return block_bytes + faces * (ClosestFaces::bytes_per_face() + 32);
}

std::vector<CompareCell> make_compare_cells(const MeshStore& mesh, const MeshStore& reference,
                                            double max_distance, std::uint64_t cell_faces) {
  return CellMaker(mesh, reference, max_distance, cell_faces).make();
}

}  // namespace tessera
