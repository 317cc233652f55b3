/// \file remesh_region.h
/// What of a block a pass of remeshing works on, and what it leaves to the next.
#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "kernels/remesh/remesh.h"

namespace tessera {

/// Per face whether it lies within five rings of one that is active(face).
std::vector<std::uint8_t> near_active(const MeshBlock& block, const std::function<bool(std::size_t)>& active);

/// Keys of the vertices whose stars reach another block, ascending.
std::vector<std::uint64_t> seam_keys(const MeshBlock& block);

/// Marks faces that the next pass need not look at: all but those at the seams of the block.
void mark_done(MeshBlock& block, const std::vector<std::uint64_t>& seams, const RemeshReport& report);

}  // namespace tessera
