/// \file displacement_volumes.h
/// Details as volumes: every face spans a prism over a smooth base, and in a pose keeps the volume of its prism.
/// Source: Botsch and Kobbelt, "Multiresolution Surface Representation Based on Displacement Volumes", 2003; Botsch, thesis
/// 5.4. As there the layer grows from a thin one, which cannot fold, by volume scales; in between the surface relaxes towards
/// the edges that it had at rest, and ratios of heights are evened out. Three changes: a prism takes the shortest way to its
/// volume (a projection, Gauss-Seidel) instead of a gradient descent; volumes of a scale are those of the layer at rest with
/// its heights scaled, so that every scale has an exact answer at rest; and growth is on an even coarse copy (coarse_layer.h),
/// whose displacements the finer levels take over before a few rounds of their own. Fixed numbers of rounds, in the order of faces.
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
  std::size_t coarse_faces = 3000;  ///< of the copy that grows; 0 = the surface itself grows
  int scales = 8;                   ///< of volumes, from 1 / scales to 1
  int coarse_rounds = 16;           ///< on each of them: all prisms, then the filters
  int rounds = 4;                   ///< of the surface itself
  int last_sweeps = 40;             ///< over prisms alone, in the end
};

struct DisplacementVolumeReport {
  std::size_t prisms = 0;
  /// Sum of what volumes are off by, as a share of the sum of all volumes: of the surface given, and of the result.
  double off_before = 0.0, off_after = 0.0;
  double volume_before = 0.0, volume_after = 0.0;  ///< of the whole layer over what it should be
  std::size_t levels = 0;
};

/// Volume of the prism between a face and its base, sides ruled (the mean of both ways to split them, as with a split at
/// centroids); below zero under the base.
double prism_volume(const std::array<Double3, 3>& base, const std::array<Double3, 3>& top);

/// \param rest   n
/// \param posed  its surface is where displacement vectors lead: what is not `free` stays there
/// \param free   n flags
/// \param widening  n, by which posed.base falls short of its volume (base_volume.h): the layer gains those prisms; or empty
/// \return n: the surface over posed.base whose prisms have nearly the volumes of `rest`; at rest the surface itself
std::vector<Double3> displacement_volumes(const Layer& rest, const Layer& posed, PrismFaces faces,
                                          std::span<const std::uint8_t> free,
                                          std::span<const Double3> widening,
                                          const DisplacementVolumeOptions& options,
                                          DisplacementVolumeReport& report);

}  // namespace tessera
