/// \file ball_normals.h
/// Normals of a cloud at a given scale: planes through all points of a ball, by their covariance.
/// Source: Lague, Brodu, Leroux, "Accurate 3D comparison of complex topography with terrestrial laser scanner", 2013, 3.1.
#pragma once
#include <optional>

#include "kernels/change/near_cells.h"

namespace tessera {

/// Where normals show, and what becomes of them.
struct NormalRule {
  enum class Kind { kFree, kHorizontal, kVertical };
  Kind kind = Kind::kFree;  ///< kHorizontal: without z; kVertical: straight up, points are not looked at
  Double3 direction = {0, 0, 1};     ///< normals show to its side
  std::optional<Double3> viewpoint;  ///< they show to its side instead
};

/// Unit normal at p of the points of the cloud whose distance to p is at most the radius. None where they are fewer than three
/// or lie on a line, or where nothing is left without z. A normal across the direction has its first component that is not
/// zero positive.
/// \param cells  with moments  \param near  of them, all that hold points of the ball  \param radius  > 0
[[nodiscard]] std::optional<Double3> ball_normal(const PointCells& cells, const NearCells& near,
                                                 const Double3& p, double radius, const NormalRule& rule);

/// The normal as the rule has it. \param normal  unit, either side
[[nodiscard]] std::optional<Double3> ruled_normal(const Double3& normal, const Double3& p,
                                                  const NormalRule& rule);

}  // namespace tessera
