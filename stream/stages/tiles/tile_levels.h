/// \file tile_levels.h
/// Where the levels of a job lie. Level 0 is the imported mesh, each further one the one below brought to about a quarter
/// of its faces: decimated within a tolerance of its own, or clustered (cluster_stage.h) where that would need a larger
/// one than cells. Every level is one mesh.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"
#include "stream/stages/decimate/simplify_options.h"

namespace tessera {

inline constexpr int kMaxLevels = 11;   ///< above level 0: enough for 4^11 tiles
inline constexpr int kLevelPasses = 2;  ///< of decimation; the second one is for the seams of the first
inline constexpr const char* kTilesImport = "mesh";

/// Folder of a level in the work directory: "level-1".
std::string level_folder(int level);
/// \param work  of the job
MeshStore open_level(const std::filesystem::path& work, int level);
/// As decimation left it, with the colours of the vertices that stayed. \pre the level is decimated
MeshStore open_decimated_level(const std::filesystem::path& work, int level);
/// How many levels there are above level 0 so far.
int levels_above(const std::filesystem::path& work);
/// The tolerance that the stage below chose for this level, or the edge of its cells; 0 where the level below is the last.
double level_tolerance(const std::filesystem::path& work, int level);

/// How a level is made of the one below. Each gives up what the one before it keeps, and so do all levels above.
enum class LevelMethod : std::uint8_t {
  kDecimation,                ///< creases and topology stay
  kDecimationWithoutCreases,  ///< where noise makes creases everywhere
  kClustering,                ///< loops, gaps and islands narrower than a cell close, join or go
};
/// \pre the level is there, above 0
LevelMethod level_method(const std::filesystem::path& work, int level);
std::string level_method_name(const std::filesystem::path& work, int level);  ///< "input" of level 0
/// How decimation makes a level, but for its tolerance.
SimplifyOptions level_options(LevelMethod method);
/// Whether the level is clustered; if not it is decimated, or not there.
bool level_is_clustered(const std::filesystem::path& work, int level);
/// Proven: no point of this level is farther from the one below, nor the other way round. 0 for level 0.
double level_step_bound(const std::filesystem::path& work, int level);

/// Memory of the stage that chooses a tolerance. \param faces  of the level below
std::uint64_t level_tolerance_bytes(std::uint64_t faces);

inline constexpr const char* kLevelCertificate = "certificate.json";  ///< below a level's folder
/// Of a clustered level, whose certificate is how far vertices were moved: measured both ways, nearer to the truth.
inline constexpr const char* kClusterCertificate = "cluster-certificate.json";

/// Stage "tolerance" in the folder of a level: the first method with which sample blocks of the level below shrink to a
/// quarter, and the least tolerance, in steps of a square root of two, or cell for it. Decimation may use one mean edge,
/// without creases two; clustering always succeeds. Says 0 where the level below is one tile already.
std::unique_ptr<Stage> make_level_tolerance_stage(const JobState& state, int level, std::uint64_t tile_faces);

}  // namespace tessera
