/// \file lattice.h
/// The one global integer lattice of a job. Every decision refers to it and to its bricks, never to tiles.
///
///   node (i,j,k)  at  h * (64 * origin_brick + (i,j,k))   in the scan's frame
///   cell (i,j,k)  spans nodes (i,j,k) .. (i+1,j+1,k+1)
///   brick         64^3 cells; owns the elements whose min corner it holds (half-open)
///   quantum       h / 1024: point coordinates are integers in it, so distances and ties are exact
///
/// Lattice coordinates are never negative: the survey chooses the origin one brick below the data.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "octree/morton.h"
#include "octree/vector.h"

namespace tessera {

inline constexpr int kBrickBits = 6;
inline constexpr int kBrickCells = 1 << kBrickBits;
inline constexpr int kLeafBits = 3;  ///< band leaves and point blocks are 8^3 cells
inline constexpr int kLeafCells = 1 << kLeafBits;
inline constexpr int kQuantumBits = 10;
inline constexpr int kQuantaPerCell = 1 << kQuantumBits;
inline constexpr int kMaxCellBits = 20;  ///< largest extent of a job: 2^20 cells per axis

struct Lattice {
  double h = 0.0;                                        ///< lattice spacing, scan units, > 0
  std::array<std::int64_t, 3> origin_brick = {0, 0, 0};  ///< brick (0,0,0) in units of 64 h: the global shift

  /// Coordinate of one axis in quanta from the lattice origin, nearest, ties up.
  /// \pre the point lies within the surveyed bounds; the result fits 30 bits
  [[nodiscard]] std::int64_t quantise(int axis, double world) const {
    const double quanta = std::floor(world / h * kQuantaPerCell + 0.5);
    return static_cast<std::int64_t>(quanta) -
           origin_brick[static_cast<std::size_t>(axis)] * (kBrickCells * kQuantaPerCell);
  }
  /// World coordinate of `cells` (fractional cells from the lattice origin).
  double world(int axis, double cells) const {
    return h * (static_cast<double>(origin_brick[static_cast<std::size_t>(axis)] * kBrickCells) + cells);
  }
  bool operator==(const Lattice&) const = default;
};

/// Which of the cells of edge `edge` around zero holds `x`: floor(x / edge), exact also where the quotient is too small to
/// be told from zero. Differences of such numbers are exact, the floor of a difference is not. \pre edge is a power of two
[[nodiscard]] inline double cell_at(double x, double edge) {
  const double cell = std::floor(x / edge);
  return cell == 0.0 && x < 0.0 ? -1.0 : cell;
}
/// A computed index, checked in every build: out of its range it would be a write past the heap.
[[nodiscard]] inline std::uint32_t checked_index(double index, double end) {
  if (!(index >= 0.0 && index < end))
    throw std::logic_error("an index was computed as " + std::to_string(index) + ", beyond its end at " +
                           std::to_string(end));
  return static_cast<std::uint32_t>(index);
}

/// Morton code of brick coordinates; the order of bricks in every file and output.
[[nodiscard]] inline std::uint64_t brick_key(const Int3& brick) {
  return morton_encode(static_cast<std::uint32_t>(brick[0]), static_cast<std::uint32_t>(brick[1]),
                       static_cast<std::uint32_t>(brick[2]));
}
[[nodiscard]] inline Int3 brick_of_key(std::uint64_t key) {
  const auto c = morton_decode(key);
  return {static_cast<std::int32_t>(c[0]), static_cast<std::int32_t>(c[1]), static_cast<std::int32_t>(c[2])};
}

}  // namespace tessera
