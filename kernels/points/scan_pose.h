/// \file scan_pose.h
/// Whether the samples of a scan can have been seen from where its pose puts the scanner. World coordinates exported with
/// an identity pose put it at zero, where nobody stood; normals turned towards it would be turned at random.
/// A scanner's grid is a grid of directions: the samples of a column lie in a plane through the scanner (a half great circle
/// of directions; in a pinhole camera those of rows too), whatever the range. Seen from anywhere else relief bends them out
/// of it. A raster in space, of terrain say, has even steps in two coordinates instead; seen from afar, or where it is flat,
/// its lines lie in planes as well, but no scanner's steps are even in metres.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// A sample of a scan, and where it lies in the scan's grid.
struct GridSample {
  std::int64_t line = 0;  ///< row or column, as the file is ordered
  std::int64_t cell = 0;  ///< within the line
  Double3 p{};            ///< relative to the scanner, finite
};

enum class ScanPose : std::uint8_t {
  kHolds,    ///< nothing speaks against it; also where there are too few samples to tell
  kFar,      ///< the samples lie so far off, for their extent, that nobody scanned them from there
  kOffRays,  ///< the samples of no row and no column lie in a plane through the scanner
  kRaster,   ///< the grid is even in space, much more so than in directions from the scanner
};

/// \param spread  positions from all over the scan, relative to the scanner, finite; they tell distance and extent
/// \param grid    samples of pairs of consecutive lines from all over the grid, and in these of pairs of consecutive cells,
///                in any order; empty = the scan has no grid
/// \param filled_in  the pose is neither missing nor the identity: somebody gave it
[[nodiscard]] ScanPose check_scan_pose(std::span<const Double3> spread, std::vector<GridSample> grid,
                                       bool filled_in);

/// Which lines, or which cells of a line, check_scan_pose() is to see: pairs of neighbours, evenly spread.
/// \param pairs  about how many
class PairChoice {
 public:
  PairChoice(std::uint64_t count, std::uint64_t pairs) : stride_(count / pairs > 2 ? count / pairs : 2) {}
  [[nodiscard]] bool takes(std::uint64_t i) const { return i % stride_ < 2; }

 private:
  std::uint64_t stride_;
};
inline constexpr std::uint64_t kPoseLinePairs = 32, kPoseCellPairs = 96;

/// Positions from all over a stream of unknown length: every so many, a fixed number at most.
class EvenSpread {
 public:
  /// Whether the next of the stream is wanted; add() must follow then, unless it has no position.
  bool wants_next() { return next_++ % every_ == 0; }
  void add(const Double3& p);
  [[nodiscard]] std::span<const Double3> positions() const { return kept_; }

 private:
  static constexpr std::size_t kMax = 2048;
  std::uint64_t next_ = 0, every_ = 1;
  std::vector<Double3> kept_;
};

}  // namespace tessera
