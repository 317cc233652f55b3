/// \file islands_stage.h
/// Passes "islands" and "prune" of a reconstruction whose first pass of decimation is fused (first_pass.h): components
/// are joined across blocks and counted by faces of the full-resolution surface, as everywhere; those that are too
/// small go from it and from what the first pass left of it, and vertices at the sides of blocks go back
/// (sides_stage.h).
#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "stream/files/packed_file.h"
#include "stream/runtime/stage.h"

namespace tessera {

struct ReconstructOptions;

/// Of the stage "islands" for the other: per file of the surface stage, parts that go (IslandPart), ascending by block.
inline constexpr const char* kDroppedFile = "islands/dropped.bin";
inline constexpr PackedKind kDroppedKind = {"TSDROPD3", "a file of dropped islands"};

/// What joining the components takes at most. \param parts  components of all blocks
std::uint64_t islands_bytes(const RunOptions& run, std::uint64_t parts);
/// What a task of the prune stage takes at most. \param block_bytes  of its largest block, MeshStore::block_bytes
std::uint64_t prune_task_bytes(std::uint64_t block_bytes);

/// Without tasks: its finish joins the components.
std::unique_ptr<Stage> make_islands_stage(const JobState& state);
StageForecast forecast_islands(const PlannedScan& scan);
/// What stands behind "surface" where that leaves stores: "sides", but with levels, "islands" and "prune", which has a task for each
/// file of the surface stage that holds a part of an island that goes or a vertex that goes back.
std::vector<StageEntry> store_end_stages(const ReconstructOptions& options);

}  // namespace tessera
