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
  double radius = 1.0;         ///< > 0
  double corner_radius = 0.0;  ///< within [0, radius]
  double length = 1.0;         ///< from the tip to the top of what cuts, above `corner_radius`
};

/// The union of the tool at all points of a polyline, which may cross itself and stand still. For each segment that is a
/// convex body's sweep, so the nearest place of the tool is where its distance stops falling; segments lie in a tree of
/// boxes.
class SweptTool : public SolidShape {
 public:
  /// \param path  of the tip, local; one point is a tool that only plunged  \param placement  rotates, moves, scales evenly
  /// \pre  path is not empty, coordinates are finite
  SweptTool(const MillingTool& tool, const std::vector<Double3>& path, const Placement& placement);
  double value(const Double3& p) const override;
  [[nodiscard]] Double3 direction(const Double3& p) const override;
  [[nodiscard]] bool holds(const Double3& p) const override;
  bool bounds(Double3& low, Double3& high) const override;
  /// From segment to segment: where the tool on one ends, another may still be cutting.
  double surface_between(const Double3& from, const Double3& to, bool starts_inside) const override;
  /// Holds the segments that matter there alone, and begins with the one that was nearest last.
  [[nodiscard]] std::unique_ptr<SolidShape> near(const Double3& middle, double radius,
                                                 double margin) const override;

  [[nodiscard]] static constexpr std::uint64_t bytes(std::uint64_t points) {
    return points * (24 + 48 + 24) + kMaxNear * 72;
  }

 private:
  static constexpr std::size_t kMaxNear = 1u
                                          << 16;  ///< where more matter, near() holds no fewer than the whole

  struct Segment {
    Double3 a, b;
  };
  struct Box {
    Double3 low, high;  ///< of places of the tip
  };
  struct Nearest {
    double value = 0.0;
    Double3 direction{};
    std::size_t segment = 0;
  };
  SweptTool(const SweptTool& whole, std::vector<Segment>&& segments);
  void build();
  void order(std::size_t first, std::size_t end);
  Nearest nearest(const Double3& local) const;
  /// A segment on which the tool's value at a point is below this; kNone if there is none.
  std::size_t cutting(const Double3& local, double below) const;
  /// Its own, where that is below a value; else some value that is not.
  Nearest of_segment(const Double3& p, std::size_t segment, double below) const;
  bool cuts(const Double3& p, std::size_t segment, double below) const;
  double bound(const Double3& p, const Box& box) const;
  std::size_t leaf_end(std::size_t leaf) const;

  MillingTool tool_;
  std::vector<Segment> segments_;         ///< those near each other side by side
  std::vector<std::vector<Box>> levels_;  ///< levels_[0]: of kLeafSegments each; the last has one box
  Placement placement_, inverse_;
  double scale_ = 1.0;     ///< of the placement
  double rounding_ = 0.0;  ///< bound of what distances may be off, local units
  bool remembers_ = false;
  mutable std::size_t last_ = 0;  ///< where it remembers: the segment to begin with; it changes no result
};

/// Whether a placement turns, moves and scales alike along all directions.
[[nodiscard]] bool is_similarity(const Placement& placement);

}  // namespace tessera
