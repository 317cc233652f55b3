/// \file plan_drawing.h
/// A drawing to scale for a page: lines over a grid whose coordinates stand beside it, as inline SVG in millimetres of the paper.
/// However many points lines have, it holds a bounded number of them.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// How a line looks.
enum class DrawnLine : std::uint8_t { kOutline, kArea, kAxis, kMark };

class PlanDrawing {
 public:
  /// \param min, max  what is drawn, scan units; max >= min
  /// \param right, up  what the coordinates are: "offset", "height"
  /// \param max_points  of all lines together, >= 8
  PlanDrawing(const Double2& min, const Double2& max, std::string right, std::string up,
              std::size_t max_points = 20000);

  /// Of points that follow each other on one spot the first stays. Above max_points of them spots grow to twice their size, for all lines so far.
  void add(std::span<const Double2> points, bool closed, DrawnLine look);
  /// \param text  plain
  void label(const Double2& at, const std::string& text);

  /// <svg>: pure, the same for the same calls.
  std::string svg() const;
  /// "1 : 200 where coordinates are metres".
  std::string scale_text() const;

 private:
  struct Line {
    std::vector<std::array<std::int32_t, 2>> points;  ///< units of the drawing
    bool closed = false;
    DrawnLine look = DrawnLine::kOutline;
  };
  struct Label {
    Double2 at{};
    std::string text;
  };
  void coarsen();
  std::string grid() const;
  std::int64_t across(double x) const;  ///< of the drawing, its units
  std::int64_t down(double y) const;

  Double2 min_, max_;
  std::string right_, up_;
  std::size_t max_points_;
  double scale_ = 1.0;  ///< scan units per unit of the drawing
  int spot_bits_ = 0;   ///< of the edge of a spot, units of the drawing
  std::vector<Line> lines_;
  std::size_t points_ = 0;
  std::vector<Label> labels_;
};

}  // namespace tessera
