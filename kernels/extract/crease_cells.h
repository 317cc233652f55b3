/// \file crease_cells.h
/// Cells whose creases are known from the mesh that the field comes from: their loops get corners where creases pass faces of
/// cells, the same ones from both sides, and follow the creases within (crease_patch.h).
#pragma once
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "kernels/extract/crease_lines.h"
#include "kernels/extract/feature_loops.h"

namespace tessera {

/// A crease passes a loop.
struct LoopKink {
  std::size_t segment = 0;     ///< from this root of the loop to the next
  std::uint32_t crossing = 0;  ///< CreaseKink::crossing
  std::uint32_t face = 0;      ///< CreaseChain::face
  std::uint32_t number = 0;    ///< within the face
  Int3 above{};                ///< the cell of the face, relative to the brick
  Float3 at{};                 ///< relative to the cell of the loop
  /// So near to a root that this one's vertex serves: -1 that before, +1 that behind, 0 none.
  int snapped = 0;
};

struct LoopKinks {
  std::vector<LoopKink> all;  ///< along the loop
  bool inverted = false;      ///< the mesh shows inwards where it is the surface
  bool agree = true;          ///< whether all sections say the same of that
};

class CreaseCells {
 public:
  /// \param lines  null: no creases are known  \param corner  of the brick, relative to the block of the lines
  CreaseCells(const CreaseLines* lines, const Int3& corner) : lines_(lines), corner_(corner) {}

  /// \returns false where no known crease passes the loop
  bool find_kinks(const BrickInput& brick, const TracedLoop& loop, LoopKinks& kinks) const;
  /// Faces of the loop along its creases, where they cut it into regions. Faces of cells of the brick alone are added.
  bool follow(const BrickInput& brick, const TracedLoop& loop, const LoopKinks& kinks, PatchBuilder& patch);
  /// Faces of a loop with kinks that nothing else is known of.
  void fill(const BrickInput& brick, const TracedLoop& loop, const LoopKinks& kinks, PatchBuilder& patch);
  /// The vertex of a kink that is not snapped.
  std::uint32_t vertex(const LoopKink& kink, PatchBuilder& patch);

 private:
  const CreaseLines* lines_;
  Int3 corner_;
  std::unordered_map<std::uint64_t, std::uint32_t> vertex_;
};

}  // namespace tessera
