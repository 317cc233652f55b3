/// \file core_change.h
/// Multiscale model to model cloud comparison (M3C2): how far one cloud lies from another at a core point, along the normal
/// there, and from what on that is more than noise.
/// Source: Lague, Brodu, Leroux, "Accurate 3D comparison of complex topography with terrestrial laser scanner", 2013.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/change/ball_normals.h"
#include "kernels/change/cylinder_positions.h"

namespace tessera {

/// Lengths are in units of the clouds.
struct ChangeRule {
  double normal_scale = 0.0;      ///< diameter of the ball that normals come from, > 0
  double projection_scale = 0.0;  ///< diameter of the cylinder, > 0
  double max_depth = 0.0;         ///< from the core point to either end of the cylinder, > 0
  double registration_error = 0.0;
  bool median = false;  ///< medians and interquartile ranges instead of means and standard deviations
  NormalRule normals;
};

/// With fewer points of either cloud in the cylinder nothing is said of noise.
inline constexpr std::uint64_t kMinNoisePoints = 5;

struct CoreChange {
  Double3 normal{};  ///< zero where there is none
  double distance =
      0.0;  ///< of the new cloud in front of the old one; NaN where one of them has no point in the cylinder
  double uncertainty = 0.0;  ///< level of detection at 95 %; NaN below kMinNoisePoints of either cloud
  bool significant = false;  ///< |distance| > uncertainty
  std::array<AxialPositions, 2> clouds{};  ///< old and new
};

/// 1.96 (sqrt(s1^2 / n1 + s2^2 / n2) + registration error); NaN below kMinNoisePoints of either.
double level_of_detection(const AxialPositions& before, const AxialPositions& after,
                          double registration_error);

/// Scratch, kept between calls.
struct ChangeWork {
  NearCells ball;
  std::array<NearCells, 2> cylinders;
  std::vector<double> values;
};

/// Of core points that lie close together, as those of a cell do: they are looked up together, but what is found of one does not
/// hang on the others.
/// \param before, after  the points of the two clouds within change_reach() of the core points, or more; `before` with moments
/// \param out  one for each
void changes_at(const PointCells& before, const PointCells& after, std::span<const Double3> places,
                const ChangeRule& rule, ChangeWork& work, std::span<CoreChange> out);

/// How far from a core point the points lie that it looks at.
double change_reach(const ChangeRule& rule);
/// Size of cells that suits these scales.
double change_cell_size(const ChangeRule& rule);

}  // namespace tessera
