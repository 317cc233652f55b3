/// \file line_smoothing.h
/// Lines of a map made smooth without crossing: every point stays within its tolerance of where it was, and within less than half
/// the distance from there to the nearest other line, so that two lines cannot meet; a line that would cross itself is left as it
/// is around there.
#pragma once
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Between two segments; 0 where they meet.
double segment_distance(const Double2& a, const Double2& b, const Double2& c, const Double2& d);

/// Pairs of segments that are no neighbours and have a point in common, as positions, each segment once, ascending; exact.
/// \param closed  the last point is joined to the first one, which is not repeated
[[nodiscard]] std::vector<std::size_t> self_crossings(std::span<const Double2> points, bool closed);

/// Points between segments are added where these are long, then points move towards the middle of their neighbours, over and over, each held
/// within its limit. Ends of open lines stay.
/// \param limit  by segment, how far its points may move, >= 0: of a point of two the smaller one
/// \param tolerance  the largest of them; > 0
/// \returns the line; as it came where nothing else does not cross itself
[[nodiscard]] std::vector<Double2> smooth_line(std::span<const Double2> points, bool closed,
                                               std::span<const double> limit, double tolerance);

}  // namespace tessera
