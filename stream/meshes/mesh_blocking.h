/// \file mesh_blocking.h
/// Semantic blocks over a store: maximal nodes of an octree of bricks, or of the binary tree within it, that stay within limits.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "stream/meshes/mesh_store.h"

namespace tessera {

/// The limits. Blocks are a pure function of them and the table of patches: never of cap, threads or tiles.
struct MeshBlocking {
  std::uint64_t max_faces = 1u << 16;  ///< a brick that exceeds a limit is a block of its own
  std::uint64_t max_weight = ~std::uint64_t{0};
  Int3 shift = {0, 0, 0};  ///< added to brick coordinates: moves the seams between blocks
  /// Nodes part in halves, across z, y and x in turn, instead of eighths: blocks are half full or more, not an eighth.
  bool halves = false;
};

/// One block: all patches of a box of bricks, a cube but for halves.
struct MeshBlockCut {
  std::vector<std::size_t> patches;  ///< ascending
  Int3 first_brick = {0, 0, 0};      ///< of the box, both inclusive; may lie below zero
  Int3 last_brick = {0, 0, 0};
  std::uint64_t faces = 0;
  std::uint64_t weight = 0;
  /// The brick of a face by its centroid, or the nearest one of the box: blocks never write to bricks of others.
  std::uint64_t brick_of(const Lattice& lattice, const Double3& a, const Double3& b, const Double3& c) const;
};

/// \param weight  per patch, or empty: what else adds up to a limit
std::vector<MeshBlockCut> make_blocks(const MeshStore& store, const MeshBlocking& blocking,
                                      std::span<const std::uint64_t> weight = {});

/// Items that follow each other, put together to tasks: the first item of every task, and one more at the end.
/// \param faces       of each item; of a block with its weight
/// \param task_faces  from so many on a task is worth a file; more where there would be hundreds of tasks
std::vector<std::size_t> tasks_by_faces(std::span<const std::uint64_t> faces, std::uint64_t task_faces);
std::vector<std::size_t> tasks_by_faces(std::span<const MeshBlockCut> blocks, std::uint64_t task_faces);
std::vector<std::size_t> tasks_by_faces(std::span<const MeshPatchEntry> patches, std::uint64_t task_faces);

/// The faces of a block as patches of their bricks.
void write_block(const MeshBlockCut& cut, const Lattice& lattice, const MeshBlock& block,
                 MeshFileWriter& writer);

/// Shift of pass p = 0, 1, 2, ...: no two of three passes in a row have a seam in common but where a single brick is a
/// block.
Int3 pass_shift(int pass);

}  // namespace tessera
