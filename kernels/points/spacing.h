/// \file spacing.h
/// How dense and how noisy a scan is, measured in small complete pieces of it.
/// Sources: plane and quadric fits of local neighbourhoods (Hoppe et al. 1992; Cazals and Pouget 2005). The
/// quantiles come from trials: h is 0.66 mm for bunny-raw, 0.38 mm for happy-raw, 0.53 mm for drill-raw and 0.018 for
/// lion-takanawa, where 0.7 mm, 0.4 mm, 0.58 mm and 0.02 are known to be good.
#pragma once
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// Histogram of positive numbers, 64 bins per octave, integer counts: the order of adding changes nothing.
class ScaleHistogram {
 public:
  void add(double value) { ++bins_[bin_of(value)], ++total_; }
  void add(const ScaleHistogram& other) {
    for (const auto& [bin, count] : other.bins_) bins_[bin] += count;
    total_ += other.total_;
  }
  [[nodiscard]] std::uint64_t count() const { return total_; }
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

/// How far the samples are apart at one place, and how much of the surface that stands for.
struct SpacingProbe {
  /// Half the distance to the 8th neighbour: the spacing of random samples. Merged scans overlap, so the nearest one says
  /// nothing.
  double spacing = 0.0;
  double nearest = 0.0;  ///< distance to that one
  double gap = 0.0;      ///< distance to the 4th neighbour; a support must reach 2.5 times it
  double area = 0.0;
  /// The neighbours lie about a plane, and the probe on it. Points strewn through the air have neighbours all around, or
  /// a surface beside them.
  bool on_surface = true;
  /// The nearest of them do as well. Among points strewn close over a surface all that is in reach lies about a plane too.
  bool flat_nearby = true;
  /// The 8th neighbour is in reach; else the spacing is only known to be above the one that is told.
  bool in_range = true;
  /// Most of the neighbours lie about a plane that the probe is far off: strewn close to the surface, it sees that first and
  /// looks sparser than it.
  bool beside_surface = false;
};

/// Probes at points in the middle half of the cell whose spacing is above `minimum` and at most `maximum`. At most an eighth
/// of the cell's size can be measured, what is wider counts as that. Cells with fewer than 9 points tell of outliers
/// and are left out.
/// \param share  of all cells of this size, how many are looked at
void measure_spacing(const SampleCell& cell, double share, double minimum, double maximum,
                     std::vector<SpacingProbe>& out);

/// Residuals of quadrics fitted to the points within `radius` of points in the middle half of the cell, where
/// there are at least 12: standard deviations.
/// \pre radius <= cell.size / 4
void measure_residuals(const SampleCell& cell, double radius, ScaleHistogram& out);

/// What is concluded, in the unit of the probes; quantiles by area. Zero: not measured.
/// Strewn points are few but far apart, so by area they would outweigh the surface: where probes that are on none and much
/// sparser than the median point claim a notable part of all area, and are most of what is so sparse, only probes count
/// that are known to be about as dense as three of four points on a surface. Probes beside the surface are left out where
/// they are many, by points or by area. Other scans lose none.
/// Spacings are those of the probes, or all of them larger in proportion where the median of the nearest neighbours says
/// so: that is the spacing of a grid.
struct SpacingSummary {
  double dense = 0.0;           ///< spacing: a quarter of the surface is sampled as closely
  double middle = 0.0;          ///< half of it
  double wide = 0.0;            ///< 70 % of it
  double spacing = 0.0;         ///< 90 % of it: what a scan of even density is sampled at
  double gap = 0.0;             ///< 90 % of it
  double noise = 0.0;           ///< lower quartile of the residual: curvature and features only add to noise
  double residual = 0.0;        ///< median residual
  std::uint64_t residuals = 0;  ///< so many were measured: without any, noise is not known
  double outliers =
      0.0;  ///< share of the points that is too sparse for the surface and was left out; mostly 0
};
[[nodiscard]] SpacingSummary summarise_spacing(std::vector<SpacingProbe> probes,
                                               const ScaleHistogram& residual);

/// Scans of fewer points show a whole object: they get a finer lattice.
inline constexpr std::uint64_t kSparseScan = 16384;

/// A lattice spacing and the reason for it, one line.
struct ChosenSpacing {
  double h = 0.0;
  std::string reason;
};
/// One lattice for all of a scan. Even density: one and a half spacings, which keep what the scan holds. Where density
/// varies, finer: 3 times the spacing of the densest quarter of the surface, as long as 70 % of the surface is
/// sampled at 2 h or closer, which the field still closes. Scans of fewer than 16384 points get the lattice that so many would
/// have, down to half: limbs of a few points' width need cells, and cost little. Never below what averages the noise.
/// \param points  of the scan
[[nodiscard]] ChosenSpacing choose_spacing(const SpacingSummary& measured,
                                           std::uint64_t points = std::numeric_limits<std::uint64_t>::max());

}  // namespace tessera
