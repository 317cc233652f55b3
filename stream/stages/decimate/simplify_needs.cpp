#include "stream/stages/decimate/simplify_needs.h"

#include <algorithm>

#include "stream/check/compare_cells.h"
#include "stream/check/mesh_compare.h"
#include "stream/import/import_plan.h"
#include "stream/meshes/mesh_store_output.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/stages/decimate/certify_stage.h"
#include "stream/stages/decimate/simplify_stage.h"

namespace tessera {
namespace {

/// A cell of the certificate is read with whole patches around it.
constexpr std::uint64_t kCellHalo = 3;
constexpr double kVerticesPerFace = 0.6;  ///< of blocks: those at seams are there in every patch

/// Of an imported mesh whose vertices lie evenly.
std::uint64_t largest_patch(std::uint64_t faces) {
  return std::clamp<std::uint64_t>(faces, 1, 2 * ImportPlan::kBrickVertices);
}

}  // namespace

std::uint64_t surface_block_bytes(std::uint64_t faces) {
  return MeshStore::block_bytes(static_cast<std::uint64_t>(static_cast<double>(faces) * kVerticesPerFace),
                                faces);
}

std::uint64_t simplify_pass_bytes(const SimplifyOptions& options, int pass, std::uint64_t faces,
                                  std::uint64_t largest_patch, std::uint64_t around) {
  // A block is filled up to its limit or is one brick; so is the part of the reference that it works against.
  const std::uint64_t in = std::min(faces, std::max(options.block_faces, largest_patch));
  const std::uint64_t reference =
      pass == 0 ? 0
                : std::min(faces, around * std::max(kReferenceBlocks * options.block_faces, largest_patch));
  return simplify_task_bytes(surface_block_bytes(in) + surface_block_bytes(reference), in, reference, 0);
}

std::uint64_t certify_cell_bytes(std::uint64_t faces, std::uint64_t largest_patch, std::uint64_t around) {
  const std::uint64_t in =
      std::min(faces, around * kCellHalo * std::max(CompareOptions{}.cell_faces, largest_patch));
  return compare_cell_bytes(surface_block_bytes(in), in);
}

std::vector<StageNeed> proof_needs(const RunOptions& run, std::uint64_t reference, std::uint64_t result,
                                   std::uint64_t brick_vertices) {
  const std::uint64_t patches = reference / std::clamp<std::uint64_t>(reference, 1, 2 * brick_vertices);
  const auto certify = [&](std::uint64_t around) {
    const std::uint64_t cell = certify_cell_bytes(reference + result, largest_patch(reference), around);
    return std::max(certify_task_bytes(cell), certify_finish_bytes(cell, patches));
  };
  return {{"certify", certify(1), certify(kMaxAround)},
          {"write",
           write_mesh_store_bytes(surface_block_bytes(largest_patch(result)), patches, sort_bytes(run)), 0}};
}

std::vector<StageNeed> simplify_needs(const RunOptions& run, const SimplifyOptions& options,
                                      std::uint64_t faces) {
  std::vector<StageNeed> needs = proof_needs(run, faces, faces / 4);
  for (int pass = 0; pass < options.passes; ++pass)
    needs.push_back({SimplifyPass{pass, 0, false}.stage_name(),
                     simplify_pass_bytes(options, pass, faces, largest_patch(faces), 1),
                     simplify_pass_bytes(options, pass, faces, largest_patch(faces), kMaxAround)});
  return needs;
}

}  // namespace tessera
