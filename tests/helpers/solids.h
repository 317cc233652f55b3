/// \file solids.h
/// Solids of planes and cylinders joined by minimum and maximum: exact oriented samples, signs and normals.
#pragma once
#include <functional>
#include <vector>

#include "tests/helpers/oriented_samples.h"

namespace tessera::test {

/// Half space or cylinder: exact signed distance and its gradient.
struct Face {
  Double3 point = {0, 0, 0};   ///< on the plane, or on the axis
  Double3 normal = {0, 0, 1};  ///< unit: outward normal of the plane, or the axis of the cylinder
  double radius = 0.0;         ///< > 0 solid cylinder, < 0 bore, 0 plane
  double value(const Double3& p) const;
  Double3 gradient(const Double3& p) const;
};

struct Solid {
  std::vector<Face> faces;
  /// Joins the faces' values (same order) by minima and maxima.
  std::function<double(const std::vector<double>&)> join;

  double value(const Double3& p) const;
  /// Samples of every face where it is part of the surface, within `half_width` of `centre`.
  Samples sample(const Double3& centre, double half_width, double spacing, Random& random) const;
  /// Angle between `n` and the nearest exact normal among the faces within `near` of p, radians.
  double normal_error(const Double3& p, const Double3& n, double near) const;
};

/// Box of half sizes `half` about `centre`, turned by the rotation that takes the axes to (u, v, w).
Solid make_box(const Double3& centre, const Double3& half, bool rotated);
/// Box with a bore of the given radius along its w axis.
Solid make_bored_block(const Double3& centre, const Double3& half, double bore, bool rotated);
/// In the manner of the fandisk: shallow and steep creases, a curved flank, a concave step.
Solid make_fandisk(const Double3& centre, double size, bool rotated);
/// Two parallel faces: a plate of the given thickness, or (`gap`) the slot between two half spaces.
Solid make_slab(const Double3& centre, double thickness, bool gap, bool rotated);
/// A step of the given height between two parallel planes.
Solid make_step(const Double3& centre, double height, bool rotated);

}  // namespace tessera::test
