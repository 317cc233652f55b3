/// \file crease_lines.h
/// Sharp edges of the mesh that a field comes from, cut at the faces of the lattice: what extraction follows in cells where one
/// feature sample is not enough (crease_patch.h).
/// Points where cells share a face are those of Ho, Wu, Chen, Chuang, Ouhyoung, "Cubical Marching Squares", 2005, here taken from
/// the mesh itself.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// A sharp edge passes a face of the lattice.
struct CreaseKink {
  std::uint32_t crossing = 0;  ///< a number of its own
  Float3 at = {0, 0, 0};       ///< cells from the node of the face
};

/// The section of the mesh with a face of the lattice, from one lattice edge to another, where sharp edges pass it.
struct CreaseChain {
  std::uint32_t face = 0;  ///< 3 cell + axis: the face of this cell towards -axis
  /// The ends: edges of that cell (cell_loops.h), the lower one first, where on them, and the mesh's normals there.
  std::array<std::uint8_t, 2> edge{};
  std::array<float, 2> t{};
  std::array<Float3, 2> normal{};
  std::uint32_t first = 0, count = 0;  ///< its kinks, from the first end on
  std::uint32_t number = 0;            ///< of its first kink among those of the face
};

/// A stretch of a sharp edge within a cell. Its ends are crossings, or vertices of the mesh (kCreaseVertex added).
struct CreasePiece {
  std::uint32_t cell = 0;
  std::array<std::uint32_t, 2> end{};
  /// Places among the sharp edges around the vertex, counter-clockwise seen from outside the mesh; kNoRank where unknown.
  std::array<std::uint8_t, 2> rank{};
};

inline constexpr std::uint32_t kCreaseVertex = 0x80000000u;
inline constexpr std::uint8_t kNoRank = 255;

/// All of a block, in the cells [-1, cells] of each axis.
struct CreaseLines {
  Int3 cells = {0, 0, 0};             ///< of the block
  std::vector<CreaseKink> kinks;      ///< by chain
  std::vector<CreaseChain> chains;    ///< ascending by face, then by edges
  std::vector<CreasePiece> pieces;    ///< ascending by cell
  std::vector<Double3> vertices;      ///< cells from the block's min corner
  std::vector<std::uint64_t> passed;  ///< bit per cell: it has pieces

  /// Number of a cell relative to the block.
  [[nodiscard]] std::uint32_t cell_number(const Int3& cell) const {
    return static_cast<std::uint32_t>(cell[0] + 1) +
           static_cast<std::uint32_t>(cells[0] + 2) *
               (static_cast<std::uint32_t>(cell[1] + 1) +
                static_cast<std::uint32_t>(cells[1] + 2) * static_cast<std::uint32_t>(cell[2] + 1));
  }
  [[nodiscard]] bool passes(std::uint32_t cell) const {
    return !passed.empty() && (passed[cell >> 6] >> (cell & 63) & 1) != 0;
  }
  [[nodiscard]] std::span<const CreaseChain> chains_of(std::uint32_t face) const;
  [[nodiscard]] std::span<const CreasePiece> pieces_of(std::uint32_t cell) const;
};

}  // namespace tessera
