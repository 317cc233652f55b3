/// \file tile_levels.h
/// Where the levels of a job lie. Level 0 is the imported mesh, each further one the one below decimated to about a
/// quarter of its faces within a tolerance of its own. Every level is one mesh.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

inline constexpr int kMaxLevels = 11;   ///< above level 0: enough for 4^11 tiles
inline constexpr int kLevelPasses = 2;  ///< of decimation; the second one is for the seams of the first
inline constexpr const char* kTilesImport = "mesh";

/// Folder of a level in the work directory: "level-1".
std::string level_folder(int level);
/// \param work  of the job
MeshStore open_level(const std::filesystem::path& work, int level);
/// How many levels there are above level 0 so far.
int levels_above(const std::filesystem::path& work);
/// The tolerance that the stage below chose for this level; 0 where the level below is the last one.
double level_tolerance(const std::filesystem::path& work, int level);
/// Proven: no point of this level is farther from the one below, nor the other way round. 0 for level 0.
double level_step_bound(const std::filesystem::path& work, int level);

/// Memory of the stage that chooses a tolerance. \param faces  of the level below
std::uint64_t level_tolerance_bytes(std::uint64_t faces);

inline constexpr const char* kLevelCertificate = "certificate.json";  ///< below a level's folder

/// Stage "tolerance" in the folder of a level: the least tolerance, in steps of a square root of two, within which sample
/// blocks of the level below shrink to a quarter. Says 0 where that level is one tile already, or nothing helps.
std::unique_ptr<Stage> make_level_tolerance_stage(const JobState& state, int level, std::uint64_t tile_faces);

}  // namespace tessera
