/// \file distance_cells.h
/// Space around a mesh of any size cut into cells by what the mesh holds, so that distances to it can be measured cell by
/// cell, each with the faces near it loaded.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/meshes/mesh_store.h"

namespace tessera {

/// MeshBox is closed; a point on a plane that two cells share is of the upper one.
struct DistanceCell {
  MeshBox box;
  double reach = 0.0;       ///< faces are loaded up to here around the box, > 0
  std::uint64_t bytes = 0;  ///< to load them, with a SignedDistance
  double wide_reach = 0.0;  ///< for points that have none so near: at least `reach`
  std::uint64_t wide_bytes = 0;
};

class DistanceCells {
 public:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  /// A pure function of the table of the store and the distance. \param max_distance  > 0; no cell reaches farther
  DistanceCells(const MeshStore& mesh, double max_distance);

  std::span<const DistanceCell> cells() const { return cells_; }  ///< in Morton order
  /// The cell that holds a point; kNone where it is farther than the distance from the mesh's box.
  std::size_t find(const Double3& p) const;

  /// To load the faces that meet a box, with a SignedDistance of them.
  static std::uint64_t load_bytes(const MeshStore& mesh, std::span<const std::size_t> patches);

 private:
  /// Of an octree: a leaf's cell, or the first of eight children that follow each other.
  struct Node {
    std::size_t child = 0, cell = kNone;
  };
  void split(std::size_t node, const std::array<std::uint64_t, 3>& at, int level,
             const std::vector<std::size_t>& patches);
  DistanceCell make_cell(const MeshBox& box) const;
  double plane(std::size_t axis, std::uint64_t at, int level) const;
  std::uint64_t faces_of(std::span<const std::size_t> patches) const;
  std::uint64_t faces_inside(std::span<const std::size_t> patches, const MeshBox& box) const;

  const MeshStore& mesh_;
  double max_distance_, least_reach_, patch_edge_;
  std::uint64_t cell_faces_;
  Double3 corner_{};
  double edge_ = 0.0;
  MeshBox reached_;  ///< beyond it no point is near enough
  std::vector<Node> nodes_;
  std::vector<DistanceCell> cells_;
};

}  // namespace tessera
