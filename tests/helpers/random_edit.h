/// \file random_edit.h
/// Edits by chance that a person might make of any mesh, and how many of its faces turn over in them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"
#include "stream/files/json.h"

namespace tessera::test {

/// One of three kinds: what is beyond a plane is turned and moved against what is before another one; a spot is pulled out of a
/// disk; three spots move against each other. No handle goes farther than three tenths of the gap between it and what stays,
/// so that nothing has to fold. Orders, smoothness and details differ, too. \pre points with some extent
tessera::Json random_edit(std::span<const Double3> points, std::uint64_t seed);

struct FlippedFaces {
  std::size_t count = 0;  ///< against how the surface around turns: the rotation that fits three rings best
  std::size_t thin = 0;   ///< the same of faces ten times as long as high, whose corners bend out of line
  std::size_t not_finite = 0;
};

/// Faces without area before, or thinner than `minimum`, say nothing and are left out.
FlippedFaces flipped_faces(std::span<const Double3> before, std::span<const Double3> after,
                           std::span<const std::array<std::uint64_t, 3>> faces, double minimum);

}  // namespace tessera::test
