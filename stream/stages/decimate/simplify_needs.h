/// \file simplify_needs.h
/// What passes of decimation and their proof will take, told from the number of faces before there is a mesh.
#pragma once
#include <cstdint>
#include <vector>

#include "stream/import/import_plan.h"
#include "stream/runtime/stage.h"
#include "stream/stages/decimate/simplify_options.h"

namespace tessera {

/// Bytes of a block of so many faces of a surface while it is loaded.
std::uint64_t surface_block_bytes(std::uint64_t faces);

/// Whole patches around a block, or a cell of the certificate, belong to what is read for it: all of it so many times, where
/// bricks are large against the body.
inline constexpr std::uint64_t kMaxAround = 2;

/// Memory of the largest task of a pass, in a round that keeps nothing.
/// \param faces          of the whole mesh
/// \param largest_patch  faces of it
/// \param around         1 to kMaxAround
std::uint64_t simplify_pass_bytes(const SimplifyOptions& options, int pass, std::uint64_t faces,
                                  std::uint64_t largest_patch, std::uint64_t around);

/// Memory of the largest cell of the certificate. \param faces  of mesh and reference together
std::uint64_t certify_cell_bytes(std::uint64_t faces, std::uint64_t largest_patch, std::uint64_t around);

/// Of `certify` and `write`. \param reference, result  faces of both meshes
/// \param brick_vertices  that the reference was imported with (ImportSource)
std::vector<StageNeed> proof_needs(const RunOptions& run, std::uint64_t reference, std::uint64_t result,
                                   std::uint64_t brick_vertices = ImportPlan::kBrickVertices);

/// Of the stages of the first round over an imported mesh, and of `write`.
std::vector<StageNeed> simplify_needs(const RunOptions& run, const SimplifyOptions& options,
                                      std::uint64_t faces);

/// The same of `reconstruct`: of a pass of the first round, of its proof, of the output.
StageForecast forecast_simplify(const PlannedScan& scan, const SimplifyOptions& options, int pass);
StageForecast forecast_certify(const PlannedScan& scan);
StageForecast forecast_store_write(const PlannedScan& scan);

/// Microseconds a face: of the first pass, also where the surface stage has it, and of writing.
inline constexpr double kFirstPassFaceTime = 0.65, kWriteFaceTime = 0.02;

}  // namespace tessera
