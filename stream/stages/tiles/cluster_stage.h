/// \file cluster_stage.h
/// A level that decimation cannot reach because borders, islands and sheets hold too many faces: by vertex clustering.
#pragma once
#include <cstdint>
#include <memory>

#include "stream/runtime/stage.h"

namespace tessera {

inline constexpr const char* kClusterFolder = "clustered/";  ///< below a level's folder

/// What a task takes at most. \param block_bytes  MeshStore::block_bytes of its largest block with the cells around
std::uint64_t cluster_task_bytes(std::uint64_t block_bytes);

/// The same, told before there is the level below. \param faces  of that   \param around  a block with what lies around it
std::uint64_t level_cluster_bytes(std::uint64_t faces, std::uint64_t around);

/// Stage "cluster" in the folder of a level. Its result has the bound of the level, `certified_max`, and how many faces
/// stay as they were, `faces_kept`.
std::unique_ptr<Stage> make_level_cluster_stage(const JobState& state, int level);

}  // namespace tessera
