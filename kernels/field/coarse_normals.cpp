#include "kernels/field/coarse_normals.h"

#include <cmath>

namespace tessera {
namespace {

/// Length of the mean of unit normals below which a block's normals disagree.
constexpr float kDisagree = 0.7f;

}  // namespace

PointBlock average_normals(const PointBlock& points) {
  PointBlock out;
  out.origin = points.origin;
  out.cells = points.cells;
  const std::size_t n = points.size();
  const auto block_of = [](float v) { return std::floor(v * 0.5f); };
  for (std::size_t begin = 0; begin < n;) {
    const float bx = block_of(points.x[begin]), by = block_of(points.y[begin]),
                bz = block_of(points.z[begin]);
    // Positions relative to the block: the same floats whatever the origin of the points.
    float px = 0.0f, py = 0.0f, pz = 0.0f, nx = 0.0f, ny = 0.0f, nz = 0.0f, count = 0.0f;
    std::size_t end = begin;
    for (; end < n; ++end) {
      const float x = points.x[end] - 2.0f * bx, y = points.y[end] - 2.0f * by, z = points.z[end] - 2.0f * bz;
      if (x < 0.0f || y < 0.0f || z < 0.0f || x >= 2.0f || y >= 2.0f || z >= 2.0f) break;
      if (points.nx[end] == 0.0f && points.ny[end] == 0.0f && points.nz[end] == 0.0f) continue;
      px += x;
      py += y;
      pz += z;
      nx += points.nx[end];
      ny += points.ny[end];
      nz += points.nz[end];
      count += 1.0f;
    }
    const float length = std::sqrt(nx * nx + ny * ny + nz * nz);
    if (count > 0.0f) {
      float scale = length > 0.0f ? 1.0f / (length * std::sqrt(count)) : 0.0f;
      if (length < kDisagree * count) {
        float least = 2.0f, lx = 0.0f, ly = 0.0f, lz = 0.0f;
        for (std::size_t p = begin; p < end; ++p) {
          const float d = points.nx[p] * nx + points.ny[p] * ny + points.nz[p] * nz;
          if (d >= least * count || (points.nx[p] == 0.0f && points.ny[p] == 0.0f && points.nz[p] == 0.0f))
            continue;
          least = d / count;
          lx = points.nx[p];
          ly = points.ny[p];
          lz = points.nz[p];
        }
        nx = lx;
        ny = ly;
        nz = lz;
        scale = 0.5f;
      }
      const auto quantum = [&](float sum, float corner) {
        return std::floor(sum / count * static_cast<float>(kQuantaPerCell) + 0.5f) /
                   static_cast<float>(kQuantaPerCell) +
               2.0f * corner;
      };
      out.x.push_back(quantum(px, bx));
      out.y.push_back(quantum(py, by));
      out.z.push_back(quantum(pz, bz));
      out.nx.push_back(nx * scale);
      out.ny.push_back(ny * scale);
      out.nz.push_back(nz * scale);
    }
    begin = end;
  }
  return out;
}

}  // namespace tessera
