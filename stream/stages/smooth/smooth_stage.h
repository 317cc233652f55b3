/// \file smooth_stage.h
/// Smoothing out of core: every round of smooth.h is one pass over a store, tile by tile with a halo of whole
/// rings.
///
///   reach     longest edge of every patch: how far rings can reach
///   sums-K    of rounds with a coarse level: what every patch adds to its system
///   coarse-K  of these rounds: the system, solved in core
///   smooth-K  round K: store K - 1 -> store K; store 0 is the mesh as it is given. A plate's cycle leaves in bend-K
///             how its vertices bend
///   untangle  untangle_stages.h
///
/// They stand in the job of `smooth` and, between the mesh of full resolution and its decimation, in others
/// (smooth_before.h).
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "kernels/smooth/smooth.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/job.h"
#include "stream/runtime/option_table.h"
#include "stream/runtime/stage.h"
#include "stream/stages/smooth/coarse_files.h"
#include "stream/stages/smooth/smooth_tiles.h"

namespace tessera {

OptionTable option_table(SmoothOptions& options);

/// The whole job: import, rounds, output. One input. The report's `mesh` has {vertices, faces, largest_move, rms_move,
/// ...}.
JobDescription smooth_job(const SmoothOptions& options);

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

/// reach, and all stages of these rounds. \param rounds  the most that the plan may have; those it has not are idle
std::vector<StageEntry> smooth_stages(const std::vector<SmoothRound>& rounds, const SmoothPlanner& plan);
/// Store after `round` rounds. \pre they are done
MeshStore open_smoothed(const JobState& state, const SmoothPlan& plan, std::size_t round);

// What the stages share.

/// Folder of the store of a round from 1 on.
std::string smooth_folder(std::size_t round);

/// Cell edges and filter of a round with a coarse level, from the mesh that its step began with.
CoarseOptions coarse_options(const JobState& state, const SmoothPlan& plan, std::size_t round);
/// The round whose store the step of this round began with: it makes the rows.
std::size_t base_round(const SmoothPlan& plan, std::size_t round);
/// How the mesh bends where the round begins: empty before the first cycle of a step, and with order 1.
PatchLaplacians laplacians_of(const std::filesystem::path& work, const SmoothPlan& plan, std::size_t round);
/// Edges of a patch, as PatchRange keeps them.
struct PatchEdges {
  double longest = 0.0, squares = 0.0;
};
PatchEdges edges_of(const MeshBlock& patch);
std::string range_file(std::size_t round);
/// How far the last round left a vertex from where it was given, at most: what it saved there.
std::string moved_file(std::size_t round);
void save_longest_move(const std::filesystem::path& path, double move);
double longest_move(const std::filesystem::path& work, std::size_t rounds);
/// From `edges` of the summaries of a stage's tasks: [patch, longest edge, sum of squares].
void save_range(const std::vector<Json>& summaries, std::size_t patches, const std::filesystem::path& path);
PatchRange load_range(const std::filesystem::path& work, std::size_t round);
/// Buffers of the file that a task writes, tables.
inline constexpr std::uint64_t kTileSlackBytes = std::uint64_t{16} << 20;
/// Bytes of a tile while it is loaded, and what stays.
std::uint64_t tile_loading_bytes(std::uint64_t vertices, std::uint64_t faces);
std::uint64_t tile_loaded_bytes(std::uint64_t vertices, std::uint64_t faces);
/// Of a tile in a round, without the solution of a coarse level. \param patch_bytes  of the largest patch
std::uint64_t smooth_tile_bytes(const SmoothRound& rule, std::uint64_t vertices, std::uint64_t faces,
                                std::uint64_t patch_bytes);

std::unique_ptr<Stage> make_range_stage(const JobState& state, const SmoothPlan& plan);
std::unique_ptr<Stage> make_coarse_sums_stage(const JobState& state, const SmoothPlan& plan,
                                              std::size_t round);
std::unique_ptr<Stage> make_coarse_stage(const JobState& state, const SmoothPlan& plan, std::size_t round);
std::unique_ptr<Stage> make_smooth_stage(const JobState& state, const SmoothPlan& plan, std::size_t round);

}  // namespace tessera
