/// \file sheets.h
/// Sharp local surface: up to four smooth sheets joined by minimum and maximum, so that creases, corners,
/// thin slabs and thin gaps keep the signs, roots and normals of their exact faces. Source: Ohtake, Belyaev,
/// Alexa, Turk, Seidel, "Multi-level Partition of Unity Implicits", 2003, section 3.3 (piecewise quadratic
/// functions). Changes: sheets come from clustering the normals and are merged again where one continues the
/// other; each is a quadric fitted to positions and normals; any mix of convex and concave joints that can be
/// written as nested minima and maxima is kept.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/field/sample_clusters.h"

namespace tessera {

/// f(p) = f0 + g.p + p.H p / 2, p relative to the node; < 0 inside. H = (xx, xy, xz, yy, yz, zz).
struct Sheet {
  float f0 = 0.0f;
  Float3 g = {0, 0, 0};
  std::array<float, 6> h{};
};

/// Signed distance to first order and unit outward normal at a point.
struct SurfaceValue {
  float value = 0.0f;
  Float3 normal = {0, 0, 0};
};

/// The surface around one node.
struct Sheets {
  int count = 0;  ///< 0: no crease here, the smooth fit stands
  std::array<Sheet, kMaxSheets> sheet{};
  /// Joint s: sheet first[s] becomes the minimum or maximum of itself and second[s]; count - 1 joints.
  std::array<std::uint8_t, kMaxSheets - 1> first{}, second{}, convex{};
  Float3 centroid = {0, 0, 0};  ///< of the samples kept, relative to the node
  float spread2 = 0.0f;         ///< their mean squared distance from the centroid
  float separation2 = 0.0f;     ///< least squared chord between two normals over their mean squared residual

  [[nodiscard]] SurfaceValue at(const Float3& p) const;
  /// The part of `direction` along all sheets that pass within `near` of p: at a crease along that, at a corner nothing.
  [[nodiscard]] Float3 along(const Float3& direction, const Float3& p, float near) const;
  /// How many sheets pass within `near` of p.
  [[nodiscard]] int passing(const Float3& p, float near) const;
};

struct SheetOptions {
  float feature_angle = 0.436f;  ///< smallest angle between two sheets, radians
  float cos_feature = 0.906f;    ///< its cosine
  float cos_seed = 0.940f;       ///< cosine of the smallest angle between mean normals that start a cluster
  float noise = 0.0f;            ///< deviation of the samples along the normal, cells
};

/// Splits the samples into sheets. Each sum runs over the samples in canonical order, in eight interleaved
/// partial sums that are joined by a fixed tree: a pure function of the list.
/// \pre samples padded
Sheets fit_sheets(LocalSamples& samples, const NormalSeeds& seeds, const SheetOptions& options);

}  // namespace tessera
