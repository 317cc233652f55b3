/// \file block_clustering.h
/// Vertex clustering of a mesh block by block, within a proven distance: islands, strips and sheets that decimation must
/// keep apart join where they are narrower than a cell.
///
/// All vertices in one cell of a grid become one. Faces whose corners lie in three cells stay, once each. Where all faces
/// that join two cells (or lie in one) collapse and nothing else covers them, the largest of them stays as it is: nothing
/// is lost without being within the distance that is told. The result may branch.
/// Sources: Rossignac and Borrel, "Multi-resolution 3D Approximations for Rendering Complex Scenes", 1993; Lindstrom,
/// "Out-of-Core Simplification of Large Polygonal Models", 2000. The faces that are kept, and the bound, are our own.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

inline constexpr int kClusterBits = 20;  ///< of a coordinate of a cell
inline constexpr int kMaxClusterTag =
    15;  ///< names of cells by tag; vertices of the input are named below 2^60 or by other tags

/// A grid of cells with its lowest corner at `low`. Cells beyond its 2^20 in each direction count as its outermost.
struct ClusterGrid {
  Double3 low = {0, 0, 0};
  double cell = 0.0;  ///< edge, scan units, > 0
  int tag = 1;        ///< 1..kMaxClusterTag, unlike any grid's that made the input

  /// Key of the vertex that stands for the cell of a point.
  [[nodiscard]] std::uint64_t key(const Double3& p) const;
  [[nodiscard]] Double3 center(std::uint64_t key) const;
};

struct ClusteredBlock {
  MeshBlock block;  ///< canonical; colours are means by area
  /// No point of a core face is farther from the clustered mesh, nor a point of a face here from the faces it stands for.
  double bound = 0.0;
  std::size_t faces_kept = 0;  ///< of `block`, with the corners that they had
};

/// \param near  canonical, without faces of no area if possible; holds every face with a corner in a cell that a core face
/// has a corner in \param core  per face: 1 where it belongs to this block \param floats  positions are to be floats
/// \post a pure function of the faces around: blocks that share vertices agree on them, and no face comes in two blocks
[[nodiscard]] ClusteredBlock cluster_block(const MeshBlock& near, std::span<const std::uint8_t> core,
                                           const ClusterGrid& grid, bool floats);

}  // namespace tessera
