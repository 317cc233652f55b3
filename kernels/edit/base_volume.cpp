#include "kernels/edit/base_volume.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tessera {
namespace {

using Faces = std::span<const std::array<std::uint32_t, 3>>;

constexpr int kSteps = 8;          ///< of Newton's
constexpr double kMaxStretch = 2;  ///< of areas

}  // namespace

double enclosed_volume(std::span<const Double3> p, Faces faces) {
  double sum = 0.0;
  for (const auto& f : faces) sum += dot(p[f[0]] - p[0], cross(p[f[1]] - p[0], p[f[2]] - p[0]));
  return sum / 6.0;
}

bool encloses_volume(Faces faces) {
  std::vector<std::uint64_t> sides, opposite;
  for (const auto& f : faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = f[k], b = f[(k + 1) % 3];
      sides.push_back(a << 32 | b);
      opposite.push_back(b << 32 | a);
    }
  std::sort(sides.begin(), sides.end());
  std::sort(opposite.begin(), opposite.end());
  return sides == opposite;
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
    const double stretch = before[v] > 0.0 ? std::min(kMaxStretch, after[v] / before[v]) : 0.0;
    share[v] = std::max(0.0, spread + all * (1.0 - all)) * stretch * stretch * stretch * stretch;
  }
  for (std::size_t v = 0; v < n; ++v) by[v] = unit_or_zero(by[v]) * share[v];

  // The volume is a cubic of the widening: its coefficients.
  const double wanted = enclosed_volume(rest, faces);
  std::array<double, 4> c = {enclosed_volume(posed, faces), 0.0, 0.0, 0.0};
  for (const auto& f : faces) {
    if (share[f[0]] + share[f[1]] + share[f[2]] == 0.0) continue;
    const Double3 p = posed[f[0]] - posed[0], q = posed[f[1]] - posed[0], r = posed[f[2]] - posed[0];
    const Double3 &u = by[f[0]], &v = by[f[1]], &w = by[f[2]];
    const Double3 qr = cross(q, r), vw = cross(v, w), mixed = cross(v, r) + cross(q, w);
    c[1] += (dot(u, qr) + dot(p, mixed)) / 6.0;
    c[2] += (dot(u, mixed) + dot(p, vw)) / 6.0;
    c[3] += dot(u, vw) / 6.0;
  }
  double extent = 0.0;
  for (std::size_t v = 0; v < n; ++v) extent = std::max(extent, norm(posed[v] - posed[0]));
  const auto missing = [&](double s) { return wanted - (c[0] + s * (c[1] + s * (c[2] + s * c[3]))); };
  double s = 0.0, m = missing(0.0);
  for (int step = 0; step < kSteps && m != 0.0; ++step) {
    const double slope = c[1] + s * (2.0 * c[2] + s * 3.0 * c[3]);
    const double to = s + m / slope;
    if (!std::isfinite(to) || std::fabs(to) > extent) break;
    s = to;
    m = missing(s);
  }
  // Nothing to widen, or no widening does: as it is.
  if (std::fabs(m) > 1e-6 * std::fabs(wanted)) s = 0.0;
  for (Double3& b : by) b = b * s;
  return by;
}

}  // namespace tessera
