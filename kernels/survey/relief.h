/// \file relief.h
/// Slope and shading of a surface from the rise of its plane. Source: Horn, "Hill Shading and the Reflectance Map", 1981.
/// The same bits on every machine.
#pragma once
#include <cstdint>

#include "octree/vector.h"

namespace tessera {

/// Of a plane that rises by these along x and y: degrees from the horizontal, 0 to 90.
double slope_degrees(double gradient_x, double gradient_y);

/// Unit vector to the sun. \param azimuth  degrees clockwise from north (y) \param altitude  degrees above the horizon
[[nodiscard]] Double3 sun_direction(double azimuth, double altitude);

/// Light that the plane gets: 1 where it is turned away from the sun, up to 255 where it faces it. 0 is left for no data.
[[nodiscard]] std::uint8_t hillshade(double gradient_x, double gradient_y, const Double3& sun);

}  // namespace tessera
