/// \file level_ends.h
/// Where a surface with levels ends: passes over its store that do what "border", "loops" and "holes" do with patches of one
/// cell size (stages/weld, stages/surface).
///
///   border  the line in which a noisy scan ends becomes smooth, every stretch of it by the cells there
///   loops   boundary loops, chained from the edges at which faces say that the surface ends
///   holes   fills those that --max-hole names, where the filling crosses nothing
///   ends    writes the store with moved vertices and fillings
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/files/packed_file.h"
#include "stream/meshes/mesh_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stage.h"
#include "stream/stages/crossings/crossing_stages.h"
#include "stream/stages/surface/hole_limit.h"

namespace tessera {

inline constexpr const char* kEndedFolder = "full-ended/";  ///< the store that they leave
inline constexpr const char* kLevelLoopFolder = "level-loops/";
inline constexpr const char* kLevelHoleFolder = "level-holes/";

/// None where neither option asks for them.
std::vector<StageEntry> level_end_stages(const ReconstructOptions& options);

/// What a job has to do there. \pre the survey is done
struct LevelEnds {
  double lift = 0.0;  ///< scan units: what noise leaves unknown of where the surface is; 0 = borders stay
  HoleLimit holes;    ///< widths in cells of the smallest size at the rim
  bool any() const { return lift > 0.0 || holes.edges > 0; }
};
LevelEnds level_ends(const JobState& state);

/// The surface before, without the islands that went.
MeshStore open_level_surface(const JobState& state);
/// With its ends, where they were made. Also of jobs with one cell size whose surface is in stores.
StoreFiles ended_surface_files(const JobState& state);

/// Edge of the cells of every patch of a store with levels, scan units.
std::vector<double> patch_cells(const MeshStore& store, const JobState& state);

/// One filling in a file of fillings. Rims are named by keys, new vertices by their numbers in the file.
struct LevelFilling {
  std::uint64_t patch = 0;  ///< that its faces go to
  std::uint32_t vertices = 0, faces = 0, rim = 0, unused = 0;
  Section position, rgba;  ///< of the rim, then of new vertices: Double3; colours, or empty
  Section names, corners;  ///< keys of the rim; per face three numbers, those of the rim first
  Section patches;         ///< that may hold a vertex of the rim, std::uint64_t
};
inline constexpr PackedKind kLevelFillingKind = {"TSLFILL1", "a file of fillings"};
std::string level_filling_file(std::size_t task);

std::unique_ptr<Stage> make_level_border_stage(const JobState& state);
std::unique_ptr<Stage> make_level_loops_stage(const JobState& state);
std::unique_ptr<Stage> make_level_holes_stage(const JobState& state);
std::unique_ptr<Stage> make_level_ends_stage(const JobState& state);

/// What a task takes at most. \param patch_bytes  MeshStore::largest_patch_bytes
std::uint64_t level_border_task_bytes(std::uint64_t patch_bytes);
std::uint64_t level_loops_task_bytes(std::uint64_t patch_bytes);
std::uint64_t level_loops_finish_bytes();
std::uint64_t level_holes_task_bytes(std::uint64_t patch_bytes, std::uint32_t edges);
std::uint64_t level_ends_task_bytes(std::uint64_t patch_bytes);

/// A batch of loops: per loop n, its vertices, the third ones. Numbers are a patch, then a vertex of it (32 bits each).
std::vector<std::filesystem::path> list_level_loops(const std::filesystem::path& work);
std::vector<std::uint64_t> load_level_loops(const std::filesystem::path& file);

}  // namespace tessera
