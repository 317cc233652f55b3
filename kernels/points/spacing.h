/// \file spacing.h
/// How dense and how noisy a scan is, measured in small complete pieces of it.
/// Sources: plane and quadric fits of local neighbourhoods (Hoppe et al. 1992; Cazals and Pouget 2005). The
/// quantiles come from trials on range scans: with them 1.5 spacings are 0.78 mm for bunny-raw and 0.43 mm
/// for happy-raw, where 0.7 mm and 0.4 mm are known to be good.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// Histogram of positive numbers, 64 bins per octave, integer counts: the order of adding changes nothing.
class ScaleHistogram {
 public:
  void add(double value) { ++bins_[bin_of(value)], ++total_; }
  std::uint64_t count() const { return total_; }
  /// Centre of the bin that holds the quantile, within 0.8 % of it; 0 without values.
  double quantile(double share) const;

 private:
  static std::uint32_t bin_of(double value);
  std::map<std::uint32_t, std::uint64_t> bins_;
  std::uint64_t total_ = 0;
};

/// A cube of the scan with all its points, no position twice, in an order that follows from the points alone.
struct SampleCell {
  Double3 min{};
  double size = 0.0;
  std::span<const Double3> points;
};

/// Neighbour ranks at which distances are measured.
inline constexpr std::array<int, 4> kSpacingRanks = {1, 4, 8, 16};

struct SpacingHistograms {
  std::array<ScaleHistogram, kSpacingRanks.size()> distance;  ///< to the k-th neighbour
  ScaleHistogram residual;                                    ///< standard deviation from a local quadric
};

/// Distances from points in the middle half of the cell to their k-th neighbours; at most a quarter of its
/// size can be measured, what is farther counts as that. Cells with fewer than 9 points tell of outliers and
/// are left out.
void measure_distances(const SampleCell& cell, SpacingHistograms& out);

/// Residuals of quadrics fitted to the points within `radius` of points in the middle half of the cell, where
/// there are at least 12.
/// \pre radius <= cell.size / 4
void measure_residuals(const SampleCell& cell, double radius, SpacingHistograms& out);

/// What is concluded from the histograms, in their unit. Zero: not measured.
struct SpacingSummary {
  /// Distance to the next sample. Merged scans overlap many times, so the nearest neighbour says nothing
  /// about coverage: half the 95 % quantile of the distance to the 8th one (equal to the spacing of a uniform
  /// random sample), but at least the median nearest distance (equal to the spacing of a grid).
  double spacing = 0.0;
  /// 95 % quantile of the distance to the 4th neighbour; a support must reach 2.5 times it.
  double gap = 0.0;
  double noise = 0.0;     ///< lower quartile of the residual: curvature and features only add to noise
  double residual = 0.0;  ///< median residual
};
SpacingSummary summarise(const SpacingHistograms& measured);

}  // namespace tessera
