#include "stream/stages/decimate/simplify_needs.h"

#include <algorithm>
#include <array>

#include "stream/check/compare_cells.h"
#include "stream/check/mesh_compare.h"
#include "stream/import/import_plan.h"
#include "stream/meshes/mesh_store_output.h"
#include "stream/meshes/parts_at_once.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/stages/decimate/certify_stage.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/plan/forecast_rates.h"
#include "stream/stages/plan/planned_scan.h"

namespace tessera {
namespace {

/// A cell of the certificate is read with whole patches around it.
constexpr std::uint64_t kCellHalo = 3;

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
          store_write_need(run, surface_block_bytes(largest_patch(result)), patches, sort_bytes(run))};
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

namespace {

constexpr double kCertifyTime = 0.43;  ///< microseconds a face
constexpr double kPassBytes = 0.3;     ///< on disk, a face

}  // namespace

StageForecast forecast_simplify(const PlannedScan& scan, const SimplifyOptions& options, int pass) {
  const auto faces = bytes_of(scan.faces, rates::kFacesMargin);
  const std::uint64_t blocks = scan.groups.size() / 2 + 1;
  const std::array<double, 3> time = {kFirstPassFaceTime, 0.27, 0.13};  // microseconds a face
  return {.tasks = blocks,
          .task_bytes = simplify_pass_bytes(options, pass, faces, scan.largest_patch.faces, 1),
          .finish_bytes = std::uint64_t{2} << 20,
          .sure_bytes = simplify_task_bytes(0, 0, 0, 0),
          .disk_bytes = bytes_of(scan.faces, kPassBytes),
          .files = blocks,
          .processor_us = scan.faces * time[static_cast<std::size_t>(std::min(pass, 2))],
          .moved_bytes =
              (pass < 2 ? 0.5 : 0.2) * static_cast<double>(scan.surface_bytes + scan.smoothed_bytes / 2)};
}

StageForecast forecast_certify(const PlannedScan& scan) {
  const auto faces = bytes_of(scan.faces, rates::kFacesMargin);
  const std::uint64_t both = faces + faces / 4;  // with those of the result
  const std::uint64_t cell = certify_cell_bytes(both, scan.largest_patch.faces, 1);
  return {.tasks = scan.groups.size(),
          .task_bytes = certify_task_bytes(cell),
          .finish_bytes = max_bytes_at_once(scan.run, certify_finish_bytes(cell, scan.groups.size()),
                                            certify_lane_bytes(cell)),
          .sure_bytes = certify_task_bytes(0),
          .files = scan.groups.size(),
          .processor_us = scan.faces * kCertifyTime,
          .moved_bytes = static_cast<double>(scan.surface_bytes + scan.smoothed_bytes / 2)};
}

StageForecast forecast_store_write(const PlannedScan& scan) {
  const std::uint64_t patch = surface_block_bytes(scan.largest_patch.faces), sort = sort_bytes(scan.run);
  return {
      .finish_bytes = max_bytes_at_once(
          scan.run, write_mesh_store_bytes(patch, scan.patches.entries.size(), sort), patch),
      .sure_bytes = write_mesh_store_bytes(0, 0, sort),
      .disk_bytes = scan.output_bytes,
      .files = 1,
      .processor_us = scan.faces * kWriteFaceTime,
      .moved_bytes = static_cast<double>(scan.surface_bytes + scan.smoothed_bytes / 2 + scan.output_bytes)};
}

}  // namespace tessera
