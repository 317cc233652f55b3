#include "kernels/edit/base_volume.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

using Faces = std::span<const std::array<std::uint32_t, 3>>;

constexpr int kSteps = 8;           ///< of a secant: the volume is a cubic of the widening
constexpr double kMostStretch = 2;  ///< of areas

}  // namespace

double enclosed_volume(std::span<const Double3> p, Faces faces) {
  double sum = 0.0;
  for (const auto& f : faces) sum += dot(p[f[0]] - p[0], cross(p[f[1]] - p[0], p[f[2]] - p[0]));
  return sum / 6.0;
}

std::vector<Double3> volume_widening(const EditBasis& basis, std::span<const Double3> rest,
                                     std::span<const Double3> posed, Faces faces) {
  const std::size_t n = posed.size(), width = basis.width(), first = basis.first_handle();
  std::vector<Double3> by(n, Double3{});
  std::vector<double> before(n, 0.0), after(n, 0.0);
  for (const auto& f : faces) {
    const double was = norm(triangle_normal(rest[f[0]], rest[f[1]], rest[f[2]]));
    const Double3 normal = triangle_normal(posed[f[0]], posed[f[1]], posed[f[2]]);
    for (const std::uint32_t v : f) {
      before[v] += was;
      after[v] += norm(normal);
      by[v] = by[v] + normal;
    }
  }
  std::vector<double> share(n, 0.0);
  for (std::size_t k = 0; k < basis.active.size(); ++k) {
    double all = 0.0, spread = 0.0;
    for (std::size_t h = 0; h < basis.centre.size(); ++h) {
      const double w = basis.columns[k * width + first + 4 * h + 3];
      all += w;
      spread += w * (1.0 - w);
    }
    const auto v = static_cast<std::size_t>(basis.active[k]);
    const double stretch = before[v] > 0.0 ? std::min(kMostStretch, after[v] / before[v]) : 0.0;
    share[v] = std::max(0.0, spread + all * (1.0 - all)) * stretch * stretch * stretch * stretch;
  }
  for (std::size_t v = 0; v < n; ++v) by[v] = unit_or_zero(by[v]) * share[v];

  const double wanted = enclosed_volume(rest, faces);
  std::vector<Double3> moved(n);
  const auto missing = [&](double s) {
    for (std::size_t v = 0; v < n; ++v) moved[v] = posed[v] + by[v] * s;
    return wanted - enclosed_volume(moved, faces);
  };
  double reach = 0.0;
  for (std::size_t v = 0; v < n; ++v) reach = std::max(reach, norm(posed[v] - posed[0]));
  double s = 0.0, m = missing(0.0), next = 1e-3 * reach;
  for (int step = 0; step < kSteps && m != 0.0; ++step) {
    const double then = missing(next);
    if (then == m) break;
    const double to = next - then * (next - s) / (then - m);
    s = next;
    m = then;
    if (!std::isfinite(to) || std::fabs(to) > reach) break;
    next = to;
  }
  // Nothing to widen, or no widening does: as it is.
  if (std::fabs(m) > 1e-6 * std::fabs(wanted)) s = 0.0;
  for (Double3& b : by) b = b * s;
  return by;
}

}  // namespace tessera
