/// \file rib_profile.h
/// What a rib is made of: two flanks, straight lines in its plane, and the arc that a ball of one radius leaves where it
/// rolls along both. A sharp crease is an arc of radius zero.
/// Source: thesis 4.3.2 (rolling ball blends), 4.3.4 (rounding, sharpening).
///
///            arc
///         T0 .-~-. T1          normals of the flanks at angles a0, a1 from y towards x;
///   flank  /       \  flank    flank k is {p : n_k p = d_k}; convex a0 < a1 and radius > 0,
///         /    .    \          concave a0 > a1 and radius < 0: the centre lies outside
///            centre
#pragma once
#include <array>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

struct RibProfile {
  std::array<double, 2> angle{};  ///< radians
  std::array<double, 2> offset{};
  double radius = 0.0;  ///< of the arc, with the sign of the blend

  double arc_angle() const;  ///< of the arc, radians, >= 0
  [[nodiscard]] Double2 centre() const;
  [[nodiscard]] Double2 corner() const;  ///< where the flanks would meet
  [[nodiscard]] Double2 middle() const;  ///< of the arc
  double middle_angle() const { return 0.5 * (angle[0] + angle[1]); }
  double arc_length() const;
  double tangent_length() const;  ///< from the corner to where a flank begins
  /// Point on the arc, 0 to 1 from flank to flank.
  [[nodiscard]] Double2 on_arc(double share) const;
  /// Point on flank `side` so far from the corner.
  [[nodiscard]] Double2 on_flank(std::size_t side, double from_corner) const;
  /// Unit, out of the surface, at these points.
  [[nodiscard]] Double2 arc_normal(double share) const;
  [[nodiscard]] Double2 flank_normal(std::size_t side) const;
};

enum class RibZone { kLeft, kArc, kRight };
/// Where a point is beside a profile.
struct ProfilePosition {
  RibZone zone = RibZone::kArc;
  double run = 0.0;       ///< arc length of its foot from the middle of the arc
  double distance = 0.0;  ///< above 0 outside
};
[[nodiscard]] ProfilePosition profile_position(const RibProfile& profile, const Double2& p);

struct ProfileFit {
  RibProfile profile;
  bool found = false;
  double rms = 0.0;                    ///< of distances
  std::array<std::size_t, 3> count{};  ///< of points by zone
};
/// Least squares over all five numbers of a profile, by steps of Levenberg and Marquardt.
/// \param start   where to begin; the sign of a blend stays
/// \post  exact points give the exact profile, up to rounding
[[nodiscard]] ProfileFit fit_profile(std::span<const Double2> points, const RibProfile& start, bool convex);

/// To begin with: lines through the points left and right of the band, the arc that fits its width.
[[nodiscard]] ProfileFit guess_profile(std::span<const Double2> points, double half_width, bool convex);

}  // namespace tessera
