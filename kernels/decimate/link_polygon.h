/// \file link_polygon.h
/// The new fan of a collapse as a graph over the polygon of its link, and what a point, a segment or a triangle of another
/// surface is over it.
///
/// The link is seen along the normal of its area vector, in coordinates relative to the vertex that takes over. Spoke j runs from
/// the centre of the fan to corner j, link edge j from corner j to the next, sector j lies between both and spoke j + 1.
/// Deviations are heights along the normal.
///
/// Rounding. Coordinates are rounded to float, so with R the largest of the polygon, u = 2^-24, a height is off by less than
/// 16 u R: rounding() of it.
#pragma once
#include <immintrin.h>

#include <array>
#include <bit>
#include <cstdint>

#include "kernels/decimate/collapse_deviation.h"
#include "octree/vector.h"

namespace tessera {

/// A point seen from the polygon.
struct PolygonPoint {
  float x = 0.0f, y = 0.0f, z = 0.0f;
  float deviation = 0.0f;   ///< to the fan or, beyond a line of the link, to that; 0 outside
  bool inside = false;      ///< of the polygon, or between a line of the link and that of the reference
  std::uint8_t sector = 0;  ///< of the polygon, 0 outside
  std::uint64_t spokes = 0, link = 0;  ///< bit j: left of spoke j, of link edge j
};
using PolygonTriangle = std::array<const PolygonPoint*, 3>;

struct LinkPolygon {
  static constexpr std::size_t kLanes = 8, kPadded = 64;
  std::size_t size = 0;
  std::size_t first = 0;  ///< corner of the link: 1 where corner 0 is the centre of a closed fan, else 0
  std::uint64_t sectors = 0, corners = 0, inner_spokes = 0;  ///< bits of those that there are
  alignas(32) std::array<float, kPadded> x{}, y{}, z{}, edge_x{}, edge_y{}, edge_c{};
  std::array<float, kPadded> edge_z{};
  std::array<float, kPadded> slope_x{}, slope_y{}, cosine{};  ///< of sectors: z = slope_x x + slope_y y
  Double3 ex{}, ey{};                                         ///< axes of the plane
  alignas(
      16) std::array<float, 12> frame{};  ///< columns: what x, y and z add to the coordinates in the plane
  float radius = 0.0f;                    ///< largest coordinate

  [[nodiscard]] std::size_t following(std::size_t i) const { return i + 1 < size ? i + 1 : first; }
  [[nodiscard]] std::size_t sector_before(std::size_t spoke) const {
    return spoke == first ? size - 1 : spoke - 1;
  }
  [[nodiscard]] float rounding() const { return 16.0f * 0x1p-24f * radius; }
  [[nodiscard]] Float3 corner(std::size_t j) const { return {x[j], y[j], z[j]}; }
  [[nodiscard]] Float3 edge(std::size_t j) const { return {edge_x[j], edge_y[j], edge_z[j]}; }
};

/// \param inner_centre  loop.at[0] is no part of the link but the centre of a closed fan
/// \return false where the loop has no area or too many corners, or a closed fan is no graph over it
bool make_polygon(const LinkLoop& loop, bool inner_centre, LinkPolygon& polygon);

/// The sector that a point with these sides lies in, as its bit; 0 outside.
[[nodiscard]] inline std::uint64_t sector_bits(const LinkPolygon& g, const PolygonPoint& p) {
  return p.spokes & ~(p.spokes >> 1 | (p.spokes >> g.first & 1u) << (g.size - 1)) & p.link & g.sectors;
}

/// Sets spokes, link, sector and inside from x and y.
inline void classify(const LinkPolygon& g, PolygonPoint& p) {
  const __m256 px = _mm256_set1_ps(p.x), py = _mm256_set1_ps(p.y), zero = _mm256_setzero_ps();
  p.spokes = p.link = 0;
  for (std::size_t at = 0; at < g.size; at += LinkPolygon::kLanes) {
    const __m256 spoke = _mm256_sub_ps(_mm256_mul_ps(_mm256_load_ps(&g.x[at]), py),
                                       _mm256_mul_ps(_mm256_load_ps(&g.y[at]), px));
    const __m256 link = _mm256_sub_ps(_mm256_sub_ps(_mm256_mul_ps(_mm256_load_ps(&g.edge_x[at]), py),
                                                    _mm256_mul_ps(_mm256_load_ps(&g.edge_y[at]), px)),
                                      _mm256_load_ps(&g.edge_c[at]));
    p.spokes |= static_cast<std::uint64_t>(_mm256_movemask_ps(_mm256_cmp_ps(spoke, zero, _CMP_GE_OQ))) << at;
    p.link |= static_cast<std::uint64_t>(_mm256_movemask_ps(_mm256_cmp_ps(link, zero, _CMP_GE_OQ))) << at;
  }
  p.spokes &= g.corners;
  p.link &= g.corners;
  const std::uint64_t sector = sector_bits(g, p);
  p.inside = sector != 0;
  p.sector = p.inside ? static_cast<std::uint8_t>(std::countr_zero(sector)) : std::uint8_t{0};
}

/// Whether the triangle is turned over, beyond rounding.
[[nodiscard]] bool is_folded(const LinkPolygon& polygon, const PolygonTriangle& p);

/// Whether the segment, with both ends outside, meets the inside of the polygon.
[[nodiscard]] bool meets_polygon(const LinkPolygon& polygon, const PolygonPoint& a, const PolygonPoint& b);

/// The largest deviation of the segment where it crosses spokes and link edges, with `own` added; 0 where it crosses none.
[[nodiscard]] float crossing_deviation(const LinkPolygon& polygon, const PolygonPoint& a,
                                       const PolygonPoint& b, float own);

/// The largest deviation of the corners of the fan over or under the triangle, and their bits.
struct CornerDeviation {
  float deviation = 0.0f;
  std::uint64_t corners = 0;
};
[[nodiscard]] CornerDeviation corner_deviation(const LinkPolygon& polygon, const PolygonTriangle& p);

/// Bits of the sectors over or under the triangle, drawn in a little, so that one that it only touches does not count.
[[nodiscard]] std::uint64_t overlapped_sectors(const LinkPolygon& polygon, const PolygonTriangle& p);

/// From p, outside, to the nearest of the link edges `lines` (bits) beside which it lies; negative where there is none.
[[nodiscard]] float distance_beyond_lines(const LinkPolygon& polygon, std::uint64_t lines,
                                          const PolygonPoint& p);

/// From p to the nearest of the link edges `lines` and of the corners `ends`, or `far` where none is nearer.
[[nodiscard]] float distance_to_lines(const LinkPolygon& polygon, std::uint64_t lines, std::uint64_t ends,
                                      const PolygonPoint& p, float far2);

}  // namespace tessera
