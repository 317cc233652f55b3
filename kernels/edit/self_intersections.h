/// \file self_intersections.h
/// Self-intersections of a mesh in memory: the faces that pass through others.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

struct SelfIntersections {
  std::vector<std::uint32_t> faces;  ///< ascending: those that intersect another one
  std::size_t pairs = 0;
  /// Of the faces, those along whose line of crossing all pairs lie within kNearRings rings: a local fold. Elsewhere the surface
  /// meets what is far along it, and such a line may end in pairs that are near.
  std::size_t local = 0;
};

inline constexpr int kNearRings = 6;

/// An edge of one passes through the inside of the other, and has no vertex in common with it; by the signs of volumes in
/// double precision. What only touches or lies in one plane does not cross.
/// \param watched  one flag a face: of two faces that cross at least one bears it; empty: all do
/// \cost  O(m log m), about 0.5 us a face
[[nodiscard]] SelfIntersections self_intersections(std::span<const Double3> position,
                                                   std::span<const std::array<std::uint32_t, 3>> faces,
                                                   std::span<const std::uint8_t> watched);

/// Upper bound of what it allocates.
[[nodiscard]] constexpr std::uint64_t self_intersections_bytes(std::uint64_t faces) {
  return faces * 170;
}

}  // namespace tessera
