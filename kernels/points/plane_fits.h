/// \file plane_fits.h
/// Planes through neighbourhoods, four at a time: the tangent planes of Hoppe et al. 1992.
#pragma once
#include <array>
#include <cstddef>

#include "octree/vector.h"

namespace tessera {

inline constexpr float kNoPlane = 1.0f / 3.0f;  ///< the largest surface variation there is

/// Weighted sums over four neighbourhoods, offsets from their middles: one lane each.
struct alignas(32) NeighbourSums {
  static constexpr std::size_t kLanes = 4;
  enum Row : std::size_t { kWeight, kX, kY, kZ, kXX, kXY, kXZ, kYY, kYZ, kZZ, kRows };
  double row[kRows][kLanes] = {};
};

struct FittedPlane {
  Float3 normal{};  ///< unit, its component of largest magnitude positive; zero where all lie on a line
  float variation = kNoPlane;  ///< l0 / (l0 + l1 + l2) of the covariance
  float residual = 0.0f;       ///< weighted RMS distance to the plane
};

/// Each lane alone: a plane does not hang on those beside it. The eigenvalues are min_eigen3()'s to the last bit.
[[nodiscard]] std::array<FittedPlane, NeighbourSums::kLanes> fit_planes(const NeighbourSums& sums);

}  // namespace tessera
