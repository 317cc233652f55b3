/// \file orient_tally.h
/// Who decided the sign of every patch, counted for the report, and the decisions themselves.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <span>

#include "kernels/points/orientation.h"
#include "stream/files/json.h"
#include "stream/points/point_overlay.h"

namespace tessera {

enum class Decider : std::uint8_t { kSeen, kPropagation, kVisibility, kUncertain };

inline double share_of(std::uint64_t part, std::uint64_t all) {
  return all == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(all);
}

class OrientationTally {
 public:
  /// \param component  patches that votes of points, sensors or up join
  void add(const PatchStats& stats, int sign, std::uint64_t component);
  /// Appends the decision of the next patch.
  void decide(const PatchStats& stats, int sign, Decider decider, OverlayDecisions& decisions);
  /// Points of a brick whose patches are in doubt: those that show a side, strewn ones apart.
  /// \param decided  PatchDecision bits of the brick's patches
  void add_doubt(std::span<const PointOverlayRecord> points, std::span<const std::uint8_t> decided,
                 const OverlayDecisions& decisions);
  /// Entry gets: patches, components, points by who decided (`decided`), uncertain_points and _fraction of points on a surface,
  /// uncertain_strewn_points and _fraction; and where given normals were kept aside, `agreement` with them (`near_axis`: with
  /// those within 60 degrees of the plane's axis, `uncertain`: of patches in doubt).
  /// \param all_points  of the scan, with those that have no patch
  void write(std::uint64_t all_points, Json& entry) const;

 private:
  struct Agreement {
    std::uint64_t agree = 0;
    std::uint64_t disagree = 0;
  };
  std::uint64_t patches_ = 0;
  std::map<std::uint64_t, Agreement> by_component_;
  Agreement near_, uncertain_;
  std::array<std::uint64_t, 3> decided_{};
  std::uint64_t doubtful_ = 0, doubtful_strewn_ = 0;
};

}  // namespace tessera
