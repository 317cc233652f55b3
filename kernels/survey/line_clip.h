/// \file line_clip.h
/// Lines cut off at the sides of an upright strip.
#pragma once
#include <vector>

#include "octree/vector.h"

namespace tessera {

struct ClippedLine {
  std::vector<Double2> points;  ///< two at least
  bool closed = false;          ///< the last point is joined to the first one, which is not repeated
};

/// The pieces of a line where its first coordinate lies from min to max, in the order of the line, its points as they are;
/// where it leaves the strip a piece ends at that very coordinate. What only touches a side is left out. A closed line
/// within the strip stays closed, of one that leaves it no piece is.
[[nodiscard]] std::vector<ClippedLine> clip_line(const std::vector<Double2>& points, bool closed, double min,
                                                 double max);

}  // namespace tessera
