#include "kernels/certify/tolerance_filter.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "octree/vector.h"

namespace tessera {

ToleranceFilterReport filter_by_volume(const ToleranceVolume& volume, TexturePrecision precision,
                                       ToleranceRaster& raster, std::span<const Double3> corners,
                                       const ToleranceFilterOptions& options,
                                       std::vector<ToleranceVerdict>& verdict) {
  ToleranceFilterReport report;
  verdict.assign(corners.size() / 3, ToleranceVerdict::kDoubt);
  std::vector<std::uint32_t> open(verdict.size());
  std::vector<float> median(verdict.size());
  for (std::size_t i = 0; i < open.size(); ++i) {
    open[i] = static_cast<std::uint32_t>(i);
    median[i] = static_cast<float>(longest_median(corners[3 * i], corners[3 * i + 1], corners[3 * i + 2]) *
                                   (1.0 + 0x1p-20));
  }
  const double outside = volume.outside_above(precision, raster.hardware_filter());
  GridTriangles triangles;
  std::vector<float> value;
  for (int side = options.first_per_side; side <= options.most_per_side && !open.empty(); side *= 2) {
    triangles.clear();
    std::vector<std::uint32_t> now, later;
    for (const std::uint32_t i : open) {
      // Too coarse to be accepted even at distance zero: left for a finer round, but a far one may fail
      // already.
      const bool hopeless = sample_delta(static_cast<double>(median[i]), side) >= 0.5 * volume.tolerance();
      if (hopeless && side > options.first_per_side && side * 2 <= options.most_per_side) {
        later.push_back(i);
        continue;
      }
      now.push_back(i);
      triangles.add(volume.to_grid(corners[3 * i]), volume.to_grid(corners[3 * i + 1]),
                    volume.to_grid(corners[3 * i + 2]));
    }
    value.resize(now.size());
    raster.largest(triangles, side, value);
    report.samples += now.size() * static_cast<std::uint64_t>(side * (side + 1) / 2);
    for (std::size_t k = 0; k < now.size(); ++k) {
      const double most = static_cast<double>(value[k]) * volume.spacing();
      const double delta = sample_delta(static_cast<double>(median[now[k]]), side);
      if (most <= volume.inside_below(delta, precision, raster.hardware_filter())) {
        verdict[now[k]] = ToleranceVerdict::kInside;
        ++report.inside;
      } else if (most > outside) {
        verdict[now[k]] = ToleranceVerdict::kOutside;
        ++report.outside;
      } else {
        later.push_back(now[k]);
      }
    }
    open = std::move(later);
  }
  report.doubt = open.size();
  return report;
}

PermissionGrid::PermissionGrid(const Box3& box, const ClosestFaces& reference, double tolerance,
                               double spacing)
    : spacing_(spacing) {
  std::size_t count = 1;
  for (std::size_t k = 0; k < 3; ++k) {
    low_[k] = box.low[k] - spacing;
    cells_[k] = static_cast<std::int32_t>(std::ceil((box.high[k] - box.low[k]) / spacing)) + 2;
    count *= static_cast<std::size_t>(cells_[k]);
  }
  bits_.assign((count + 63) / 64, 0);
  // A cell stays within the tolerance when its centre does by half a diagonal more. Only cells near a
  // triangle can.
  const double limit = tolerance - 0.86602540378443871 * spacing;
  if (limit <= 0.0) return;
  std::size_t n = 0;
  std::uint32_t hint = ClosestFaces::kNone;
  for (int k = 0; k < cells_[2]; ++k)
    for (int j = 0; j < cells_[1]; ++j)
      for (int i = 0; i < cells_[0]; ++i, ++n) {
        const std::array<int, 3> at = {i, j, k};
        Double3 centre;
        for (std::size_t c = 0; c < 3; ++c)
          centre[c] = low_[c] - reference.origin()[c] + (at[c] + 0.5) * spacing;
        const ClosestFaces::Hit hit = reference.closest(centre, limit * limit, hint);
        if (hit.slot == ClosestFaces::kNone) continue;
        hint = hit.slot;
        bits_[n / 64] |= std::uint64_t{1} << (n % 64);
      }
}

bool PermissionGrid::cell(int i, int j, int k) const {
  if (i < 0 || j < 0 || k < 0 || i >= cells_[0] || j >= cells_[1] || k >= cells_[2]) return false;
  const std::size_t n =
      (static_cast<std::size_t>(k) * static_cast<std::size_t>(cells_[1]) + static_cast<std::size_t>(j)) *
          static_cast<std::size_t>(cells_[0]) +
      static_cast<std::size_t>(i);
  return bits_[n / 64] >> (n % 64) & 1;
}

bool PermissionGrid::permits(const Double3& p) const {
  return cell(static_cast<int>(std::floor((p[0] - low_[0]) / spacing_)),
              static_cast<int>(std::floor((p[1] - low_[1]) / spacing_)),
              static_cast<int>(std::floor((p[2] - low_[2]) / spacing_)));
}

bool PermissionGrid::permits(const Double3& a, const Double3& b, const Double3& c) const {
  // Every cell of the triangle's box whose cube the plane of the triangle may cross.
  Int3 first{}, last{};
  for (std::size_t k = 0; k < 3; ++k) {
    first[k] = static_cast<std::int32_t>(std::floor((std::min({a[k], b[k], c[k]}) - low_[k]) / spacing_));
    last[k] = static_cast<std::int32_t>(std::floor((std::max({a[k], b[k], c[k]}) - low_[k]) / spacing_));
  }
  Double3 u, v;
  for (std::size_t k = 0; k < 3; ++k) u[k] = b[k] - a[k], v[k] = c[k] - a[k];
  const Double3 n = cross(u, v);
  const double radius = 0.5 * spacing_ * (std::abs(n[0]) + std::abs(n[1]) + std::abs(n[2])) * (1.0 + 0x1p-40);
  for (int k = first[2]; k <= last[2]; ++k)
    for (int j = first[1]; j <= last[1]; ++j)
      for (int i = first[0]; i <= last[0]; ++i) {
        const Double3 centre = {low_[0] + (i + 0.5) * spacing_, low_[1] + (j + 0.5) * spacing_,
                                low_[2] + (k + 0.5) * spacing_};
        const double height =
            n[0] * (centre[0] - a[0]) + n[1] * (centre[1] - a[1]) + n[2] * (centre[2] - a[2]);
        if (std::abs(height) <= radius && !cell(i, j, k)) return false;
      }
  return true;
}

}  // namespace tessera
