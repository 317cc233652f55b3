/// \file refined_base.h
/// Splits long edges of a base surface, so that what an edit makes of it hangs on the surface and not on its triangles: the
/// edge of a region lies between two vertices, and the solution bends no more narrowly than faces let it.
/// Source: Rivara, "Algorithms for refining triangular grids", 1984 (longest edges first: angles are halved at most once).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

enum class SupportPart : std::uint8_t { kAll, kEdge /**< faces with what is held beside it alone */ };

/// How long edges may be, per vertex: a share of how wide the support is there, between what is held; infinite away from it.
/// Pieces of the support have a width each, along the surface.
/// \param role   n, as EditRegions has it
/// \param share  of the width \cost  shortest paths over the surface
[[nodiscard]] std::vector<double> wanted_edges(std::span<const Double3> position,
                                               std::span<const std::array<std::uint32_t, 3>> faces,
                                               std::span<const std::int32_t> role, double share,
                                               SupportPart part);

/// Of the area of the faces with a vertex that wants something, the share in those whose longest edge is more than `times` as
/// long as wanted. 0 without such faces.
[[nodiscard]] double coarse_share(std::span<const Double3> position,
                                  std::span<const std::array<std::uint32_t, 3>> faces,
                                  std::span<const double> wanted, double times);

/// Of these faces the least height, as a share of its longest edge; infinite without such faces. Halves of a face without area
/// have edges without length, for which no cotangents are.
[[nodiscard]] double least_height(std::span<const Double3> position,
                                  std::span<const std::array<std::uint32_t, 3>> faces,
                                  std::span<const double> wanted);

/// Longest edges of these faces, mean by area.
[[nodiscard]] double mean_longest_edge(std::span<const Double3> position,
                                       std::span<const std::array<std::uint32_t, 3>> faces,
                                       std::span<const double> wanted);

struct BaseSplits {
  std::size_t splits = 0;
  double longest = 1.0;  ///< edge left, times what is wanted; 1: none is longer than that
};

/// Halves edges that are longer than wanted at one of their ends, the longest ones first, by what they want. Vertices keep their
/// numbers and places, new ones lie behind them in the middle of edges; so faces cover what they covered. An edge may have any
/// number of faces.
/// \param wanted        n; away from where something is wanted edges may be longer by half the way from there
/// \param max_vertices  no more are made
BaseSplits split_long_edges(std::vector<Double3>& position, std::vector<std::array<std::uint32_t, 3>>& faces,
                            std::vector<double> wanted, std::size_t max_vertices);

/// Upper bound of what these hold for a base of so many vertices, with itself.
[[nodiscard]] std::uint64_t refined_base_bytes(std::uint64_t vertices, std::uint64_t faces);

}  // namespace tessera
