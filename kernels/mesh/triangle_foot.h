/// \file triangle_foot.h
/// The closest point of one triangle, and what of the triangle it lies on.
#pragma once
#include "octree/vector.h"

namespace tessera {

struct TriangleFoot {
  Double3 at{};
  int edge = -1;    ///< it lies on the edge from this corner to the next, not at an end
  int corner = -1;  ///< it is this corner; neither: it lies within
};

/// The closest point of the triangle (a, b, c) to p; a triangle may be degenerate.
[[nodiscard]] TriangleFoot foot_in_triangle(const Double3& p, const Double3& a, const Double3& b,
                                            const Double3& c);

}  // namespace tessera
