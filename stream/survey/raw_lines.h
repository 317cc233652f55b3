/// \file raw_lines.h
/// Lines on their way to `tessera-gdal`: each a RawLine and its points behind it, three doubles each.
#pragma once
#include <cstdint>

namespace tessera {

struct RawLine {
  double value = 0.0;        ///< elevation of a contour line, station or height of a section
  std::uint32_t index = 0;   ///< 1 for index lines; number of the section
  std::uint32_t closed = 0;  ///< then the first point is not repeated
  std::uint64_t count = 0;   ///< points
};
static_assert(sizeof(RawLine) == 24);

}  // namespace tessera
