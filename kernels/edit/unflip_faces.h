/// \file unflip_faces.h
/// Faces of a base that a pose turns over, and how they come upright again. A detail stands on its vertex of the smooth base alone
/// (thesis 5.3): where rotations of neighbours differ by more than details are long, faces between them turn over. Around such
/// faces edges count instead of vertices: they go to where the mean of their ends' rotations turns them, in the sense of least
/// squares with cotangents as weights. Source: Sorkine, Alexa, "As-Rigid-As-Possible Surface Modeling", 2007, its global step.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/edit/vertex_rotations.h"
#include "octree/vector.h"

namespace tessera {

/// A base that is to be posed.
struct RotatedBase {
  std::span<const Double3> rest;  ///< n
  std::span<const std::array<std::uint32_t, 3>> faces;
  std::span<const std::uint8_t> free;  ///< n flags: the others are where they shall be
  std::span<const Rotation> rotation;  ///< n, read where free: how the smooth base turns
};

/// Ascending: those with a free vertex whose normal is turned by nearly a right angle (84 degrees) and more against how the
/// surface turns around them (fitted_rotations()). Faces without area do not turn.
[[nodiscard]] std::vector<std::uint32_t> flipped_faces(const RotatedBase& base,
                                                       std::span<const Double3> posed);

/// Faces that were turned over, and that are.
struct UnflipReport {
  std::size_t before = 0, left = 0;
};

/// Lifts faces that are turned over, by less than a tenth of an edge. Where that leaves some, relaxes free vertices within more and more
/// rings around them until none is left, a fixed number of times; keeps what leaves the fewest. Nothing else moves.
UnflipReport unflip(const RotatedBase& base, std::vector<Double3>& posed);

/// The first step of it alone: what it leaves stays.
UnflipReport lift_flipped(const RotatedBase& base, std::vector<Double3>& posed);

/// Blends the surface towards another pose around flipped faces: first half the way, then all of it, over one more ring each
/// round. Keeps the state with the fewest flipped faces. \param left  flipped_faces() of `posed` \return flipped_faces() of the result
std::size_t yield_to(const RotatedBase& base, std::span<const Double3> other, std::size_t left,
                     std::vector<Double3>& posed);

/// Upper bound of what they allocate.
[[nodiscard]] constexpr std::uint64_t unflip_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return 360 * vertices + 190 * faces;
}

}  // namespace tessera
