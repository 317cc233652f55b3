/// \file unsettled_region.h
/// Where a pass of decimation can still do something: at the seams of the passes before it.
#pragma once
#include <cstdint>
#include <vector>

#include "stream/meshes/mesh_store.h"

namespace tessera {

struct ActiveRegion {
  std::vector<std::uint64_t> done_keys;  ///< ascending: vertices that stay as they are
  std::vector<std::uint8_t> near;        ///< per face of the block: what collapses may be measured against
  bool empty() const { return near.empty(); }
};

/// The corners of all faces without kFaceDone and their neighbours may change; the faces at those are near. A pure
/// function of the block.
ActiveRegion find_active(const MeshBlock& block);

/// All faces of `store` that come within `margin` of the marked faces of the block, and some more. The bytes are at
/// most store.block_bytes() of what the box of the block needs.
MeshBlock load_near_faces(const MeshStore& store, const MeshBlock& block,
                          const std::vector<std::uint8_t>& marked, double margin);

}  // namespace tessera
