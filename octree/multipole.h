/// \file multipole.h
/// Second-order multipoles of oriented, area-weighted points in the cells of a fixed octree over the lattice.
/// Source: Barill, Dickson, Schmidt, Levin, Jacobson, "Fast Winding Numbers for Soups and Clouds", 2018,
/// section 4 (expansion of the dipole field). Change: the sums are kept as traceless symmetric tensors, which
/// give the same field with 3 + 5 + 7 numbers a cell instead of 3 + 9 + 27.
///
/// A cell of level b has 2^b lattice cells an edge; its key is the Morton code of (lattice cell >> b).
/// Moments are made in double, in key order, and stored in units of the cell's edge, so that none of them
/// runs out of range.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// A point with its piece of surface: unit outward normal times area.
struct Dipole {
  Int3 q = {0, 0, 0};         ///< quanta from the lattice origin
  Float3 moment = {0, 0, 0};  ///< cells^2
};

/// All dipoles of one cell, seen from afar. 120 bytes.
struct Multipole {
  std::uint64_t key = 0;
  Int3 centre = {0, 0, 0};        ///< of expansion: centroid by area, quanta, rounded
  float weight = 0.0f;            ///< area, cells^2
  std::uint32_t points = 0;       ///< dipoles of the cell (saturates)
  std::array<float, 3> first{};   ///< sum of m, in cell edges^2
  std::array<float, 5> second{};  ///< xx yy xy xz yz of sum of m e, traceless symmetric, edges^3
  std::array<float, 7> third{};   ///< xxx yyy xxy xyy xxz yyz xyz of sum of m e e / 2, likewise, edges^4
  float flux = 0.0f;              ///< sum of m . e, edges^3: the trace that `second` lacks
  std::array<float, 6> spread{};  ///< xx yy zz xy xz yz of sum of area e e, edges^4
};
static_assert(sizeof(Multipole) == 120);

/// Morton code of the cell of level `bits` that holds a point.
[[nodiscard]] inline std::uint64_t cell_key(const Int3& q, int bits) {
  const int shift = kQuantumBits + bits;
  return morton_encode(static_cast<std::uint32_t>(q[0] >> shift), static_cast<std::uint32_t>(q[1] >> shift),
                       static_cast<std::uint32_t>(q[2] >> shift));
}

/// Multipole of the dipoles of one cell of level `bits`. \pre at least one, in canonical order, all in the cell
[[nodiscard]] Multipole multipole_of(std::span<const Dipole> dipoles, int bits);
/// Multipole of a cell of level `bits` from those of its children. \pre at least one, ascending keys
[[nodiscard]] Multipole merge_multipoles(std::span<const Multipole> children, int bits);

/// The cells of some levels of the octree. Immutable once built; thread-safe.
class MultipoleTree {
 public:
  /// Every level from `leaf_bits` to `top_bits`, and the dipoles of the leaves.
  /// \pre canonical order (Morton code of q)
  MultipoleTree(std::vector<Dipole> dipoles, int leaf_bits, int top_bits = kMaxCellBits);
  /// From ready leaves, and the dipoles of some of them: of those that are adjacent to a query, if there is
  /// no finer tree below.
  /// \pre ascending keys; canonical order
  MultipoleTree(std::vector<Multipole> leaves, std::vector<Dipole> dipoles, int leaf_bits,
                int top_bits = kMaxCellBits);

  struct Level {
    std::vector<Multipole> cells;  ///< ascending keys
    /// Per cell, and the end: index into the level below, or the dipoles.
    std::vector<std::uint32_t> first_child;
  };
  [[nodiscard]] int leaf_bits() const { return leaf_bits_; }
  [[nodiscard]] int top_bits() const { return leaf_bits_ + static_cast<int>(levels_.size()) - 1; }
  [[nodiscard]] const Level& level(int bits) const {
    return levels_[static_cast<std::size_t>(bits - leaf_bits_)];
  }
  [[nodiscard]] std::span<const Dipole> dipoles() const { return dipoles_; }
  /// Memory of the cells, dipoles included.
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  void attach_dipoles();
  void build_upwards(int top_bits);

  int leaf_bits_;
  std::vector<Level> levels_;  ///< from the leaves up
  std::vector<Dipole> dipoles_;
};

}  // namespace tessera
