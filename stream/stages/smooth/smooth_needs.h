/// \file smooth_needs.h
/// What the rounds of smoothing will take, told before there is a mesh.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "kernels/smooth/smooth.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_plan.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Of a round over one patch and the rings around it, the least that a tile can be; of the whole mesh where there is one
/// block. \param patch_vertices  of a patch, at most as many as an import puts into one
StageNeed smooth_round_need(const SmoothRound& rule, std::size_t round, const MeshSize& mesh,
                            std::uint64_t patch_vertices);

/// Of a round that a coarse level belongs to: of its sums, of the level, and of the filter behind it.
std::vector<StageNeed> coarse_needs(const SmoothRound& rule, std::size_t round, const MeshSize& mesh,
                                    std::uint64_t patch_vertices);

/// Of reach and noise alone. \param patch_vertices  of the largest patch
std::vector<StageNeed> noise_needs(const MeshSize& mesh,
                                   std::uint64_t patch_vertices = ImportPlan::kBrickVertices);

/// Of all stages of smoothing before decimation (smooth_before.h). \param patch_vertices  of the largest patch
std::vector<StageNeed> smooth_before_needs(const std::string& method, const MeshSize& mesh,
                                           std::uint64_t patch_vertices = ImportPlan::kBrickVertices);
/// The same of `reconstruct`. \param stage  as smooth_before_stages() names it
StageForecast forecast_smoothing(const PlannedScan& scan, const std::string& stage);

/// Of all rounds over an imported mesh.
std::vector<StageNeed> smooth_needs(const std::vector<SmoothRound>& rounds, const MeshSize& mesh);

}  // namespace tessera
