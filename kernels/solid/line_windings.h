/// \file line_windings.h
/// How often the lines of the lattice along x have turned into a mesh before they reach a leaf: the global summary from
/// which every block knows the integer part of its winding numbers.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// What the faces of a mesh do to the 64 lines along x through one leaf of 8^3 nodes (line y + 8 z).
struct LeafWindings {
  std::uint64_t key = 0;  ///< leaf_row_key
  std::array<std::int16_t, 64> winding{};
  std::uint32_t crossings = 0;  ///< on edges from its nodes, along all axes
  std::uint32_t unused = 0;

  /// Adds another part of the same leaf.
  void add(const LeafWindings& other);
  bool operator<(const LeafWindings& other) const { return key < other.key; }
};
static_assert(sizeof(LeafWindings) == 144);

/// Leaves of a row along x follow each other. \pre coordinates in leaves, each within [0, 2^20)
[[nodiscard]] constexpr std::uint64_t leaf_row_key(const Int3& leaf) {
  return static_cast<std::uint64_t>(leaf[2]) << 40 | static_cast<std::uint64_t>(leaf[1]) << 20 |
         static_cast<std::uint64_t>(leaf[0]);
}
[[nodiscard]] constexpr Int3 leaf_of_row_key(std::uint64_t key) {
  return {static_cast<std::int32_t>(key & 0xfffff), static_cast<std::int32_t>(key >> 20 & 0xfffff),
          static_cast<std::int32_t>(key >> 40)};
}

class LineWindings {
 public:
  LineWindings() = default;
  /// \param leaves  ascending, no repeats
  explicit LineWindings(std::vector<LeafWindings> leaves);
  /// Turns of all faces with smaller x than the leaf's nodes x = 0, by line.
  [[nodiscard]] std::array<std::int16_t, 64> before(const Int3& leaf) const;
  /// All zero once every line has left the mesh on its far side.
  [[nodiscard]] bool closes() const;
  [[nodiscard]] const std::vector<LeafWindings>& leaves() const {
    return leaves_;
  }  ///< `winding` summed up along each row
  [[nodiscard]] std::uint64_t bytes() const { return leaves_.capacity() * sizeof(LeafWindings); }

 private:
  std::vector<LeafWindings> leaves_;
};

}  // namespace tessera
