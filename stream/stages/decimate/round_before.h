/// \file round_before.h
/// The same pass of the round before: a block whose input is the same and where nothing is to stay is the same.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "stream/meshes/failed_regions.h"
#include "stream/meshes/mesh_blocking.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

class RoundBefore {
 public:
  /// \param in, out  what that pass read and left \param blocks  of `in`
  RoundBefore(MeshStore in, MeshStore out, std::vector<MeshBlockCut> blocks);

  /// The block of that round that `cut` of the store `now` repeats; null where it differs or `failed` touches it.
  const MeshBlockCut* same(const MeshStore& now, const MeshBlockCut& cut, const FailedRegions& failed) const;
  /// What the round before left of a block of its own. Returns the number of faces.
  std::uint64_t copy(const MeshBlockCut& cut, MeshFileWriter& writer) const;
  /// The same in one piece.
  MeshBlock left(const MeshBlockCut& cut) const { return out_.load(patches_left(cut)); }

 private:
  std::vector<std::size_t> patches_left(const MeshBlockCut& cut) const;

  MeshStore in_, out_;
  std::vector<MeshBlockCut> blocks_;
  std::map<std::array<std::int32_t, 6>, std::size_t> by_cube_;
};

}  // namespace tessera
