/// \file crossing_mend.h
/// Takes the faces at one crossing out of a block and closes what is left open anew, so that nothing there meets beyond what it
/// shares (face_contact.h). All other faces stay as they are.
/// Sources: Attene, "A lightweight approach to repairing digitized polygon meshes", 2010 (cut out and fill); the fillings are
/// those of hole_filling.h.
///
/// Passes: the faces of the pairs, then a ring more of them up to `max_rings`, part into disks (mend_region.h); each
/// disk is closed by its outline's triangulation, or by a fair patch where that meets something; the first filling that exact
/// predicates find to meet nothing stands. Else vertices at a border go inwards (border_retreat.h). The last resort, where it is allowed:
/// small parts at a border are left out.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

struct CrossingMendOptions {
  int max_rings = 4;
  std::uint32_t max_faces = 3000;  ///< that are taken out
  std::uint32_t max_loop = 250;    ///< edges of a disk's outline: its triangulation takes the cube of it
  bool may_cut = false;            ///< where no filling helps, up to 60 faces at a border of the mesh go
  bool gentle = false;             ///< vertices at a border go inwards before faces are taken out, not after
  bool last_block = false;         ///< no block with more around it comes: what needs one is left untried
  std::uint64_t first_key = 0;     ///< of new vertices: above those of the block, ascending from here
  bool float_positions = false;    ///< new vertices lie at floats
  /// Where a position lies in the bytes that are written, if not where it is; may be empty. Faces are to meet nothing there.
  std::function<Double3(const Double3&)> written;
};

struct CrossingMend {
  bool mended = false;
  bool torn = false;  ///< the block holds too little around the crossing: with more it might be mended
  std::vector<std::uint32_t> removed;  ///< faces of the block, ascending
  /// Canonical: what stands in for them, with all corners. A face beside a part that went is removed and comes back with the border
  /// marked.
  MeshBlock added;
  std::uint64_t new_vertices = 0;
};

/// \param block     canonical; edges have at most two faces
/// \param crossing  faces of the block, of one group of pairs, ascending
/// \param whole     a box in which the block has all faces of the mesh
/// \post mended: no added face meets another one of the result but in copies of a vertex, none of the removed ones is left; each vertex has one fan of faces
///   as before; a pure function of the faces that it looks at, whatever else is in the block
/// \cost a search of the faces near by a filling; 200 bytes a face of the block, and hole_bytes(max_loop)
[[nodiscard]] CrossingMend mend_crossing(const MeshBlock& block, std::span<const std::uint32_t> crossing,
                                         const ContactCell& whole, const CrossingMendOptions& options);

/// Upper bound of what it allocates.
[[nodiscard]] std::uint64_t crossing_mend_bytes(std::uint64_t faces, const CrossingMendOptions& options);

}  // namespace tessera
