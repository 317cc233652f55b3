/// \file base_volume.h
/// What a smooth base loses of its volume where a pose bends it, and how much wider it would have to be.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/edit/edit_basis.h"

namespace tessera {

/// Volume that faces enclose; of an open surface as if its border were joined to vertex 0.
double enclosed_volume(std::span<const Double3> position,
                       std::span<const std::array<std::uint32_t, 3>> faces);

/// Whether every edge has as many faces one way as the other: there is a volume.
[[nodiscard]] bool encloses_volume(std::span<const std::array<std::uint32_t, 3>> faces);

/// By how much every vertex of the posed base lies too far inside, along its normals, for the base to enclose what it did at
/// rest. A linear solution between two handles is a mean of their motions, and the mean of two rotations is narrower than
/// either: by w (1 - w) for weights w, which is how it is spread here, besides the fourth power of how the base is stretched:
/// where a bend presses it together there is no room. \return n; zero outside of the support
[[nodiscard]] std::vector<Double3> volume_widening(const EditBasis& basis, std::span<const Double3> rest,
                                                   std::span<const Double3> posed,
                                                   std::span<const std::array<std::uint32_t, 3>> faces);

}  // namespace tessera
