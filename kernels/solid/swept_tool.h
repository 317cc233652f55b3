/// \file swept_tool.h
/// What a milling tool takes away: ball, flat or bull nose, upright, swept along a polyline of its tip (thesis 3.1.2).
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/solid/solid_shape.h"

namespace tessera {

/// A tool that stands upright on its tip: a cylinder whose lower rim is rounded. The radius of the rim is that of the tool
/// for a ball nose, 0 for a flat one.
struct MillingTool {
  double radius = 1.0;  ///< > 0
  double rim = 0.0;     ///< within [0, radius]
  double length = 1.0;  ///< from the tip to the top of what cuts, above `rim`
};

/// The union of the tool at all points of a polyline. For each segment that is a convex body's sweep, so the nearest place
/// of the tool is found by halving; segments lie in a tree of boxes in the order of the path.
class SweptTool : public SolidShape {
 public:
  /// \param path  of the tip, local; one point is a tool that only plunged  \param placement  rotates, moves, scales evenly
  /// \pre  path is not empty, coordinates are finite
  SweptTool(const MillingTool& tool, std::vector<Double3> path, const Placement& placement);
  double value(const Double3& p) const override;
  Double3 direction(const Double3& p) const override;
  bool bounds(Double3& low, Double3& high) const override;

  static constexpr std::uint64_t bytes(std::uint64_t points) { return points * (24 + 48); }

 private:
  struct Box {
    Double3 low, high;
  };
  struct Nearest {
    double value = 0.0;
    Double3 direction{};
  };
  Nearest nearest(const Double3& local) const;
  /// Its own, where that is below a value; else some value that is not.
  Nearest of_segment(const Double3& p, std::size_t segment, double below) const;
  Nearest of_tool(const Double3& from_tip) const;
  double bound(const Double3& p, const Box& box) const;

  MillingTool tool_;
  std::vector<Double3> path_;
  std::size_t segments_ = 0;
  std::vector<std::vector<Box>> levels_;  ///< levels_[0]: of kLeafSegments each; the last has one box
  Placement placement_, inverse_;
  double scale_ = 1.0;  ///< of the placement
};

/// Whether a placement turns, moves and scales alike along all directions.
bool is_similarity(const Placement& placement);

}  // namespace tessera
