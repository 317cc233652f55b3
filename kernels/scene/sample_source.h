/// \file sample_source.h
/// Where simulated points come from, cut into units that can be made in any order: direct sampling of the
/// surface, or a sensor that looks at it. The points of a unit depend on nothing but the source and the
/// unit's number.
#pragma once
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "kernels/scene/scene.h"

namespace tessera::synth {

/// Points of one unit, in order.
struct SampleBatch {
  SurfaceBatch surface;  ///< exact; NaN position = the ray saw nothing (only where gaps are asked for)
  std::vector<double> dx, dy, dz;  ///< direction of range noise; empty = the normals
  std::vector<std::uint64_t> key;  ///< names the point: what its random numbers hang on
  std::uint64_t flying = 0;        ///< points between two surfaces that a wide beam hit at once
};

/// One set-up of the sensor.
struct ScanInfo {
  Double3 origin{};                     ///< of the sensor (airborne: middle of the line)
  std::uint64_t columns = 0, rows = 0;  ///< grid of rays; 0 where there is none
  std::uint64_t first_unit = 0, units = 0;
};

class SampleSource {
 public:
  virtual ~SampleSource() = default;
  [[nodiscard]] virtual std::uint64_t unit_count() const = 0;
  virtual void sample(std::uint64_t unit, SampleBatch& out) const = 0;
  /// Set-ups in the order of their units; one pseudo scan for direct sampling.
  [[nodiscard]] virtual const std::vector<ScanInfo>& scans() const = 0;
  /// Area of the truth surface, 0 where unknown (sensors).
  [[nodiscard]] virtual double area() const = 0;
  /// Mean distance of neighbouring samples: sqrt(area / points), or the median over a sensor's rays of the
  /// side of the square that one ray stands for on the surface.
  [[nodiscard]] virtual double spacing() const = 0;
};

enum class SensorKind { kTerrestrial, kAirborne, kStructuredLight };

struct SensorOptions {
  SensorKind kind = SensorKind::kTerrestrial;
  std::uint64_t points = 1000000;  ///< aimed at; kept to a few percent
  double spacing = 0.0;            ///< > 0 replaces `points`
  int views = 0;                   ///< set-ups; 0 = the scene's own or a usual number for the kind
  double flying = 0.1;  ///< share of range jumps between neighbouring rays that give a flying point
  bool gaps = false;    ///< keep rays that saw nothing, as NaN
  std::uint64_t seed = 1;
};

/// Direct sampling. Exact number of points for scenes with patches(), else (rows of axis-parallel rays, each
/// keeping the hits that it meets most squarely) within a few percent and up to 1.7 times thinner on oblique
/// faces.
/// \pre points > 0; the scene outlives the source
[[nodiscard]] std::unique_ptr<SampleSource> sample_surface(const Scene& scene, std::uint64_t points,
                                                           std::uint64_t seed);
/// Number of points that direct sampling needs for a mean spacing.
[[nodiscard]] std::uint64_t points_for_spacing(const Scene& scene, double spacing);
[[nodiscard]] std::unique_ptr<SampleSource> sample_by_sensor(const Scene& scene,
                                                             const SensorOptions& options);

}  // namespace tessera::synth
