/// \file solid_field.h
/// Directed distances of solids, and of boolean combinations of them, in one block of the lattice.
/// Sources: thesis 2.2, 4.2.1 (directed distances of triangle meshes: lattice lines against faces), 4.2.3 (constructive
/// solid geometry component by component: along a lattice edge the combined surface is where one of the operands' is, so
/// roots and normals stay theirs and new edges are as sharp as old ones).
///
/// A node lies inside an operand whose winding number there is above 1/2. Along a lattice edge every crossing changes the
/// operand's winding number by one; the first that turns the combination is the root. Where an open mesh turns with none,
/// its closing membrane (winding number 1/2) passes: the root comes from the winding numbers at both nodes.
#pragma once
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "kernels/field/directed_field.h"
#include "kernels/solid/border_region.h"
#include "kernels/solid/lattice_crossings.h"
#include "kernels/solid/solid_tree.h"

namespace tessera {

/// A face of an operand on a lattice edge.
struct SolidCrossing {
  std::uint32_t edge = 0;  ///< 512 (3 slot + axis) + node, as SolidBlock names it
  float t = 0.0f;          ///< cells from the node, within [0, 1]
  Float3 normal = {0, 0, 0};
  std::int8_t winding = 0;  ///< LatticeCrossing::turn
  std::uint8_t operand = 0;

  bool operator<(const SolidCrossing& o) const;  ///< total: what it calls equal is equal
};
static_assert(sizeof(SolidCrossing) == 24);

/// The leaves of a block and how its edges are called.
struct SolidBlock {
  Int3 origin = {0, 0, 0};  ///< global node coordinates of the min corner, multiples of 64
  Int3 cells = {0, 0, 0};

  [[nodiscard]] Int3 dims() const { return {cells[0] / 8 + 2, cells[1] / 8 + 2, cells[2] / 8 + 2}; }
  [[nodiscard]] std::size_t slots() const {
    const Int3 d = dims();
    return static_cast<std::size_t>(d[0]) * static_cast<std::size_t>(d[1]) * static_cast<std::size_t>(d[2]);
  }
  /// Every node of these leaves, global.
  [[nodiscard]] NodeBox nodes() const {
    return {{origin[0] - 8, origin[1] - 8, origin[2] - 8},
            {origin[0] + cells[0] + 8, origin[1] + cells[1] + 8, origin[2] + cells[2] + 8}};
  }
  /// Slot of a leaf by its coordinates relative to the block, each within [-1, cells / 8].
  [[nodiscard]] std::size_t slot(const Int3& leaf) const {
    const Int3 d = dims();
    return static_cast<std::size_t>(leaf[0] + 1) +
           static_cast<std::size_t>(d[0]) *
               (static_cast<std::size_t>(leaf[1] + 1) +
                static_cast<std::size_t>(d[1]) * static_cast<std::size_t>(leaf[2] + 1));
  }
  [[nodiscard]] Int3 leaf(std::size_t slot) const;
  /// \pre the crossing's node lies within nodes()
  [[nodiscard]] SolidCrossing local_crossing(const LatticeCrossing& crossing, const Float3& normal,
                                             std::uint8_t operand) const;
};

/// One solid of a combination.
class SolidOperand {
 public:
  virtual ~SolidOperand() = default;
  /// Winding numbers at the 512 nodes of a leaf (x + 8 y + 64 z). \param leaf  global, in leaves
  /// \param crossings  its own, from the nodes of this leaf, ascending
  /// \param regions  of this operand alone, kept from leaf to leaf
  virtual void windings(const Int3& leaf, std::span<const SolidCrossing> crossings, std::span<float> out,
                        BorderRegions& regions) const = 0;
  /// Outward direction of the closing membrane at a point, cells of the lattice; zero where unknown.
  [[nodiscard]] virtual Double3 membrane_normal(const Double3& cells) const = 0;
};

struct SolidFieldReport {
  std::uint64_t roots = 0;
  std::uint64_t membrane_roots = 0;
  std::uint64_t missing_nodes =
      0;  ///< of cells that a membrane passes: zero, or its leaves were not all found
  std::uint64_t shallow_roots = 0;  ///< of a single operand: inside less than 3/4 or outside more than 1/4
};

/// The field of a combination of solids. Cells at closing membranes are marked (BandLeaf::closing).
/// \param crossings  of all operands on edges from SolidBlock::nodes(), in any order; sorted and used up
/// \param closing  leaves, relative to the block, that membranes pass and no face does
/// \post  a pure function of what the operands are within 8 cells: the same bits for any block
DirectedField build_solid_field(const SolidBlock& block, std::vector<SolidCrossing>&& crossings,
                                std::span<const SolidOperand* const> operands, const SolidTree& tree,
                                std::span<const Int3> closing, SolidFieldReport& report,
                                const std::function<void()>& pause = {});

/// What the field of so many leaves takes at most, and so many crossings.
[[nodiscard]] std::uint64_t solid_field_bytes(std::uint64_t leaves, std::uint64_t crossings,
                                              std::uint64_t slots, std::uint64_t operands);

}  // namespace tessera
