/// \file orientation_sign.h
/// Exact signs of orientation determinants: on which side of a line or plane a point lies. A filter in double precision, and
/// expansions of doubles where it leaves doubt.
/// Source: Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997.
/// Exact while no product of three differences of coordinates under- or overflows: differences of 0 or from 1e-80 to 1e100.
#pragma once
#include <array>

#include "octree/vector.h"

namespace tessera {

/// Of twice the area of a, b, c. \returns 1 if they turn counter-clockwise, -1 if clockwise, 0 on one line
[[nodiscard]] int orient2d_sign(const Double2& a, const Double2& b, const Double2& c);

/// Of dot(cross(b - a, c - a), d - a). \returns 1 if d lies on the side from which a, b, c turn counter-clockwise, -1 on the
/// other one, 0 in the plane
[[nodiscard]] int orient3d_sign(const Double3& a, const Double3& b, const Double3& c, const Double3& d);

/// Whether the three lie on one line.
[[nodiscard]] bool collinear(const Double3& a, const Double3& b, const Double3& c);

}  // namespace tessera
