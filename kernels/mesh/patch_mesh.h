/// \file patch_mesh.h
/// A patch as a mesh block: vertices by global names, in the scan's frame.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "kernels/mesh/patch.h"
#include "kernels/mesh/uncross_block.h"
#include "octree/lattice.h"

namespace tessera {

/// Where the positions of a block lie.
struct MeshFrame {
  Lattice lattice;
  Double3 shift = {0, 0, 0};      ///< subtracted from world coordinates
  bool double_positions = false;  ///< else rounded to floats, as a file of floats holds them
  bool colour = false;
};

/// The name of a vertex in mesh blocks: its brick, then its place in the order in which bricks number their vertices.
/// Ascends with the own vertices of a patch.
[[nodiscard]] std::uint64_t mesh_key(VertexKey name);

/// What a key says of its vertex.
struct MeshName {
  static constexpr int kCentre = 3;
  Int3 brick;
  Int3 in_brick;  ///< node of the lattice edge, or cell of the centre, relative to the brick
  int axis;       ///< of the lattice edge; kCentre for the centre of a loop
};
[[nodiscard]] MeshName mesh_name(std::uint64_t key);
/// The same for many keys, most of them of the brick of the one before.
class MeshNames {
 public:
  MeshName operator()(std::uint64_t key);

 private:
  std::uint64_t code_ = 0;
  Int3 brick_ = {0, 0, 0};
};

/// \pre  the patch was extracted with ExtractOptions::names
/// \post canonical (mesh_block.h). Patches of one field, and of fields that agree around their seams, merge by key
///       (mesh_block_ops.h) and carry the same bits for a vertex that they share
[[nodiscard]] MeshBlock make_mesh_block(const Patch& patch, const MeshFrame& frame);
/// Where the block of a patch may take its vertices back to; keys ascending.
[[nodiscard]] std::vector<SafePlace> safe_places(const Patch& patch, const MeshFrame& frame);

}  // namespace tessera
