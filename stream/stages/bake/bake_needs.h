/// \file bake_needs.h
/// What the stages of textures will take.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "stream/runtime/options.h"
#include "stream/runtime/stage.h"
#include "stream/stages/plan/planned_scan.h"

namespace tessera {

/// Memory of the stage "texture-points" beside what reading takes.
std::uint64_t bake_points_bytes(std::uint64_t sort_bytes, std::uint64_t patches);

/// Of all stages, before the mesh is read: of blocks half full, at least.
/// \param faces  of the mesh that gets textures   \param brick_vertices  that it was imported with
std::vector<StageNeed> bake_needs(const RunOptions& run, std::uint64_t page_size, std::uint64_t faces,
                                  std::uint64_t brick_vertices);

/// Of a stage of a reconstruction with `--texture`. \param texel  units of the scan; not above 0: automatic
/// \param normals  with normal maps of the mesh of full resolution
StageForecast forecast_texture(const PlannedScan& scan, const std::string& stage, double texel, bool normals);

}  // namespace tessera
