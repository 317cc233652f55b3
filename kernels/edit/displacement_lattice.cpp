#include "kernels/edit/displacement_lattice.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr int kOriginSteps = 32;
constexpr double kOriginEnough = 1e-9;  ///< of the spacing

std::size_t finer(std::size_t nodes) {
  return 2 * (nodes - 3) + 3;
}

/// One axis of refine_nodes(), or of its transpose: adds weight * from[.] to to[.] for every pair of the subdivision rule.
/// \param nodes  of the coarse side of this axis  \param add  called with coarse index, fine index and weight
template <class Add>
void for_rule(std::size_t nodes, const Add& add) {
  for (std::size_t fine = 0; fine < finer(nodes); ++fine) {
    const std::size_t i = (fine + 1) / 2;
    if (fine % 2 == 1) {
      add(i - 1, fine, 0.125);
      add(i, fine, 0.75);
      add(i + 1, fine, 0.125);
    } else {
      add(i, fine, 0.5);
      add(i + 1, fine, 0.5);
    }
  }
}

/// \param size  of `from`; that of the axis is replaced by `count` in the result
template <class Rule>
std::vector<Double3> along(const std::vector<Double3>& from, std::array<std::size_t, 3>& size,
                           std::size_t axis, std::size_t count, const Rule& rule) {
  const std::size_t inner = axis == 0 ? 1 : axis == 1 ? size[0] : size[0] * size[1];
  const std::size_t outer = size[0] * size[1] * size[2] / (inner * size[axis]);
  std::vector<Double3> to(inner * count * outer, Double3{});
  rule([&](std::size_t source, std::size_t target, double weight) {
    for (std::size_t o = 0; o < outer; ++o) {
      const Double3* a = from.data() + (o * size[axis] + source) * inner;
      Double3* b = to.data() + (o * count + target) * inner;
      for (std::size_t i = 0; i < inner; ++i) b[i] = b[i] + a[i] * weight;
    }
  });
  size[axis] = count;
  return to;
}

/// Values of the four splines at t in [0, 1], and their derivatives.
std::array<double, 4> spline(double t) {
  const double s = 1.0 - t;
  return {s * s * s / 6.0, (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
          (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0, t * t * t / 6.0};
}
std::array<double, 4> slope(double t) {
  const double s = 1.0 - t;
  return {-s * s / 2.0, (3.0 * t * t - 4.0 * t) / 2.0, (4.0 * s - 3.0 * s * s) / 2.0, t * t / 2.0};
}

}  // namespace

DisplacementLattice DisplacementLattice::over(const Double3& low, const Double3& high, double spacing) {
  DisplacementLattice out;
  out.corner = low;
  out.spacing = spacing;
  for (std::size_t a = 0; a < 3; ++a)
    out.nodes[a] = static_cast<std::size_t>(std::max(1.0, std::ceil((high[a] - low[a]) / spacing))) + 3;
  out.coefficient.assign(out.node_count(), Double3{});
  return out;
}

std::vector<Double3> refine_nodes(const std::vector<Double3>& coarse,
                                  const std::array<std::size_t, 3>& nodes) {
  std::array<std::size_t, 3> size = nodes;
  std::vector<Double3> out = coarse;
  for (std::size_t a = 0; a < 3; ++a)
    out = along(out, size, a, finer(nodes[a]), [&](const auto& add) {
      for_rule(nodes[a], [&](std::size_t c, std::size_t f, double w) { add(c, f, w); });
    });
  return out;
}

std::vector<Double3> coarsen_nodes(const std::vector<Double3>& fine,
                                   const std::array<std::size_t, 3>& nodes) {
  std::array<std::size_t, 3> size = {finer(nodes[0]), finer(nodes[1]), finer(nodes[2])};
  std::vector<Double3> out = fine;
  for (std::size_t a = 0; a < 3; ++a)
    out = along(out, size, a, nodes[a], [&](const auto& add) {
      for_rule(nodes[a], [&](std::size_t c, std::size_t f, double w) { add(f, c, w); });
    });
  return out;
}

DisplacementLattice DisplacementLattice::refined() const {
  DisplacementLattice out;
  out.corner = corner;
  out.spacing = spacing / 2.0;
  out.nodes = {finer(nodes[0]), finer(nodes[1]), finer(nodes[2])};
  out.coefficient = refine_nodes(coefficient, nodes);
  return out;
}

LatticeStencil::LatticeStencil(const DisplacementLattice& lattice, const Double3& p) {
  for (std::size_t a = 0; a < 3; ++a) {
    const auto cells = static_cast<double>(lattice.nodes[a] - 3);
    const double at = std::clamp((p[a] - lattice.corner[a]) / lattice.spacing, 0.0, cells);
    const double cell = std::min(std::floor(at), cells - 1.0);
    first[a] = static_cast<std::size_t>(cell);
    weight[a] = spline(at - cell);
  }
}

Double3 DisplacementLattice::at(const Double3& p) const {
  Double3 sum{};
  LatticeStencil(*this, p).for_each(*this,
                                    [&](std::size_t node, double w) { sum = sum + coefficient[node] * w; });
  return sum;
}

std::array<Double3, 3> DisplacementLattice::derivatives(const Double3& p) const {
  std::array<Double3, 3> out{};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto cells = static_cast<double>(nodes[a] - 3);
    const double at = (p[a] - corner[a]) / spacing;
    if (!(at >= 0.0 && at <= cells)) continue;
    LatticeStencil stencil(*this, p);
    stencil.weight[a] = slope(at - static_cast<double>(stencil.first[a]));
    for (double& w : stencil.weight[a]) w /= spacing;
    stencil.for_each(*this, [&](std::size_t node, double w) { out[a] = out[a] + coefficient[node] * w; });
  }
  return out;
}

Double3 DisplacementLattice::origin_of(const Double3& moved) const {
  Double3 p = moved - at(moved);
  const double enough = kOriginEnough * spacing;
  for (int step = 0; step < kOriginSteps; ++step) {
    const Double3 next = moved - at(p);
    const bool there = squared_distance(next, p) <= enough * enough;
    p = next;
    if (there) break;
  }
  return p;
}

}  // namespace tessera
