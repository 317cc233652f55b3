#include "stream/mesh_compare.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <vector>

#include "octree/error.h"
#include "stream/memory_budget.h"
#include "stream/numbers.h"
#include "stream/parallel.h"
#include "stream/scratch_folder.h"
#include "stream/stage_runner.h"

namespace tessera {
namespace {

constexpr int kMostSplits = 16;
constexpr double kCellsPerReach = 6.0;   // smaller cells would mostly load what their neighbours load
constexpr double kHalo = 1.0 + 0x1p-20;  // of the reach: more than the rounding of any distance

struct Cell {
  MeshBox box;
  std::uint64_t bytes = 0;
};

struct CellResult {
  DirectedDeviation there, back;
};

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
      : mesh_(mesh), reference_(reference), halo_(kHalo * reach), cell_faces_(cell_faces) {
    const Lattice& lattice = mesh.info().lattice;
    patch_edge_ = lattice.h * kBrickCells;
    for (const MeshStore* store : {&mesh, &reference})
      patch_edge_ = std::min(patch_edge_, store->info().lattice.h * kBrickCells);
  }

  std::vector<Cell> make() {
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
  std::vector<Cell> cells_;
};

/// Where the surface ends, as segments.
std::vector<std::array<std::uint32_t, 3>> border_segments(const MeshBlock& block) {
  std::vector<std::array<std::uint32_t, 3>> segments;
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t c = 0; c < 3; ++c)
      if (block.face_flags[f] >> c & 1) {
        const std::uint32_t end = block.faces[f][(c + 1) % 3];
        segments.push_back({block.faces[f][c], end, end});
      }
  return segments;
}

CellResult compare_cell(const MeshStore& mesh, const MeshStore& reference, const MeshBox& box,
                        const CertificateOptions& options) {
  const MeshBox near = grown(box, kHalo * options.reach);
  const MeshBlock a = mesh.load_box(near), b = reference.load_box(near);
  Double3 middle;
  for (std::size_t k = 0; k < 3; ++k) middle[k] = 0.5 * (box.low[k] + box.high[k]);
  const Box3 core{box.low, box.high};
  CellResult result;
  const auto both = [&](const std::vector<std::array<std::uint32_t, 3>>& of_a,
                        const std::vector<std::array<std::uint32_t, 3>>& of_b, DeviationReport& there,
                        DeviationReport& back) {
    there = certify_deviation({a.position, of_a}, &core, ClosestFaces(b.position, of_b, middle), options);
    back = certify_deviation({b.position, of_b}, &core, ClosestFaces(a.position, of_a, middle), options);
  };
  both(a.faces, b.faces, result.there.surface, result.back.surface);
  both(border_segments(a), border_segments(b), result.there.border, result.back.border);
  return result;
}

void merge(DirectedDeviation& into, const DirectedDeviation& part) {
  into.surface.merge(part.surface);
  into.border.merge(part.border);
}

}  // namespace

void CompareOptions::validate() const {
  if (!(tolerance > 0.0) || !std::isfinite(tolerance))
    throw UsageError("--tolerance " + number_text(tolerance) +
                     ": must be a length above 0 in the unit of the mesh");
  if (reach != 0.0 && !(reach >= tolerance)) throw UsageError("reach: must be at least the tolerance");
}

MeshComparison compare_meshes(const MeshStore& mesh, const MeshStore& reference,
                              const CompareOptions& options, WorkerPool& pool, MemoryBudget& budget) {
  options.validate();
  const auto start = std::chrono::steady_clock::now();
  MeshComparison out;
  out.tolerance = options.tolerance;
  out.reach = options.reach != 0.0 ? options.reach : 2.0 * options.tolerance;
  out.diagonal = reference.diagonal();
  out.faces[0] = mesh.face_count();
  out.faces[1] = reference.face_count();
  const std::vector<Cell> cells = CellMaker(mesh, reference, out.reach, options.cell_faces).make();
  out.cells = cells.size();
  CertificateOptions certificate;
  certificate.tolerance = options.tolerance;
  certificate.reach = out.reach;
  // The larger box has at most 2^15 of its diagonals squared of area; 2^62 units hold them.
  const double scale = std::max(mesh.diagonal(), reference.diagonal());
  certificate.area_unit = scale > 0.0 ? scale * scale * 0x1p-47 : 1.0;
  std::vector<CellResult> results(cells.size());
  pool.run_tasks(
      cells.size(), [&](std::size_t i) { return cells[i].bytes; }, budget,
      [&](std::size_t i) {
        if (options.check_stop) options.check_stop();
        results[i] = compare_cell(mesh, reference, cells[i].box, certificate);
      });
  for (const CellResult& result : results) {
    merge(out.there, result.there);
    merge(out.back, result.back);
  }
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

MeshComparison compare_mesh_files(const std::filesystem::path& mesh, const std::filesystem::path& reference,
                                  const CompareOptions& options, const RunOptions& run) {
  options.validate();
  const ScratchFolder scratch(run.temp, "compare");
  const MeshStore a = import_mesh(mesh, scratch.path(), "mesh", run, options.check_stop);
  const MeshStore b = import_mesh(reference, scratch.path(), "reference", run, options.check_stop);
  WorkerPool pool(run.threads);
  MemoryBudget budget(run.memory_bytes, resident_bytes());
  return compare_meshes(a, b, options, pool, budget);
}

}  // namespace tessera
