/// \file deform_needs.h
/// What the stages of an edit take: told before there is a mesh, and reserved by the same functions.
#pragma once
#include <cstdint>
#include <vector>

#include "stream/runtime/stage.h"
#include "stream/stages/deform/deform_files.h"
#include "stream/stages/deform/deform_options.h"
#include "stream/stages/deform/edit_script.h"

namespace tessera {

/// Faces that splits may leave on the way to the base. \param faces  that decimation leaves
std::uint64_t base_capacity(std::uint64_t faces, std::uint64_t base_vertices);
/// Vertices of a base whose edges are split: no more are made.
std::uint64_t most_split(std::uint64_t base_vertices);
/// Whether the options let edges be split that are long beside the support.
bool may_split(const DeformOptions& options);
/// What splitting takes beside the base. 0 where the options do not ask for it.
std::uint64_t split_base_bytes(const DeformOptions& options);
/// The mesh that a base is made of.
struct BaseInput {
  std::uint64_t vertices = 0, faces = 0;
  std::uint64_t loading_bytes = 0;  ///< MeshStore::block_bytes()
};
/// Of which nothing is known but these: in patches of what is left of a stream bed's scan 1.25 vertices a face were.
BaseInput base_input(std::uint64_t faces);
/// \param own  it is its own base
std::uint64_t base_stage_bytes(bool own, const BaseInput& input, std::uint64_t base_vertices);

/// What the fronts of the system take beside the factor; how much of the factor is held in memory under the cap, the rest being
/// on disk; and all of the stage.
std::uint64_t fronts_bytes(std::uint64_t vertices, const EditScript& script);
std::uint64_t held_factor_bytes(std::uint64_t vertices, const EditScript& script, const RunOptions& run);
std::uint64_t basis_stage_bytes(std::uint64_t vertices, const EditScript& script, const RunOptions& run);

struct WriteStageSize {
  std::uint64_t basis_bytes = 0;  ///< of the file, without details
  std::uint64_t vertices = 0, faces = 0;
  bool poses = true, volumes = false;
};
WriteStageSize basis_size(const BasisReader& basis, bool poses);
std::uint64_t write_stage_bytes(const WriteStageSize& size, const RunOptions& run);

/// Faces that decimation leaves for a base of so many vertices: remeshing wants something to choose from.
inline constexpr std::uint64_t kDecimatedFaces = 3;

/// Of all stages, by what the file says of itself; of `apply` by its basis.
std::vector<StageNeed> deform_needs(const JobState& state, const DeformOptions& options);

}  // namespace tessera
