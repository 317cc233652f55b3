/// \file untangle_stages.h
/// Passes behind the last round of smoothing: where faces came to cross, overlap or touch others that they did not meet before,
/// vertices of both go back towards where they were given, half the way at first, then more, then all of it.
///
///   untangle-K  looks for such faces among what the passes before left, and lists their vertices; the last one only looks
///   untangle    writes the patches that have such vertices
#pragma once
#include <cstdint>
#include <vector>

#include "stream/files/json.h"
#include "stream/import/import_needs.h"
#include "stream/runtime/stage.h"
#include "stream/stages/smooth/smooth_plan.h"

namespace tessera {

inline constexpr int kUntangleRounds = 10;

/// \param plan  as for smooth_stages(); idle where nothing is smoothed or SmoothPlan::keep_crossings says so
std::vector<StageEntry> untangle_stages(const SmoothPlanner& plan);
/// The smoothed mesh, with what went back. \pre the stages are done
MeshStore open_untangled(const JobState& state, const SmoothPlan& plan);

/// Adds a stage's result to what the report tells of smoothing: {crossing_pairs_found, crossing_pairs, taken_back}: pairs of faces
/// that met where they had not, as smoothing left them and in the end, and vertices; `rms_move` falls.
void add_untangling(const Json& result, Json& moved);
std::vector<StageNeed> untangle_needs(const MeshSize& mesh, std::uint64_t patch_vertices);

/// Of a tile that reads so many vertices and faces.
std::uint64_t untangle_tile_bytes(std::uint64_t vertices, std::uint64_t faces);

}  // namespace tessera
