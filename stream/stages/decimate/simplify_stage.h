/// \file simplify_stage.h
/// One pass of decimation over a store: semantic blocks, each decimated by itself with its seams locked.
/// Seams of one pass lie inside the blocks of the next.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/meshes/mesh_blocking.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/runtime/stage.h"
#include "stream/stages/bake/bake_colours.h"
#include "stream/stages/decimate/simplify_options.h"

namespace tessera {

/// Rounds. Where the certificate fails, all passes run once more and leave the reference as it is near the faces that
/// failed; blocks that nothing changes in are taken over from the round before. Each round keeps farther around, and
/// decimation works at half the tolerance of the one before from the second one on in the blocks concerned.
inline constexpr int kMaxRounds = 4;
/// Of a block's part of the reference, in blocks: the most that a pass works against at once.
inline constexpr std::uint64_t kReferenceBlocks = 8;

struct SimplifyPass {
  int pass = 0;              ///< from 0
  int round = 0;             ///< from 0, below kMaxRounds
  bool count_costs = false;  ///< write nothing, count what an unlimited run would remove per class of cost
  std::string stage_name() const;
  std::string folder() const;  ///< of what the pass leaves, "pass-1/" for the first
};

/// File of the faces that fail at the end of a round; there if another round follows.
std::string failed_faces_file(int round);
/// The last round that there is so far.
int last_round(const std::filesystem::path& work);
/// Where the passes of a job find what they work on.
struct SimplifyStores {
  /// The mesh of full resolution: what the first pass of a round reads, and what the bounds of the passes are against.
  std::function<MeshStore(const JobState&)> full;
  /// What the first pass of the first round left, and its blocks, where that ran in another stage; else empty.
  std::function<MeshStore(const JobState&)> after_first;
  std::function<std::vector<MeshBlockCut>(const MeshStore& full)> first_blocks;
  /// Whether it did, where that is known only during the job; else empty: where there is `after_first`.
  std::function<bool(const JobState&)> first_done = {};
  /// What passes and certificate may use of the tolerance, where that is known only during the job; else empty: all.
  std::function<double(const JobState&)> tolerance_left = {};
  /// What the certificate is against where `full` was smoothed, with bounds of its faces to it; else empty.
  std::function<MeshStore(const JobState&)> given = {};

  /// How the job's output holds the result, where the box of `full` does not tell it; else empty. What that takes of the
  /// tolerance is off `tolerance_left` then.
  std::function<MeshPlacement(const JobState&)> placed = {};

  /// Colours of textures, where the result gets any.
  std::function<std::unique_ptr<BakeColours>(const JobState&)> colours = {};

  /// With the tolerance as it was asked for, or found.
  SimplifyOptions requested(const JobState& state, SimplifyOptions chosen) const {
    if (tolerance_left) chosen.tolerance = tolerance_left(state);
    return chosen;
  }
  /// With what rounding in the output leaves of it: for passes and certificate.
  SimplifyOptions options(const JobState& state, SimplifyOptions chosen) const {
    chosen = requested(state, chosen);
    if (!placed && chosen.tolerance > 0.0)
      chosen.tolerance =
          tolerance_before_rounding(state.output, chosen.tolerance, placement(state, chosen.tolerance));
    return chosen;
  }
  MeshPlacement placement(const JobState& state, double tolerance) const {
    if (!holds_floats_only(state.output)) return {};
    return placed ? placed(state) : store_placement(state.output, full(state), tolerance);
  }
  bool ran_first(const JobState& state) const { return after_first && (!first_done || first_done(state)); }
  MeshStore reference(const JobState& state) const { return given ? given(state) : full(state); }
};
/// Where a pass reads: the mesh of full resolution for the first, else what the pass before left.
MeshStore open_pass_input(const JobState& state, const SimplifyStores& stores, const SimplifyPass& pass);

// Reports of passes.
Json to_json(const DecimateReport& report);

/// The blocks of a pass over `in`; a pure function of the tables of both stores.
std::vector<MeshBlockCut> simplify_blocks(const MeshStore& in, const MeshStore& reference,
                                          const SimplifyOptions& options, int pass);

/// What a task takes at most. \param block_bytes  MeshStore::block_bytes of its largest block and that block's reference
std::uint64_t simplify_task_bytes(std::uint64_t block_bytes, std::uint64_t faces,
                                  std::uint64_t reference_faces, std::uint64_t failed_bytes);

/// A pass of a round that is not needed has no tasks.
std::unique_ptr<Stage> make_simplify_stage(const JobState& state, const SimplifyOptions& options,
                                           const SimplifyStores& stores, const SimplifyPass& pass);

}  // namespace tessera
