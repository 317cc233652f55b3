/// \file height_classes.h
/// The class of a point of a scan seen from above, by its height over the ground. Classes and their numbers: LAS
/// Specification 1.4 R15 (ASPRS), table 17; it sets no heights for vegetation, those here are the usual ones.
#pragma once
#include <cstdint>

#include "kernels/points/ground_filter.h"

namespace tessera {

enum LasClass : std::uint8_t {
  kClassUnassigned = 1,
  kClassGround = 2,
  kClassLowVegetation = 3,
  kClassMediumVegetation = 4,
  kClassHighVegetation = 5,
  kClassBuilding = 6,
  kClassNoise = 7,
  kClassWater = 9,
  kClassHighNoise = 18,
};

/// Heights over the ground, in the unit of heights.
struct HeightClasses {
  double medium = 0.5;  ///< from here on vegetation is medium ...
  double high = 2.0;    ///< ... from here on high
  double noise = 0.0;   ///< what is higher is noise; 0 = nothing is
  bool ground_only = false;
};

/// \param above  height over the ground there, below it negative
/// \param kind   GroundCell of the cell
/// \param roof   whether the cell is one of find_roofs() \param water  whether it is one of find_water()
[[nodiscard]] inline std::uint8_t class_by_height(double above, double tolerance, std::uint8_t kind,
                                                  bool roof, bool water, const HeightClasses& classes) {
  if (above <= tolerance && above >= -tolerance) return water ? kClassWater : kClassGround;
  if (classes.ground_only) return kClassUnassigned;
  // Of what lies too low only pits are known to be no ground: else the surface runs across a step.
  if (above < 0.0) return kind == kGroundPit ? kClassNoise : kClassUnassigned;
  if (classes.noise > 0.0 && above > classes.noise) return kClassNoise;
  if (above < classes.medium) return kClassLowVegetation;
  if (above < classes.high) return kClassMediumVegetation;
  return roof ? kClassBuilding : kClassHighVegetation;
}

}  // namespace tessera
