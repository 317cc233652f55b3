/// \file orient_tally.h
/// Who decided the sign of every patch, counted for the report, and the decisions themselves.
#pragma once
#include <array>
#include <cstdint>
#include <map>

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
  /// Points that `decisions.volumetric` takes out are not in doubt.
  /// \param component  patches that votes of points, sensors or up join
  void add(const PatchStats& stats, int sign, Decider decider, std::uint64_t component,
           OverlayDecisions& decisions);
  /// Entry gets: patches, components, points by who decided (`decided`), uncertain_points and _fraction; and where given
  /// normals were kept aside, `agreement` with them (`near_axis`: with those within 60 degrees of the plane's axis).
  /// \param all_points  of the scan, with those that have no patch
  void write(std::uint64_t all_points, Json& entry) const;

 private:
  struct Agreement {
    std::uint64_t agree = 0;
    std::uint64_t disagree = 0;
  };
  std::uint64_t patches_ = 0;
  std::map<std::uint64_t, Agreement> by_component_;
  Agreement near_;
  std::array<std::uint64_t, 4> decided_{};
};

}  // namespace tessera
