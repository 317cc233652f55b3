/// \file coarse_layer.h
/// An even coarse copy of the part of a surface that is free to move: where displacement volumes grow before the surface itself
/// follows. Source of the idea: Botsch, thesis 5.4.2 (a hierarchy, so that few rounds do on every level).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

struct CoarseLayer {
  std::vector<Double3> surface;  ///< k
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint8_t> free;  ///< k flags; its border is never free
  /// k: the corners of the face of the fine surface that each vertex stands on, and their weights.
  std::vector<std::array<std::uint32_t, 3>> on;
  std::vector<std::array<double, 3>> weight;

  /// Values of the fine vertices at the coarse ones.
  [[nodiscard]] std::vector<Double3> at(std::span<const Double3> fine) const;
};

/// Remeshes the faces that touch a free vertex; creases stay. Faces at edges that are no manifold's are left out.
/// \param wanted_faces  about so many result
/// \return without faces where nothing is left to remesh
[[nodiscard]] CoarseLayer coarse_layer(std::span<const Double3> surface,
                                       std::span<const std::array<std::uint32_t, 3>> faces,
                                       std::span<const std::uint8_t> free, std::size_t wanted_faces);

}  // namespace tessera
