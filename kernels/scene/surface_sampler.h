/// \file surface_sampler.h
/// Direct sampling of a truth surface: nearly uniform in area, an exact number of points, any part of which
/// can be made on its own, so that the whole is streamed and the number of threads does not matter.
///
/// Every patch is cut into cells of about 64 samples. A cell gets its share of the points by rounding the
/// running sum of areas; inside it the points follow the R2 additive sequence (Roberts 2018), shifted and
/// jittered per cell.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernels/scene/scene.h"

namespace tessera::synth {

/// Consecutive cells of one row of a patch: the unit of work.
struct SampleSpan {
  std::uint32_t patch = 0;
  std::uint32_t row = 0;
  std::uint32_t first_cell = 0, cells = 0;
  double area_before = 0.0, area_after = 0.0;  ///< running sum over all spans
  std::uint64_t first_point = 0, points = 0;
};

class SurfaceSampler {
 public:
  /// \pre scene.patches() is not empty, points > 0; the scene outlives the sampler
  /// \cost one density evaluation per 64 points; memory 56 bytes per 64k points
  SurfaceSampler(const Scene& scene, std::uint64_t points, std::uint64_t seed);

  double area() const { return area_; }
  double spacing() const { return spacing_; }  ///< sqrt(area / points)
  [[nodiscard]] const std::vector<SampleSpan>& spans() const { return spans_; }
  /// Exactly span.points points, in order.
  void sample(const SampleSpan& span, SurfaceBatch& out) const;

 private:
  struct Grid {
    std::uint32_t rows = 0, columns = 0;
  };
  double cell_area(std::uint32_t patch, std::uint32_t row, std::uint32_t column) const;
  std::uint64_t points_before(double area) const;

  std::vector<const SurfacePatch*> patches_;
  std::vector<Grid> grids_;
  std::vector<SampleSpan> spans_;
  std::uint64_t points_, seed_;
  double area_ = 0.0, spacing_ = 0.0;
};

}  // namespace tessera::synth
