/// \file face_contact.h
/// How two triangles of a mesh meet beyond the corner or edge that they share, exactly.
/// Source: Guigue and Devillers, "Fast and Robust Triangle-Triangle Overlap Test Using Orientation Predicates", 2003; what only
/// touches, and corners in common, are told apart here.
#pragma once
#include <array>
#include <cstdint>

#include "octree/vector.h"

namespace tessera {

enum class FaceContact : std::uint8_t {
  kNone,     ///< they meet in what they share, or not at all
  kTouch,    ///< they meet, but not their insides: a corner or an edge of one lies on the other
  kOverlap,  ///< their insides meet, and they lie in one plane
  kCross,    ///< their insides meet along a line
};

struct ContactFace {
  std::array<Double3, 3> corner;
  std::array<std::uint64_t, 3>
      vertex;  ///< corners with the same number are shared; those that merely coincide touch
};

/// The same for either order and for any rotation or reversal of corners. Two faces on one edge fold back onto each other
/// (kOverlap) or do not meet; a face that repeats another overlaps it.
/// \pre the corners of each face are finite, its vertices differ, and it has an area: !collinear(its corners); a vertex that
///      both have lies at one position
[[nodiscard]] FaceContact face_contact(const ContactFace& a, const ContactFace& b);

/// Whether faces that meet do so only where both have corners, at one place and under two names: a vertex or an edge of several
/// fans that was taken apart, which is no crossing. \pre as above
[[nodiscard]] bool meet_in_copies(const ContactFace& a, ContactFace b);

}  // namespace tessera
