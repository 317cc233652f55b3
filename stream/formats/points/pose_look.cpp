#include "stream/formats/points/pose_look.h"

#include <fmt/format.h>
#include <cmath>

namespace tessera {

void PoseLook::add(std::int64_t line, std::int64_t cell, const Double3& p, bool to_spread, bool to_grid) {
  const Double3 from = p - scanner_;
  if (!std::isfinite(from[0]) || !std::isfinite(from[1]) || !std::isfinite(from[2])) return;
  if (to_spread) spread_.add(from);
  if (to_grid) grid_.push_back({line, cell, from});
}

void RefusedPoses::add(std::size_t number, ScanPose why, const Double3& scanner) {
  Reason& reason = why == ScanPose::kFar ? far_ : why == ScanPose::kRaster ? raster_ : off_rays_;
  if (reason.scans++ == 0) reason.first = number, reason.scanner = scanner;
}

void RefusedPoses::tell(std::size_t scans, std::vector<std::string>& warnings) const {
  const auto sentence = [&](const Reason& r, const char* why) {
    if (r.scans == 0) return;
    const std::string which = r.scans == scans && scans > 1 ? fmt::format("all {} scans", scans)
                              : r.scans > 1
                                  ? fmt::format("{} of {} scans, first scan {}", r.scans, scans, r.first)
                                  : fmt::format("scan {}", r.first);
    warnings.push_back(
        fmt::format("{}: no scanner can have stood at {:.10g} {:.10g} {:.10g}, where the pose puts it: {}; "
                    "the pose is taken for "
                    "none, and sides are found as without a scanner (--viewpoint tells where it stood)",
                    which, r.scanner[0], r.scanner[1], r.scanner[2], why));
  };
  sentence(far_,
           "the points lie too far off for their extent, as world coordinates with the pose of no scan do");
  sentence(off_rays_, "the points of its rows and columns do not lie on rays from there");
  sentence(
      raster_,
      "the points of its rows and columns are spaced evenly in space, as a raster is, not by angles from "
      "there");
}

}  // namespace tessera
