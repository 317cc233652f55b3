/// \file brick_levels.h
/// Bricks of several sizes beside each other: a brick of level k has 64^3 cells of 2^k h, and the bricks around it are of
/// its level, of the next finer or of the next coarser one.
///
/// What two levels share belongs to the finer one: a lattice node, edge or face is of the finest level among the bricks
/// that touch it (an edge or face: all along it). So an edge that touches a finer brick is split in two, a face in four, and both
/// sides see the same nodes, values and roots there: they compute them from the same points by the same rule. A cell with a
/// split edge is traced by level_cells.h, every other one as ever. Sources: Ho, Wu, Chen, Chuang, Ouhyoung, "Cubical
/// Marching Squares", 2005 (loops over the finer faces).
///
/// Coordinates are relative to the brick. Those of the finer level run over [0, 128] along it, of the coarser one over
/// [0, 32].
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "kernels/field/directed_field.h"

namespace tessera {

/// Levels of the 26 bricks around one, relative to its own: -1 finer, 0 the same, 1 coarser.
struct LevelSurroundings {
  std::array<int, 27> step{};  ///< by (dx + 1) + 3 (dy + 1) + 9 (dz + 1); its own is 0

  [[nodiscard]] bool has(int wanted) const {
    for (const int s : step)
      if (s == wanted) return true;
    return false;
  }
  [[nodiscard]] bool uniform() const { return !has(-1) && !has(1); }
  /// Least and largest step of the bricks that touch a box all along it.
  /// \param low   relative to the brick, in units of which it has `edge`
  /// \param size  of the box, 0 where it is flat; no box passes a face of the brick
  struct Range {
    int minimum, maximum;
  };
  [[nodiscard]] Range touching(const Int3& low, const Int3& size, int edge) const;
  /// Of bricks from first to last along each axis, 0 before this one, 1 beside it, 2 beyond.
  [[nodiscard]] Range among(const std::array<std::array<std::size_t, 2>, 3>& bricks) const;
};

/// Fields of a brick on its level and on those of the bricks around it, each over a block that begins one leaf before
/// the brick, on its lattice.
struct LevelFields {
  DirectedField own;      ///< nodes at least [-1, 65], with coarser bricks around [-2, 66]
  DirectedField finer;    ///< nodes that wanted_finer() names; empty where no brick around is finer
  DirectedField coarser;  ///< the same with wanted_coarser()
  bool noisy = false;     ///< DirectedField::creased tells of features
};

inline constexpr int kLevelMargin = kLeafCells;  ///< where the brick begins in each block

/// Blocks of the three fields: cells an edge, and the nodes that take part in a brick's mesh.
inline constexpr int kOwnLevelCells = kBrickCells + 2 * kLevelMargin;
inline constexpr int kFinerLevelCells = 2 * kBrickCells + 2 * kLevelMargin;
inline constexpr int kCoarserLevelCells = kBrickCells / 2 + 2 * kLevelMargin;
[[nodiscard]] bool wanted_own(const LevelSurroundings& around, const Int3& node);
[[nodiscard]] bool wanted_finer(const LevelSurroundings& around, const Int3& node);
[[nodiscard]] bool wanted_coarser(const LevelSurroundings& around, const Int3& node);
/// Whether a box of nodes, both ends among them, may hold such nodes.
[[nodiscard]] bool may_want_finer(const LevelSurroundings& around, const Int3& low, const Int3& high);
[[nodiscard]] bool may_want_coarser(const LevelSurroundings& around, const Int3& low, const Int3& high);

/// The field of the brick and its halo for its extraction (nodes [-1, 65], origin at the brick) where levels meet: nodes that
/// finer bricks touch have their values, split edges are gone, cells that take part in coarser bricks around are closing ones, cells
/// with split edges and those are quiet (BandLeaf::quiet). Vertices on edges that two levels share do not move onto borders.
[[nodiscard]] DirectedField mix_levels(const LevelFields& fields, const LevelSurroundings& around);

/// Cells of two levels where they meet: what the coarser of the two sees.
class LevelPair {
 public:
  /// \param big, small  fields of the coarser and the finer one of the two
  /// \param edge  cells of the small lattice along the brick: 128 or 64
  /// \param small_step  of the bricks of the small lattice
  LevelPair(const DirectedField& big, const DirectedField& small, const LevelSurroundings& around, int edge,
            int small_step)
      : big_(big), small_(small), around_(around), edge_(edge), small_step_(small_step) {}

  struct Node {
    bool valid = false, inside = false;
    float value = 0.0f;  ///< cells of the small lattice if `small`
    bool small = false;
    bool stands_in = false;  ///< of a small one that has no value
  };
  /// Where the samples near a node tell the small lattice nothing, which sees half as far, the big one stands in, or what all
  /// around it are: no edge of the small lattice that leaves it may be crossed (takes_part()).
  /// \param at  in cells of the small lattice, even where the node is one of the big one
  [[nodiscard]] Node node(const Int3& at) const;
  [[nodiscard]] bool is_split(const Int3& low, const Int3& size) const {
    return around_.touching(low, size, edge_).minimum <= small_step_;
  }
  /// Whether any edge of the cell is split.
  [[nodiscard]] bool is_transition(const Int3& cell) const;
  /// Whether a cell with split edges takes part: all of its nodes are valid or stood in for, away from the surface, and if it
  /// has a vertex, one lies well within the border.
  /// \param cell  min corner, in cells of the small lattice
  [[nodiscard]] bool takes_part(const Int3& cell) const;

 private:
  const DirectedField& big_;
  const DirectedField& small_;
  const LevelSurroundings& around_;
  int edge_, small_step_;
};

/// What a field says of a node. \param node  relative to the brick
[[nodiscard]] LevelPair::Node node_of(const DirectedField& field, const Int3& node);
/// Whether a cell of a field takes part: all of its nodes are valid and it is not beyond the border.
[[nodiscard]] bool whole_cell(const DirectedField& field, const Int3& cell);

}  // namespace tessera
