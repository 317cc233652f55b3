/// \file remesh_stage.h
/// One pass of remeshing over a store: the blocks of decimation, each remeshed by itself with its seams locked. Seams of
/// one pass lie inside the blocks of the next.
#pragma once
#include <memory>
#include <vector>

#include "stream/runtime/stage.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/remesh/remesh_options.h"
#include "stream/stages/remesh/sizing_stage.h"

namespace tessera {

/// Of a block's part of the reference, in blocks: the most that a pass works against at once.
inline constexpr std::uint64_t kRemeshReferenceBlocks = 4;

/// What a task takes at most. \param block_bytes  MeshStore::block_bytes of its largest block and that block's reference
std::uint64_t remesh_task_bytes(std::uint64_t block_bytes, std::uint64_t max_faces,
                                std::uint64_t reference_faces, std::uint64_t failed_bytes, bool evens);

/// Of the largest task of a pass, told before there is a mesh.
/// \param faces  of the mesh   \param around  as in simplify_pass_bytes()
std::uint64_t remesh_pass_bytes(const RemeshJobOptions& options, std::uint64_t faces, std::uint64_t around,
                                int pass);

/// The blocks of a pass over `in`; a pure function of the tables of both stores.
std::vector<MeshBlockCut> remesh_blocks(const MeshStore& in, const MeshStore& reference,
                                        const RemeshJobOptions& options, const Sizing& sizing, int pass);

/// Reads and leaves what the pass of decimation of the same name would. A pass of a round that is not needed has no
/// tasks.
std::unique_ptr<Stage> make_remesh_stage(const JobState& state, const RemeshJobOptions& options,
                                         const SimplifyStores& stores, const SimplifyPass& pass);

}  // namespace tessera
