/// \file point_filter.h
/// Which points of a scan are wanted: by class and return of their pulse, by a box, by polygons from above.
#pragma once
#include <bitset>
#include <optional>
#include <string>

#include "stream/formats/points/point_source.h"
#include "stream/points/clip_polygon.h"
#include "stream/points/reconstruct_options.h"

namespace tessera {

inline constexpr std::uint8_t kGroundClass = 2;

class PointFilter {
 public:
  /// Of the options: classes (none = all but noise, 7 and 18), returns (a single return is both first and last), bounds,
  /// clip. \throws UsageError  naming a class that is no number up to 255, or bounds that are no box
  explicit PointFilter(const ReconstructOptions& options);

  /// The chunk, or in `scratch` what is left of it; counts what is not. Points that tell neither class nor return stay,
  /// as far as these go; of several reasons the first counts.
  const PointChunk& apply(const PointChunk& chunk, PointChunk& scratch, ReadCounts& counts) const;

  /// Whether an option leaves points out.
  bool chooses() const { return !requested_classes_.empty() || returns_ != "all" || box_.has_value(); }

  /// All wanted points lie in it, if any box or polygon is given; infinite where nothing limits.
  const std::optional<PointBox>& box() const { return box_; }

  /// For inputs of which none tells classes and returns. \throws UsageError where some are asked for
  void refuse() const;
  /// \throws EmptyError  where nothing is left of points read
  void require_wanted(std::uint64_t read, std::uint64_t left_out) const;

 private:
  bool inside(double x, double y, double z) const;
  std::string requested_region() const;

  std::bitset<256> classes_;
  std::string requested_classes_, requested_bounds_, requested_clip_;  ///< as given
  std::string returns_;
  std::optional<PointBox> box_;
  std::optional<ClipPolygon> clip_;
};

}  // namespace tessera
