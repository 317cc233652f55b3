/// \file brick_needs.h
/// Memory that stages take by the bricks of a plan.
#pragma once
#include <cstdint>
#include <span>

#include "stream/meshes/patch_store.h"
#include "stream/points/plan.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/options.h"
#include "stream/stages/reconstruct/forecast_list.h"

namespace tessera {

/// Of the end of the close stage. \param bricks  ascending key
std::uint64_t planned_close_bytes(const RunOptions& run, std::span<const BrickEntry> bricks);

/// Of a task of the seen stage. \param bricks  of the plan
std::uint64_t planned_seen_bytes(const Plan& plan, std::span<const BrickEntry> bricks);

/// Of a task of the coverage stage. \param stored  the mesh lies in a store, else in welded patches
std::uint64_t planned_coverage_bytes(bool stored, const PatchEntry& largest, std::uint64_t filling_bytes);

/// Adds the stages of the top surface, and of the ground where that is wanted. \returns what they keep on disk
/// \param points_bytes, overlay_bytes  that they read
std::uint64_t forecast_top(const RunOptions& run, const ReconstructOptions& options, const Plan& plan,
                           std::span<const BrickEntry> bricks, std::uint64_t points_bytes,
                           std::uint64_t overlay_bytes, ForecastList& list);

/// Whether the top surface may stand in for strewn points: the orient stage knows which kind of scene it is.
bool may_have_top(const ReconstructOptions& options);

}  // namespace tessera
