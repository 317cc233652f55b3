/// \file normals_mode.h
/// Which way a job gets its normals and signs: decided once from options and plan, shared by both stages.
#pragma once
#include <limits>

#include "kernels/points/normal_agreement.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "stream/points/normal_sample.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"

namespace tessera {

/// Supporter counts from here on share the last bin.
inline constexpr std::size_t kSupporterBins = 256;
/// Histogram of supporters over all points, and behind it the number of strewn ones, left by the normals stage for the
/// orient stage.
inline constexpr const char* kSupportersFile = "normals/supporters.bin";

/// Share of points from pulses of several returns from which a scan is airborne: terrestrial ones tell of one.
inline constexpr double kAirborneReturns = 0.01;

/// Share of points with normals from which these are used instead of estimated ones. Samples at outlines and on rough ground
/// have none from rows and columns, and surface without normals is lost.
inline constexpr double kGivenShare = 0.5, kGridShare = 0.9;
/// Share of points with given normals below which the others get estimated ones: a few do not leave holes.
inline constexpr double kCompleteShare = 0.95;
/// Share of neighbours with contradicting normals from which given sides are not believed, and how many places at the
/// border of a region that is turned over: scans with a common side have up to 0.003, and none.
inline constexpr double kMaxConflict = 0.005;
inline constexpr std::uint64_t kMaxSplits = 2;

struct NormalsMode {
  bool estimate = false;    ///< fit planes; false = the given normals are used
  bool by_sensor = false;   ///< sensor origins are known
  bool own_sensor = false;  ///< and every point knows which one saw it
  bool airborne = false;    ///< every pulse came from above: what does not stand steep shows up
  bool by_up = false;       ///< the user says where the sky is
  Double3 up{};             ///< unit
  bool clean = false;       ///< outliers are looked for
  bool conflict = false;    ///< given normals contradict each other
  bool lines =
      false;  ///< given normals keep their directions, up to sign: sides are found as for estimated ones
  bool completes =
      false;  ///< given normals stay, and points without one get an estimated one that follows them

  /// \throws UsageError when normals are demanded that the input does not carry, or are used where they exclude an option
  NormalsMode(const ReconstructOptions& options, std::size_t inputs, const Plan& plan,
              const NormalAgreement& agreement)
      : by_sensor(!plan.sensors.empty()),
        own_sensor(options.viewpoints.size() <= 1 || options.viewpoints.size() == inputs),
        airborne(!by_sensor && (options.from == "auto" || options.from == "above") &&
                 plan.multi_return_fraction > kAirborneReturns),
        by_up(options.up.has_value()),
        up(unit(options.up.value_or(Double3{0, 0, 1}))),
        clean(options.outliers != "off") {
    if (options.normals == "given" && !plan.has_normals())
      throw UsageError("--normals given, but no input point carries a normal; use --normals auto");
    const double minimum = plan.grid_normals ? kGridShare : kGivenShare;
    estimate = options.normals == "estimate" || (options.normals == "auto" && plan.normal_fraction < minimum);
    conflict =
        !estimate && !plan.grid_normals && (agreement.share() > kMaxConflict || agreement.split > kMaxSplits);
    if (options.normals != "given" && !estimate && !plan.grid_normals) {
      lines = conflict;
      completes = !lines && plan.normal_fraction < kCompleteShare;
      estimate = lines || completes;
    }
    if (options.surface != "all" && !estimate)
      throw UsageError("--surface " + options.surface +
                       ": the normals of the scan are used, and the surface model comes with estimated ones; "
                       "give --normals estimate");
  }

  bool needed() const { return estimate || clean; }
  bool propagate() const { return estimate; }
  bool keeps_given() const { return lines || completes; }
  /// Points know where they were seen from, or which side they show.
  bool each_seen() const { return airborne || completes || (by_sensor && own_sensor); }

  /// Direction from a point to its sensor; the nearest one when the point does not say which.
  /// \param origin  brick corner in cells   \param local  point relative to it, cells
  Double3 view(const Plan& plan, const Int3& origin, const Float3& local, std::uint16_t sensor) const {
    Double3 at{};
    for (std::size_t a = 0; a < 3; ++a)
      at[a] = plan.lattice.world(static_cast<int>(a), double{local[a]} + origin[a]);
    const auto from = [&](std::size_t s) {
      return Double3{plan.sensors[s][0] - at[0], plan.sensors[s][1] - at[1], plan.sensors[s][2] - at[2]};
    };
    if (sensor < plan.sensors.size()) return from(sensor);
    Double3 best = from(0);
    double minimum = std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < plan.sensors.size(); ++s) {
      const Double3 v = from(s);
      const double d = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
      if (d < minimum) minimum = d, best = v;
    }
    return best;
  }
};

}  // namespace tessera
