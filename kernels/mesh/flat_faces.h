/// \file flat_faces.h
/// Faces without area: corners on one line, as CAD tessellations and cut polygons leave them. They have no normal, so
/// nothing downstream can judge them; taking them out must neither move the surface nor open it.
#pragma once
#include <cstdint>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// Altitude over longest edge below which a face has no area: what rounding leaves of three points on a line.
inline constexpr double kFlatAltitude = 1e-12;

/// Twice the area of a face and the square of its longest edge.
struct FaceExtent {
  double twice_area = 0.0;
  double longest2 = 0.0;
  [[nodiscard]] bool is_flat() const { return twice_area <= kFlatAltitude * longest2; }
};
[[nodiscard]] FaceExtent face_extent(const Double3& a, const Double3& b, const Double3& c);

/// Removes faces without area in place, exactly where the surface is: the longest edge of such a face turns towards the
/// corner across it, so that the two faces share what the neighbour covered; at a border the face goes and the border
/// takes its two other edges; a face with borders all around is a line, and goes.
/// Left are those at creases, those whose new edge exists already, and those about which the block knows too little.
/// \pre  edges have at most two faces; face_flags (and face_bound, unless empty) are per face
/// \post canonical where anything changed; vertices keep key and place; a bound is the larger of those that met
/// \return how many faces were turned or dropped
std::uint64_t mend_flat_faces(MeshBlock& block);

/// Drops the faces without area that have borders all around: what mend_flat_faces() drops, for who compares with its
/// result. Returns how many.
std::uint64_t drop_flat_islands(MeshBlock& block);

}  // namespace tessera
