#include "kernels/survey/section_frame.h"

#include <cmath>

namespace tessera {

std::vector<AxisPiece> axis_pieces(std::span<const Double2> corners) {
  std::vector<AxisPiece> pieces;
  double station = 0.0;
  for (std::size_t k = 1; k < corners.size(); ++k) {
    const Double2 &a = corners[k - 1], &b = corners[k];
    const double x = b[0] - a[0], y = b[1] - a[1], length = std::sqrt(x * x + y * y);
    if (!(length > 0.0)) continue;
    pieces.push_back({a, b, station, length});
    station += length;
  }
  return pieces;
}

SectionFrame::SectionFrame(SectionKind kind, const AxisPiece& piece)
    : kind_(kind),
      start_(piece.start),
      along_{(piece.end[0] - piece.start[0]) / piece.length, (piece.end[1] - piece.start[1]) / piece.length},
      station_(piece.station) {}

Double3 SectionFrame::turned(const Double3& place) const {
  if (kind_ == SectionKind::kHorizontal) return place;
  const double x = place[0] - start_[0], y = place[1] - start_[1];
  const double station = station_ + (x * along_[0] + y * along_[1]), left = y * along_[0] - x * along_[1];
  if (kind_ == SectionKind::kAlong) return {station, place[2], left};
  return {0.0 - left, place[2], station};
}

Double3 SectionFrame::place(const Double3& turned) const {
  if (kind_ == SectionKind::kHorizontal) return turned;
  const bool along = kind_ == SectionKind::kAlong;
  const double ahead = (along ? turned[0] : turned[2]) - station_, left = along ? turned[2] : 0.0 - turned[0];
  return {start_[0] + (ahead * along_[0] - left * along_[1]),
          start_[1] + (ahead * along_[1] + left * along_[0]), turned[1]};
}

}  // namespace tessera
