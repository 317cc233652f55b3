/// \file thin_body.h
/// How much of a surface bounds bodies thinner than a width: wires and sheets, which no even base of edges about as long can follow.
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "octree/vector.h"

namespace tessera {

/// Share of the area in cells of a lattice, `width` wide, in which normals cancel each other: both sides of a body lie there.
/// \param width  > 0 \cost  a sample for each quarter of a square width, and for each face
double thin_body_share(std::span<const Double3> position, std::span<const std::array<std::uint32_t, 3>> faces,
                       double width);

}  // namespace tessera
