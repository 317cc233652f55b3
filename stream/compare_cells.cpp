#include "stream/compare_cells.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "kernels/closest_face.h"

namespace tessera {
namespace {

constexpr int kMostSplits = 16;
constexpr double kCellsPerReach = 4.0;  // smaller cells would mostly load what their neighbours load

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

/// Octree over a cube around both meshes. A cell is split while its patches hold too many faces; below the
/// size of a patch the table says no more, and the count is taken to fall by four per split, as surfaces do.
class CellMaker {
 public:
  CellMaker(const MeshStore& mesh, const MeshStore& reference, double reach, std::uint64_t cell_faces)
      : mesh_(mesh), reference_(reference), halo_(kCompareHalo * reach), cell_faces_(cell_faces) {
    const Lattice& lattice = mesh.info().lattice;
    patch_edge_ = lattice.h * kBrickCells;
    for (const MeshStore* store : {&mesh, &reference})
      patch_edge_ = std::min(patch_edge_, store->info().lattice.h * kBrickCells);
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
      edge = std::max(edge, box.high[k] - box.low[k]);
    }
    // Each cell shares its planes with its neighbours bit by bit: corner + edge * (an exact fraction).
    corner_ = box.low;
    edge_ = edge * (1.0 + 0x1p-30);
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
    const double finer = std::max(0.0, std::ceil(std::log2(patch_edge_ / size)));
    const double expected = static_cast<double>(faces) * std::ldexp(1.0, -2 * static_cast<int>(finer));
    if (expected <= static_cast<double>(cell_faces_) || level == kMostSplits ||
        size < kCellsPerReach * halo_) {
      const std::uint64_t index = faces * (ClosestFaces::bytes_per_face() + 32);
      cells_.push_back({box, mesh_.block_bytes(a) + reference_.block_bytes(b) + index});
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
  double patch_edge_ = 0.0;
  Double3 corner_{};
  double edge_ = 0.0;
  std::vector<CompareCell> cells_;
};

}  // namespace

std::vector<CompareCell> make_compare_cells(const MeshStore& mesh, const MeshStore& reference, double reach,
                                            std::uint64_t cell_faces) {
  return CellMaker(mesh, reference, reach, cell_faces).make();
}

}  // namespace tessera
