/// \file auto_tolerance.h
/// `--tolerance auto` of jobs that decimate: what nobody would miss, and no less than what the scan cannot tell anyway.
#pragma once
#include <algorithm>

namespace tessera {

/// Stands for `auto` among the options.
inline constexpr double kAutoTolerance = -1.0;
/// The same of a tolerance of colours: by their noise (auto_colour_tolerance()).
inline constexpr double kAutoColourTolerance = -1.0;

/// Scan units. \param cell  the lattice's, or the edge of a mesh (root mean square)
/// \param noise  standard deviation along the normal
[[nodiscard]] inline double auto_tolerance(double cell, double noise) {
  constexpr double kShare = 0.2;
  return std::max(kShare * cell, noise);
}

}  // namespace tessera
