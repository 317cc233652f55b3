#include "kernels/edit/lattice_fit.h"

#include <array>
#include <cmath>
#include <vector>

namespace tessera {
namespace {

using Nodes = std::vector<Double3>;
using Sizes = std::array<std::size_t, 3>;

/// Derivatives of one order: how often by each axis, and how often each comes in the sum of all squares.
struct Derivative {
  std::array<int, 3> by;
  double times;
};

std::vector<Derivative> derivatives_of(int order) {
  constexpr std::array<double, 4> kFactorial = {1, 1, 2, 6};
  std::vector<Derivative> out;
  for (int i = 0; i <= order; ++i)
    for (int j = 0; i + j <= order; ++j) {
      const int k = order - i - j;
      const auto f = [&](int n) { return kFactorial[static_cast<std::size_t>(n)]; };
      out.push_back({{i, j, k}, f(order) / (f(i) * f(j) * f(k))});
    }
  return out;
}

/// Rows of an array along an axis: its strides.
struct Axis {
  std::size_t inner, outer;
  Axis(const Sizes& size, std::size_t axis)
      : inner(axis == 0   ? 1
              : axis == 1 ? size[0]
                          : size[0] * size[1]),
        outer(size[0] * size[1] * size[2] / (inner * size[axis])) {}
};

/// Differences of neighbours along an axis, in the place of the first of them.
void difference(Nodes& values, Sizes& size, std::size_t axis) {
  const Axis rows(size, axis);
  const std::size_t count = size[axis];
  std::size_t to = 0;
  for (std::size_t o = 0; o < rows.outer; ++o)
    for (std::size_t n = 0; n + 1 < count; ++n)
      for (std::size_t i = 0; i < rows.inner; ++i, ++to) {
        const std::size_t from = (o * count + n) * rows.inner + i;
        values[to] = values[from + rows.inner] - values[from];
      }
  --size[axis];
  values.resize(to);
}

/// Its transpose.
Nodes undifference(const Nodes& values, Sizes& size, std::size_t axis) {
  const Axis rows(size, axis);
  const std::size_t count = size[axis];
  Nodes out(rows.inner * (count + 1) * rows.outer, Double3{});
  std::size_t from = 0;
  for (std::size_t o = 0; o < rows.outer; ++o)
    for (std::size_t n = 0; n < count; ++n)
      for (std::size_t i = 0; i < rows.inner; ++i, ++from) {
        const std::size_t to = (o * (count + 1) + n) * rows.inner + i;
        out[to] = out[to] - values[from];
        out[to + rows.inner] = out[to + rows.inner] + values[from];
      }
  ++size[axis];
  return out;
}

double inner_product(const Nodes& a, const Nodes& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += dot(a[i], b[i]);
  return sum;
}

class LatticeSystem {
 public:
  LatticeSystem(const DisplacementLattice& lattice, std::size_t coarser, std::span<const PlaneSample> samples,
                const LatticeFitOptions& options)
      : lattice_(lattice), samples_(samples), options_(options), derivatives_(derivatives_of(options.order)) {
    double all = 0.0;
    for (const PlaneSample& s : samples) all += s.weight;
    share_ = 1.0 / all;
    sizes_.push_back(lattice.nodes);
    for (std::size_t l = 0; l < coarser; ++l) {
      Sizes coarse = sizes_.back();
      for (std::size_t& n : coarse) n = (n - 3) / 2 + 3;
      sizes_.push_back(coarse);
    }
    find_diagonals();
  }

  /// Of the normal equations.
  Nodes right_side() const {
    Nodes out(lattice_.node_count(), Double3{});
    for (const PlaneSample& s : samples_)
      LatticeStencil(lattice_, s.at).for_each(lattice_, [&](std::size_t node, double w) {
        out[node] = out[node] + s.normal * (w * s.offset * s.weight * share_);
      });
    return out;
  }

  Nodes apply(const Nodes& c) const {
    Nodes out(c.size(), Double3{});
    add_energy(c, out);
    for (const PlaneSample& s : samples_) {
      const LatticeStencil stencil(lattice_, s.at);
      Double3 u{};
      stencil.for_each(lattice_, [&](std::size_t node, double w) { u = u + c[node] * w; });
      const Double3 force = (s.normal * dot(s.normal, u) + u * options_.hold) * (s.weight * share_);
      stencil.for_each(lattice_, [&](std::size_t node, double w) { out[node] = out[node] + force * w; });
    }
    return out;
  }

