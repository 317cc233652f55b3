#include "kernels/survey/point_raster.h"

#include <algorithm>
#include <cmath>

namespace tessera {

double cell_index(double x, double cell) {
  double k = std::floor(x / cell);
  // A quotient may round across a whole number.
  if (k * cell > x) --k;
  if ((k + 1.0) * cell <= x) ++k;
  return k;
}

std::uint32_t ScanCell::rgba() const {
  if (coloured == 0) return 0;
  std::uint32_t out = 0xffu << 24;
  const std::uint64_t sums[3] = {red, green, blue};
  for (unsigned band = 0; band < 3; ++band)
    out |= static_cast<std::uint32_t>((sums[band] + coloured / 2) / coloured) << (8 * band);
  return out;
}

void PointRaster::add(std::size_t cell, double z, bool ground) {
  const double height = z + 0.0;  // no negative zero
  ScanCell& c = cells_[cell];
  ++c.count;
  c.top = std::max(c.top, height);
  if (ground) c.ground = std::min(c.ground, height);
}

void PointRaster::add_seen(std::size_t cell, double z, std::uint32_t rgba, std::int32_t intensity) {
  ScanCell& c = cells_[cell];
  if (c.top - z > depth_) return;
  if (rgba >> 24 != 0) {
    c.red += rgba & 0xff, c.green += rgba >> 8 & 0xff, c.blue += rgba >> 16 & 0xff;
    ++c.coloured;
  }
  if (intensity >= 0) c.intensity_sum += static_cast<std::uint64_t>(intensity), ++c.measured;
}

}  // namespace tessera
