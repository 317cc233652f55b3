/// \file unsettled_region.h
/// Where a pass of decimation can still do something: at the seams of the passes before it.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "kernels/mesh/box_mask.h"
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

/// All faces of a store that come within `margin` of the marked faces of a block, and some more.
class NearFaceLoader {
 public:
  /// \param store  outlives it
  NearFaceLoader(const MeshStore& store, const MeshBlock& block, const std::vector<std::uint8_t>& marked,
                 double margin);

  /// All faces whose boxes meet this one: what MeshStore::load_box() loads.
  NearFaceLoader(const MeshStore& store, const MeshBox& box);

  // What they are at most, by the table of the store: MeshStore::block_bytes() of all, and their number.
  std::uint64_t bytes() const { return bytes_; }
  std::uint64_t faces() const { return faces_; }
  /// Makes sure that loading them fits. Where the table tells too much, the patches are read, one at a time, to count what is
  /// near.
  /// \param needed  what that takes, from bytes() and faces()   \param available  what the task may hold
  /// \throws ResourceError naming a cap that would do
  void require_fits(const std::function<std::uint64_t(std::uint64_t bytes, std::uint64_t faces)>& needed,
                    std::uint64_t available, const std::string& who);
  MeshBlock load() const;

 private:
  void select();
  void count();
  /// Of a patch, the faces that are near.
  MeshBlock read(std::size_t patch) const;

  const MeshStore& store_;
  MeshBox all_;
  BoxMask mask_;
  std::vector<std::size_t> patches_;
  std::uint64_t bytes_ = 0, faces_ = 0;
};

}  // namespace tessera
