/// \file layer_levels.h
/// Coarser and coarser copies of a surface for displacement volumes, each with what the finer one stands on: found once for all
/// poses. Source of the idea: Botsch, thesis 5.4.2 (a hierarchy, so that few rounds do on every level).
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/edit/coarse_layer.h"
#include "kernels/edit/normal_displacement.h"

namespace tessera {

struct LayerLevel {
  CoarseLayer coarse;
  /// Of the vertices of the finer surface over this one, read where they are free.
  NormalDisplacements finer;
};

/// \param coarse_faces  of the coarsest copy; others have four times as many as the one below
/// \return finest first; empty where nothing is left to remesh
[[nodiscard]] std::vector<LayerLevel> layer_levels(std::span<const Double3> surface,
                                                   std::span<const std::array<std::uint32_t, 3>> faces,
                                                   std::span<const std::uint8_t> free,
                                                   std::size_t coarse_faces = 1000);

/// Upper bound of what layer_levels() allocates for a surface of so many faces.
[[nodiscard]] std::uint64_t layer_levels_bytes(std::uint64_t faces);

}  // namespace tessera
