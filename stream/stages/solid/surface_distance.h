/// \file surface_distance.h
/// Exact distances to the surface of solids at any point, however far, with patches in memory as they are asked for.
#pragma once
#include <cstdint>
#include <list>
#include <unordered_map>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "kernels/solid/row_signs.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

/// Boxes of the patches of a surface, in cells of the lattice, as a tree.
class PatchTree {
 public:
  PatchTree(const MeshStore& mesh, const Lattice& lattice);

  const MeshStore& mesh() const { return mesh_; }
  const Lattice& lattice() const { return lattice_; }
  /// What a patch takes in memory once it is asked, and while it is loaded.
  std::uint64_t patch_bytes(std::size_t patch) const;
  static std::uint64_t patch_bytes(std::uint64_t vertices, std::uint64_t faces);
  std::uint64_t largest_patch_bytes() const { return largest_; }
  std::uint64_t all_bytes() const { return all_; }  ///< of all patches together
  std::uint64_t bytes() const;                      ///< its own

 private:
  friend class SurfaceDistance;
  static constexpr std::size_t kChildren = 8;
  struct Box {
    Double3 low, high;
  };
  const MeshStore& mesh_;
  Lattice lattice_;
  std::vector<std::vector<Box>> levels_;  ///< levels_[0] per patch
  std::uint64_t largest_ = 0, all_ = 0;
};

/// For one thread. Patches that were asked least recently go when there are too many; no distance depends on it.
class SurfaceDistance {
 public:
  /// \param kept_bytes  for patches; one is kept whatever it takes
  SurfaceDistance(const PatchTree& tree, const RowSigns& signs, std::uint64_t kept_bytes);
  /// At a node, cells, < 0 inside.
  double at(const Int3& node);
  /// Without a sign, at any point in cells.
  double away(const Double3& p);
  bool inside(const Int3& node) { return signs_.inside(node); }

 private:
  struct Patch {
    std::size_t number = 0;
    Double3 corner{};
    ClosestFaces faces;
    std::uint64_t bytes = 0;
    std::uint32_t hint = ClosestFaces::kNone;
  };
  Patch& patch(std::size_t number);

  const PatchTree& tree_;
  NodeSigns signs_;
  std::uint64_t kept_bytes_, used_bytes_ = 0;
  std::list<Patch> kept_;  ///< asked last first
  std::unordered_map<std::size_t, std::list<Patch>::iterator> where_;
  std::size_t last_patch_ = 0;
};

}  // namespace tessera
