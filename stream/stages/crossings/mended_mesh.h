/// \file mended_mesh.h
/// A store with some of its faces replaced, which are few: what is replaced is held in memory until it is written.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <vector>

#include "kernels/holes/crossing_mend.h"
#include "stream/meshes/mesh_store.h"
#include "stream/stages/crossings/crossing_pairs.h"

namespace tessera {

class MendedMesh {
 public:
  /// \param store  outlives it
  explicit MendedMesh(const MeshStore& store) : store_(store) {}

  /// All faces that meet the box, as they are now, in a canonical block; none where they are more than `max_faces`.
  std::optional<MeshBlock> load(const MeshBox& box, std::size_t max_faces) const;
  /// \param block  as load() gave it
  void apply(const MeshBlock& block, CrossingMend&& mend);
  bool is_gone(const FaceKeys& face) const { return gone_.count(face) != 0; }  ///< a face of the store
  bool empty() const { return gone_.empty(); }

  /// Patches of the store in which faces changed. New faces lie in the first one that had a face in their place.
  /// \returns bytes written
  std::uint64_t write(const std::filesystem::path& path) const;

 private:
  struct Added {
    MeshBlock block;
    FaceKeys anchor{};  ///< a face of the store that it stands for
    MeshBox box;
  };
  const MeshStore& store_;
  std::set<FaceKeys> gone_;  ///< faces of the store
  std::vector<MeshBox> gone_boxes_;
  std::vector<Added> added_;
};

}  // namespace tessera
