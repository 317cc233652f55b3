/// \file solid_fans.h
/// Which corners of the faces of a solid are one vertex: those of faces that follow each other around an edge or a vertex. Where
/// four or more faces meet in an edge, those two are neighbours that have solid between them.
/// Source: regularised solids, Requicha, "Representations for Rigid Solids", 1980.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/boolean/exact_point.h"
#include "octree/union_find.h"

namespace tessera {

/// Half-edge 3 f + k runs from corner k of face f to the next.
class SolidFans {
 public:
  /// \param faces  by numbers of points; both outlive this. Nothing is joined yet
  SolidFans(const PointTable& points, std::span<const std::array<std::uint32_t, 3>> faces);

  /// Makes the faces of two half-edges of one edge, which run against each other, neighbours.
  void join(std::uint32_t half, std::uint32_t other);
  /// All half-edges of an edge in pairs, as the solid lies between them. \param low  its smaller point
  /// \pre half of them start there
  void join_around(std::span<const std::uint32_t> half, std::uint32_t low);
  /// Whether as many half-edges start at `low` as end there.
  [[nodiscard]] bool is_balanced(std::span<const std::uint32_t> half, std::uint32_t low) const;
  [[nodiscard]] std::uint32_t start(std::uint32_t half) const { return faces_[half / 3][half % 3]; }
  /// The vertex of a corner: its first one, 3 f + k.
  std::uint32_t vertex_of(std::uint32_t corner) { return vertex_of_.find(corner); }

 private:
  std::uint32_t tip(std::uint32_t half) const { return faces_[half / 3][(half % 3 + 2) % 3]; }
  void sort_around(std::vector<std::uint32_t>& half, std::uint32_t low) const;

  const PointTable& points_;
  std::span<const std::array<std::uint32_t, 3>> faces_;
  UnionFind vertex_of_;
};

}  // namespace tessera
