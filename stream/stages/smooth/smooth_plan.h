/// \file smooth_plan.h
/// What the stages of smoothing agree on: rounds, names of files, bytes of a tile.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "kernels/smooth/smooth.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/job.h"
#include "stream/stages/smooth/coarse_files.h"
#include "stream/stages/smooth/patch_range.h"

namespace tessera {

/// What the stages of one job agree on.
struct SmoothPlan {
  std::vector<SmoothRound> rounds;
  double tolerance = 0.0;                          ///< 0 = no limit
  std::function<MeshStore(const JobState&)> mesh;  ///< round 0
  std::string mesh_folder;  ///< "mesh/": deleted once no round reads it; empty: kept, others do
  /// Faces of the last store bear as MeshBlock::face_bound the largest move of their corners: a face moves with its
  /// corners, so it lies within that of what it was, both ways. With a tolerance only.
  bool bounds = false;
  bool keep_crossings = false;  ///< nothing goes back (untangle_stages.h)
};
/// Called when a stage is made, all before it being done.
using SmoothPlanner = std::function<SmoothPlan(const JobState&)>;

/// Store after `round` rounds. \pre they are done
MeshStore open_smoothed(const JobState& state, const SmoothPlan& plan, std::size_t round);

/// Folder of the store of a round from 1 on.
std::string smooth_folder(std::size_t round);

/// Cell edges and filter of a round with a coarse level, from the mesh that its step began with.
CoarseOptions coarse_options(const JobState& state, const SmoothPlan& plan, std::size_t round);
/// The round whose store the step of this round began with: it makes the rows.
std::size_t base_round(const SmoothPlan& plan, std::size_t round);
/// How the mesh bends where the round begins: empty before the first cycle of a step, and with order 1.
PatchLaplacians laplacians_of(const std::filesystem::path& work, const SmoothPlan& plan, std::size_t round);
std::string range_file(std::size_t round);
PatchRange load_range(const std::filesystem::path& work, std::size_t round);
/// How far the last round left a vertex from where it was given, at most: what it saved there.
std::string moved_file(std::size_t round);
void save_longest_move(const std::filesystem::path& path, double move);
double longest_move(const std::filesystem::path& work, std::size_t rounds);
/// Buffers of the file that a task writes, tables.
inline constexpr std::uint64_t kTileSlackBytes = std::uint64_t{16} << 20;
/// Bytes of a tile while it is loaded, and what stays.
std::uint64_t tile_loading_bytes(std::uint64_t vertices, std::uint64_t faces);
std::uint64_t tile_loaded_bytes(std::uint64_t vertices, std::uint64_t faces);
/// Of a tile in a round, without the solution of a coarse level. \param patch_bytes  of the largest patch
std::uint64_t smooth_tile_bytes(const SmoothRound& rule, std::uint64_t vertices, std::uint64_t faces,
                                std::uint64_t patch_bytes);

}  // namespace tessera
