/// \file crease_cells.h
/// Cells whose creases are known from the mesh that the field comes from: their loops get corners where creases pass faces of
/// cells, the same ones from both sides, and follow the creases within (crease_patch.h).
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "kernels/extract/crease_lines.h"
#include "kernels/extract/crease_patch.h"
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
  bool turned = false;  ///< the loop runs against the chain
};

struct LoopKinks {
  std::vector<LoopKink> all;  ///< along the loop
  bool inverted = false;      ///< the mesh shows inwards where it is the surface
  bool agree = true;          ///< whether all sections say the same of that
};

/// A loop of a cell that creases pass, and what becomes of it.
struct CreasedLoop {
  TracedLoop loop;
  LoopKinks kinks;
  bool kinked = false;               ///< kinks were found, whether or not they are left
  bool followed = false;             ///< its faces are those
  PatchOutline outline;              ///< the loop with its kinks
  std::size_t vertices = 0;          ///< of the outline: roots, then kinks that are not snapped
  std::vector<std::uint16_t> place;  ///< per kink: its corner
  CreasePatch faces;
};

class CreaseCells {
 public:
  /// \param lines  null: no creases are known  \param corner  of the brick, relative to the block of the lines
  CreaseCells(const CreaseLines* lines, const Int3& corner) : lines_(lines), corner_(corner) {}

  /// Whether known creases pass the cell.
  [[nodiscard]] bool pass(const Int3& cell) const;
  /// Finds the kinks of all loops of one cell and follows the creases where they cut a loop into regions. Chains of kinks that
  /// cross in a face go, the same from both of its cells. Where faces of several loops of the cell would meet, or have no area,
  /// it goes without kinks, and close_flaps() closes what gapes towards the cells across.
  /// \param loops  `loop` is given  \param follow  else kinks alone are found
  void settle(const BrickInput& brick, bool follow, std::span<CreasedLoop> loops);
  /// Faces of a loop that is followed, of a cell of the brick.
  void emit(const BrickInput& brick, const CreasedLoop& loop, PatchBuilder& patch);
  /// Faces of a loop with kinks that nothing else is known of.
  void fill(const BrickInput& brick, const CreasedLoop& loop, PatchBuilder& patch);
  /// The vertex of a kink that is not snapped.
  std::uint32_t vertex(const LoopKink& kink, PatchBuilder& patch);
  /// Faces within faces of the lattice, between segments with kinks and without, once all cells are settled.
  void close_flaps(PatchBuilder& patch);

 private:
  /// A segment from which one cell took the kinks.
  struct Flap {
    std::uint64_t name;                 ///< of its first kink
    std::array<std::uint32_t, 2> root;  ///< vertices, from the start of the chain
    bool turned;                        ///< the loop of that cell runs against the chain
    std::vector<LoopKink> kinks;
    std::vector<std::array<std::uint8_t, 3>> triangles;
  };

  void find_kinks(const BrickInput& brick, const TracedLoop& loop, LoopKinks& kinks) const;
  [[nodiscard]] bool follow(CreasedLoop& loop) const;
  /// Takes the kinks of a loop, but for those that lie on both sides of their segment.
  void straighten(CreasedLoop& loop);
  std::vector<std::uint32_t> names_of(const CreasedLoop& loop, PatchBuilder& patch);

  const CreaseLines* lines_;
  Int3 corner_;
  std::unordered_map<std::uint64_t, std::uint32_t> vertex_;
  std::vector<Flap> flaps_;
};

}  // namespace tessera
