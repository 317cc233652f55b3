/// \file displacement_volumes.h
/// Details as volumes: every face spans a prism over a smooth base, and in a pose keeps the volume of its prism.
/// Source: Botsch and Kobbelt, "Multiresolution Surface Representation Based on Displacement Volumes", 2003; Botsch, thesis
/// 5.4. From where displacement vectors lead, every prism in turn takes the shortest way to its volume (a projection,
/// Gauss-Seidel, instead of the thesis's gradient descent); in between ratios of heights are evened out. A fixed number of sweeps, in
/// the order of the faces. Without the thesis's growth from a thin layer: where vectors fold over, this does not unfold them.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

using PrismFaces = std::span<const std::array<std::uint32_t, 3>>;

/// A surface over its base, one point of the base for each vertex.
struct Layer {
  std::span<const Double3> base;
  std::span<const Double3> surface;
};

struct DisplacementVolumeOptions {
  int rounds = 8;        ///< of sweeps over all prisms, then one step of the filter of heights
  int sweeps = 4;        ///< in each of them
  int last_sweeps = 16;  ///< over prisms alone, in the end
};

struct DisplacementVolumeReport {
  std::size_t prisms = 0;
  /// Sum of what volumes are off by, as a share of the sum of all volumes: of the surface given, and of the result.
  double off_before = 0.0, off_after = 0.0;
  double volume_before = 0.0, volume_after = 0.0;  ///< of the whole layer over that at rest
};

/// Volume of the prism between a face and its base, sides split at their centroids; below zero under the base.
double prism_volume(const std::array<Double3, 3>& base, const std::array<Double3, 3>& top);

/// \param rest   n
/// \param posed  its surface is where displacement vectors lead: what is not `free` stays there
/// \param free   n flags
/// \return n: the surface over posed.base whose prisms have nearly the volumes of `rest`; at rest the surface itself
std::vector<Double3> displacement_volumes(const Layer& rest, const Layer& posed, PrismFaces faces,
                                          std::span<const std::uint8_t> free,
                                          const DisplacementVolumeOptions& options,
                                          DisplacementVolumeReport& report);

}  // namespace tessera
