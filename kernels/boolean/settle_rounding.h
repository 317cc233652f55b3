/// \file settle_rounding.h
/// Positions on a cut are quotients and have to become numbers of a file. Where that makes faces meet that did not, vertices on the
/// cut are put on other numbers nearby, a step further each time, until none does.
/// Source: after Devillers, Lazard, Lenhart, "3D Snap Rounding", 2018, whose cells would be cut here without need.
#pragma once
#include <cstdint>
#include <optional>

#include "kernels/boolean/exact_boolean.h"

namespace tessera {

/// What positions become.
enum class PositionStep : std::uint8_t { kDouble, kFloat };

struct RoundingStats {
  std::uint64_t met = 0;         ///< faces that met others, or had no area, as rounded to the nearest
  std::uint64_t moved = 0;       ///< vertices that were put elsewhere
  double farthest = 0.0;         ///< of these from where they were rounded to
  std::uint64_t left = 0;        ///< faces that still do
  std::optional<Double3> where;  ///< the first of them
};

/// Moves vertices of `made` alone. Faces without one are taken to be sound.
/// \param step  kFloat: vertices of `made` are rounded to floats first; the others are floats
/// \cost a tree of boxes over all faces, and a few us a face at vertices of `made`
RoundingStats settle_rounding(BooleanResult& result, PositionStep step);

}  // namespace tessera
