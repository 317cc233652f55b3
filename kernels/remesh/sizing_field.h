/// \file sizing_field.h
/// How long edges may be at every vertex of the reference: short where it bends, growing slowly away from there.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

struct SizingOptions {
  double tolerance = 0.0;  ///< distance of a chord to the surface, scan units; 0 = lengths are all `longest`
  double shortest = 0.0, longest = 0.0;  ///< scan units
  double line_tolerance = 0.0;           ///< of the chord of an edge to a crease, scan units; 0 = free
};

/// By how much lengths grow per length of way: neighbouring edges differ by a fifth.
inline constexpr double kSizingGrowth = 0.2;
/// Away from bends of lines alone: what is short there is left behind within two of the longest edges.
inline constexpr double kLineGrowth = 0.4;
/// Of the longest: no edge gets shorter by the bend of a line alone.
inline constexpr double kShortestOnLine = 0.1;

/// Per vertex clamp(sqrt(6 E / k - 3 E^2)), k the largest curvature there (Dunyach et al. 2013), then the largest
/// lengths below that grow by no more than kSizingGrowth along edges. What lies farther than
/// (longest - shortest) / kSizingGrowth has no say. Curvature is the turn of normals along edges, which are averaged
/// over two rings first; along `lines`, whose vertices have no single normal, the turn of the line with half the tolerance.
/// Without a tolerance `at_lines` alone says what is short.
/// \param lines  pairs of segments that go on in each other, as their three vertices in order
/// \param on_line  per vertex
/// \param at_lines  per vertex the length that chords of its line allow; empty = any
[[nodiscard]] std::vector<float> sizing_field(const MeshBlock& reference,
                                              std::span<const std::uint8_t> on_line,
                                              std::span<const std::array<std::uint32_t, 3>> lines,
                                              std::span<const float> at_lines, const SizingOptions& options);

}  // namespace tessera
