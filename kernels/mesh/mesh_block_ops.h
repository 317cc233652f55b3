/// \file mesh_block_ops.h
/// Merging, cutting and ordering of mesh blocks (mesh_block.h). All of it by keys: the same block whatever
/// the order of what goes in.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// Sorts vertices by key, drops those that no face uses, turns every face so that its smallest index comes
/// first (border bits along), sorts faces. `tag` (one per face, or empty) moves along.
/// \pre keys are unique
void canonicalise(MeshBlock& block, std::vector<std::uint8_t>* tag = nullptr);

/// The faces with keep != 0 and their vertices. The result is canonical if `block` is.
[[nodiscard]] MeshBlock select_faces(const MeshBlock& block, std::span<const std::uint8_t> keep);

/// Merges blocks that may share vertices (by key) but no face. Canonical.
/// \param tags  one per piece, given to all its faces; may be empty
/// \param slot  if not null: number in the result of every vertex of every piece, one piece after the other
/// \throws std::logic_error when one key has two positions
MeshBlock merge_blocks(std::span<const MeshBlock* const> pieces, std::span<const std::uint8_t> tags,
                       std::vector<std::uint8_t>* tag_of_face = nullptr,
                       std::vector<std::uint32_t>* slot = nullptr);

/// Per vertex 1 if its star is complete: each edge at it has two faces in the block or is a border.
[[nodiscard]] std::vector<std::uint8_t> complete_stars(const MeshBlock& block);

/// Cuts a block into patches by a class per face; hands them out in ascending class. Each is canonical if
/// `block` is.
void split_faces(const MeshBlock& block, std::span<const std::uint64_t> class_of_face,
                 const std::function<void(std::uint64_t, MeshBlock&&)>& sink);

/// Brick of a face: that of its centroid.
[[nodiscard]] std::uint64_t brick_of_face(const Lattice& lattice, const Double3& a, const Double3& b,
                                          const Double3& c);

}  // namespace tessera
