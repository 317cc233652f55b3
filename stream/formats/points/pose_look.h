/// \file pose_look.h
/// A look at some samples of a scan while its file is opened: whether its pose can be true (kernels/points/scan_pose.h),
/// and the sentence about poses that are not.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "kernels/points/scan_pose.h"

namespace tessera {

/// Collects samples of one scan whose records lie line by line.
class PoseLook {
 public:
  PoseLook() : PoseLook({}, 0, 0) {}
  /// \param scanner  in the frame of the samples   \param lines, cells  of the grid as declared; 0 = there is none
  PoseLook(const Double3& scanner, std::uint64_t lines, std::uint64_t cells)
      : scanner_(scanner), lines_(lines, kPoseLinePairs), cells_(cells, kPoseCellPairs), width_(cells) {}

  /// Whether record `n` of the scan is wanted. Records must be asked for in their order.
  bool wants_next(std::uint64_t n) {
    spread_wants_ = spread_.wants_next();
    grid_wants_ =
        grid_.size() < kMaxOfGrid && width_ > 0 && lines_.takes(n / width_) && cells_.takes(n % width_);
    return spread_wants_ || grid_wants_;
  }
  /// The position of the record asked for last, if it has one.
  void add(std::uint64_t n, const Double3& p) {
    add(static_cast<std::int64_t>(n / (width_ > 0 ? width_ : 1)),
        static_cast<std::int64_t>(width_ > 0 ? n % width_ : 0), p, spread_wants_, grid_wants_);
  }
  /// The same where records say themselves in which line and cell they lie.
  void add(std::int64_t line, std::int64_t cell, const Double3& p, bool to_spread, bool to_grid);

  /// \param filled_in  as check_scan_pose()   \param grid  the grid is one
  ScanPose verdict(bool filled_in, bool grid) {
    if (!grid) grid_.clear();
    return check_scan_pose(spread_.positions(), std::move(grid_), filled_in);
  }

 private:
  /// More than the pairs asked for, where the grid is not as large as declared.
  static constexpr std::size_t kMaxOfGrid = std::size_t{1} << 16;
  Double3 scanner_;
  PairChoice lines_, cells_;
  std::uint64_t width_;
  bool spread_wants_ = false, grid_wants_ = false;
  EvenSpread spread_;
  std::vector<GridSample> grid_;
};

/// The scans of a file whose poses are left out, as one warning for each reason.
class RefusedPoses {
 public:
  /// \param number  of the scan in the file, from 1   \param scanner  where its pose puts the scanner
  void add(std::size_t number, ScanPose why, const Double3& scanner);
  /// \param scans  that the file has
  void tell(std::size_t scans, std::vector<std::string>& warnings) const;

 private:
  struct Reason {
    std::size_t scans = 0, first = 0;
    Double3 scanner{};
  };
  Reason far_, off_rays_, raster_;
};

}  // namespace tessera
