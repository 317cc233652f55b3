/// \file section_frame.h
/// Frames in which the planes of sections are levels of a third coordinate, so that they are cut as contour lines are
/// (contour_chains.h), and the other two are those of the drawing.
#pragma once
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

enum class SectionKind {
  kAcross,  ///< upright planes across an axis; drawn: offset to the right of it, height; levels: stations
  kAlong,   ///< the upright plane through an axis; drawn: station, height; level 0 of the offset to its left
  kHorizontal  ///< drawn: x, y; levels: heights
};

/// A straight piece of an axis, seen from above.
struct AxisPiece {
  Double2 start{}, end{};
  double station = 0.0;  ///< of its start, along the axis
  double length = 0.0;   ///< > 0
};

/// Of a polyline; corners that repeat the one before make no piece.
[[nodiscard]] std::vector<AxisPiece> axis_pieces(std::span<const Double2> corners);

class SectionFrame {
 public:
  SectionFrame() = default;  ///< of horizontal sections: the world's
  /// \param kind  not horizontal
  SectionFrame(SectionKind kind, const AxisPiece& piece);

  /// The same bits for the same place. Both upright frames are left-handed: lines of ground, the solid below, run to the
  /// right of the drawing.
  [[nodiscard]] Double3 turned(const Double3& place) const;
  /// The inverse, but for rounding.
  [[nodiscard]] Double3 place(const Double3& turned) const;

 private:
  SectionKind kind_ = SectionKind::kHorizontal;
  Double2 start_{}, along_{1.0, 0.0};  ///< unit
  double station_ = 0.0;
};

}  // namespace tessera
