/// \file displacement_volumes.h
/// Details as volumes: every face spans a prism over a smooth base, and in a pose keeps the volume of its prism.
/// Source: Botsch and Kobbelt, "Multiresolution Surface Representation Based on Displacement Volumes", 2003; Botsch, thesis
/// 5.4. As there the layer grows from a thin one, which cannot fold, by volume scales; in between the surface relaxes towards
/// the edges that it had at rest, and ratios of heights are evened out. Three changes: a prism takes the shortest way to its
/// volume (a projection, Gauss-Seidel) instead of a gradient descent; volumes of a scale are those of the layer at rest with
/// its heights scaled, so that every scale has an exact answer at rest; and growth is on an even coarse copy (layer_levels.h),
/// whose displacements the finer levels take over before a few rounds of their own. What volumes lack over some rings of faces,
/// and single prisms would pass on only sweep by sweep, is made up for by heights at once. Fixed numbers of rounds, in an order that
/// hangs on the faces alone.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/edit/layer_levels.h"
#include "kernels/edit/layer_relaxation.h"

namespace tessera {

struct DisplacementVolumeOptions {
  int scales = 8;          ///< of volumes, from 1 / scales to 1
  int coarse_rounds = 12;  ///< on each of them: all prisms, then the filters
  int rounds = 4;          ///< of the surface itself
  int last_sweeps = 8;     ///< over prisms alone, in the end
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

/// A pose of a layer.
struct PosedLayer {
  Layer rest;
  Layer posed;  ///< its surface is where displacement vectors lead: what is not free stays there
  PrismFaces faces;
  std::span<const std::uint8_t> free;  ///< n flags
  std::span<const Rotation> rotation;  ///< n, read where free: how the base turns
  /// n, by which posed.base falls short of its volume (base_volume.h): the layer gains those prisms; or empty.
  std::span<const Double3> widening{};
};

/// \param levels  layer_levels() of rest.surface; empty: the surface itself grows
/// \return n: the surface over posed.base whose prisms have nearly the volumes of `rest`; at rest the surface itself
std::vector<Double3> displacement_volumes(const PosedLayer& layer, std::span<const LayerLevel> levels,
                                          const DisplacementVolumeOptions& options,
                                          DisplacementVolumeReport& report);

/// Upper bound of what displacement_volumes() allocates for a surface of so many faces, beside its levels.
[[nodiscard]] std::uint64_t displacement_volume_bytes(std::uint64_t faces);

}  // namespace tessera