  /// Every level by its diagonal, added up.
  Nodes precondition(const Nodes& residual) const {
    std::vector<Nodes> of = {residual};
    for (std::size_t l = 1; l < sizes_.size(); ++l) of.push_back(coarsen_nodes(of.back(), sizes_[l]));
    Nodes sum;
    for (std::size_t l = sizes_.size(); l-- > 0;) {
      Nodes& here = of[l];
      for (std::size_t i = 0; i < here.size(); ++i) here[i] = here[i] / diagonal_[l][i];
      if (!sum.empty()) {
        const Nodes finer = refine_nodes(sum, sizes_[l + 1]);
        for (std::size_t i = 0; i < here.size(); ++i) here[i] = here[i] + finer[i];
      }
      sum = std::move(here);
    }
    return sum;
  }

 private:
  /// What a square of a difference of coefficients costs with nodes so far apart.
  double price(double spacing) const {
    double p = options_.stiffness * spacing * spacing * spacing;
    for (int k = 0; k < options_.order; ++k) p /= spacing * spacing;
    return p;
  }

  void add_energy(const Nodes& c, Nodes& out) const {
    for (const Derivative& d : derivatives_) {
      Nodes values = c;
      Sizes size = lattice_.nodes;
      for (std::size_t a = 0; a < 3; ++a)
        for (int k = 0; k < d.by[a]; ++k) difference(values, size, a);
      for (std::size_t a = 3; a-- > 0;)
        for (int k = 0; k < d.by[a]; ++k) values = undifference(values, size, a);
      const double factor = price(lattice_.spacing) * d.times;
      for (std::size_t i = 0; i < out.size(); ++i) out[i] = out[i] + values[i] * factor;
    }
  }

  /// Of the energy of differences inside of a lattice, and of a third of the data: normals point anywhere.
  void find_diagonals() {
    constexpr std::array<double, 4> kSquares = {1, 2, 6, 20};  // of binomial coefficients, added up
    double energy = 0.0;
    for (const Derivative& d : derivatives_) {
      double product = d.times;
      for (const int k : d.by) product *= kSquares[static_cast<std::size_t>(k)];
      energy += product;
    }
    DisplacementLattice level;
    level.corner = lattice_.corner;
    level.spacing = lattice_.spacing;
    for (const Sizes& size : sizes_) {
      level.nodes = size;
      std::vector<double> diagonal(level.node_count(), energy * price(level.spacing));
      for (const PlaneSample& s : samples_)
        LatticeStencil(level, s.at).for_each(level, [&](std::size_t node, double w) {
          diagonal[node] += w * w * s.weight * share_ * (1.0 / 3.0 + options_.hold);
        });
      diagonal_.push_back(std::move(diagonal));
      level.spacing *= 2.0;
    }
  }

  const DisplacementLattice& lattice_;
  std::span<const PlaneSample> samples_;
  LatticeFitOptions options_;
  std::vector<Derivative> derivatives_;
  double share_ = 1.0;
  std::vector<Sizes> sizes_;  ///< the finest first
  std::vector<std::vector<double>> diagonal_;
};

}  // namespace

LatticeFitReport fit_lattice(DisplacementLattice& lattice, std::size_t coarser,
                             std::span<const PlaneSample> samples, const LatticeFitOptions& options) {
  const LatticeSystem system(lattice, coarser, samples, options);
  Nodes& x = lattice.coefficient;
  Nodes residual = system.right_side();
  const double at_rest = inner_product(residual, system.precondition(residual));
  LatticeFitReport report;
  if (!(at_rest > 0.0)) {
    x.assign(x.size(), Double3{});
    return report;
  }
  const Nodes product = system.apply(x);
  for (std::size_t i = 0; i < x.size(); ++i) residual[i] = residual[i] - product[i];
  Nodes z = system.precondition(residual), p = z;
  double rz = inner_product(residual, z);
  const double enough = options.tolerance * options.tolerance * at_rest;
  while (rz > enough && report.iterations < options.max_iterations) {
    const Nodes q = system.apply(p);
    const double step = rz / inner_product(p, q);
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] = x[i] + p[i] * step;
      residual[i] = residual[i] - q[i] * step;
    }
    z = system.precondition(residual);
    const double next = inner_product(residual, z);
    for (std::size_t i = 0; i < x.size(); ++i) p[i] = z[i] + p[i] * (next / rz);
    rz = next;
    ++report.iterations;
  }
  report.residual = std::sqrt(rz / at_rest);
  return report;
}

}  // namespace tessera
