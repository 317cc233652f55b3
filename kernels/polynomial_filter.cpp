#include "kernels/polynomial_filter.h"

#include <immintrin.h>

#include <cmath>
#include <optional>

namespace tessera {
namespace {

// One vertex to a register, lanes are coordinates: the terms of a sum stay in the order of the row.
__m128 load(const Displacement& d) {
  return _mm_load_ps(d.xyz.data());
}
void store(Displacement& d, __m128 v) {
  _mm_store_ps(d.xyz.data(), v);
}

using Field = std::vector<Displacement>;

__m128 neighbour_sum(const SurfaceRows& rows, const Displacement* field, std::size_t v) {
  __m128 sum = _mm_setzero_ps();
  const std::uint32_t last = rows.first[v + 1];
  for (std::uint32_t e = rows.first[v]; e < last; ++e)
    sum = _mm_add_ps(sum, _mm_mul_ps(_mm_set1_ps(rows.weight[e]), load(field[rows.neighbour[e]])));
  return sum;
}

/// (A d)_v. Fixed vertices carry d = 0, so their empty rows give 0 as they must.
__m128 row_times(const SurfaceRows& rows, const Displacement* field, std::size_t v) {
  return _mm_sub_ps(load(field[v]),
                    _mm_mul_ps(_mm_set1_ps(rows.inverse_degree[v]), neighbour_sum(rows, field, v)));
}

/// A b from differences, in doubles: exact enough far from the origin.
Field laplacian_of_positions(const SurfaceRows& rows, std::span<const Double3> position) {
  Field out(position.size());
  for (std::size_t v = 0; v < position.size(); ++v) {
    const Double3& p = position[v];
    double x = 0.0, y = 0.0, z = 0.0;
    for (std::uint32_t e = rows.first[v]; e < rows.first[v + 1]; ++e) {
      const Double3& q = position[rows.neighbour[e]];
      const double w = rows.weight[e];
      x += w * (p[0] - q[0]);
      y += w * (p[1] - q[1]);
      z += w * (p[2] - q[2]);
    }
    const double s = rows.inverse_degree[v];
    out[v].xyz = {static_cast<float>(x * s), static_cast<float>(y * s), static_cast<float>(z * s), 0.0F};
  }
  return out;
}

/// A field before the Laplacian is applied again: each vertex reads its own kind only, so that no bending crosses a
/// crease.
class InnerField {
 public:
  explicit InnerField(const SurfaceRows& rows)
      : free_(rows.role.size()), line_(rows.role.size()), role_(rows.role) {}
  void set(std::size_t v, __m128 value) {
    if (role_[v] == VertexRole::kLine) {
      store(line_[v], value);
    } else {
      store(free_[v], value);
    }
  }
  const Displacement* seen_by(std::size_t v) const {
    return role_[v] == VertexRole::kLine ? line_.data() : free_.data();
  }

 private:
  Field free_, line_;  // zero where the vertex is of the other kind
  const std::vector<VertexRole>& role_;
};

/// d <- d - factor A (b + d); `initial` is A b.
void explicit_step(const SurfaceRows& rows, const Field& initial, float factor, Field& d, Field& scratch) {
  const __m128 f = _mm_set1_ps(factor);
  for (std::size_t v = 0; v < d.size(); ++v) {
    const __m128 lap = _mm_add_ps(load(initial[v]), row_times(rows, d.data(), v));
    store(scratch[v], _mm_sub_ps(load(d[v]), _mm_mul_ps(f, lap)));
  }
  d.swap(scratch);
}

/// d <- d - factor A A (b + d); `initial` is A b.
void explicit_square_step(const SurfaceRows& rows, const Field& initial, float factor, Field& d,
                          InnerField& inner) {
  for (std::size_t v = 0; v < d.size(); ++v)
    inner.set(v, _mm_add_ps(load(initial[v]), row_times(rows, d.data(), v)));
  const __m128 f = _mm_set1_ps(factor);
  for (std::size_t v = 0; v < d.size(); ++v)
    if (rows.inverse_degree[v] > 0.0F)
      store(d[v], _mm_sub_ps(load(d[v]), _mm_mul_ps(f, row_times(rows, inner.seen_by(v), v))));
}

/// Chebyshev semi-iteration for (1 + lambda A^order) d = -lambda A^order b on the spectrum [1, 1 + lambda 2^order].
Field implicit_filter(const SurfaceRows& rows, const Field& initial, const FilterOptions& options,
                      std::span<const Displacement> start) {
  const std::size_t n = initial.size();
  const double half_width = 0.5 * options.lambda * (options.order == 1 ? 2.0 : 4.0);
  const double centre = 1.0 + half_width;
  const __m128 lambda = _mm_set1_ps(static_cast<float>(options.lambda));
  std::optional<InnerField> inner;
  if (options.order == 2) inner.emplace(rows);
  Field d(n), previous(n);
  if (!start.empty())
    for (std::size_t v = 0; v < n; ++v)
      if (rows.inverse_degree[v] > 0.0F) d[v] = previous[v] = start[v];
  double rho = half_width / centre;
  for (int step = 0; step < options.degree; ++step) {
    double momentum = 0.0, gain = 1.0 / centre;
    if (step > 0) {
      const double next = 1.0 / (2.0 * centre / half_width - rho);
      momentum = next * rho;
      gain = 2.0 * next / half_width;
      rho = next;
    }
    const __m128 alpha = _mm_set1_ps(static_cast<float>(momentum)),
                 beta = _mm_set1_ps(static_cast<float>(gain));
    if (inner)
      for (std::size_t v = 0; v < n; ++v)
        inner->set(v, _mm_add_ps(load(initial[v]), row_times(rows, d.data(), v)));
    for (std::size_t v = 0; v < n; ++v) {
      const __m128 here = load(d[v]);
      const __m128 bend = inner ? row_times(rows, inner->seen_by(v), v)
                                : _mm_add_ps(load(initial[v]), row_times(rows, d.data(), v));
      const __m128 residual = _mm_sub_ps(_mm_sub_ps(_mm_setzero_ps(), here), _mm_mul_ps(lambda, bend));
      const __m128 moved = _mm_add_ps(here, _mm_add_ps(_mm_mul_ps(alpha, _mm_sub_ps(here, load(previous[v]))),
                                                       _mm_mul_ps(beta, residual)));
      store(previous[v], moved);
    }
    d.swap(previous);
  }
  return d;
}

}  // namespace

int filter_rings(const FilterOptions& options) {
  // One ring more than rows are applied: a line must know whether its ends are free.
  switch (options.kind) {
    case FilterKind::kLaplacian:
      return options.degree + 1;
    case FilterKind::kBilaplacian:
    case FilterKind::kTaubin:
      return 2 * options.degree + 1;
    case FilterKind::kImplicit:
      return options.order * options.degree + 1;
  }
  return 0;
}

int chebyshev_degree(double lambda, int order, double accuracy) {
  const double root = std::sqrt(1.0 + lambda * (order == 1 ? 2.0 : 4.0));
  const double rate = (root - 1.0) / (root + 1.0);
  int degree = 0;
  for (double error = 2.0; error > accuracy && degree < 100000; error *= rate) ++degree;
  return degree < 1 ? 1 : degree;
}

std::vector<Displacement> filter_surface(SurfaceRows& rows, std::span<const Double3> position,
                                         const FilterOptions& options, std::span<const Displacement> start) {
  const Field initial = laplacian_of_positions(rows, position);
  for (const std::uint32_t e : rows.held) rows.weight[e] = 0.0F;
  if (options.kind == FilterKind::kImplicit) return implicit_filter(rows, initial, options, start);
  Field d(position.size());
  const float lambda = static_cast<float>(options.lambda);
  if (options.kind == FilterKind::kBilaplacian) {
    InnerField inner(rows);
    for (int step = 0; step < options.degree; ++step) explicit_square_step(rows, initial, lambda, d, inner);
    return d;
  }
  Field scratch(position.size());
  for (int step = 0; step < options.degree; ++step) {
    explicit_step(rows, initial, lambda, d, scratch);
    if (options.kind == FilterKind::kTaubin)
      explicit_step(rows, initial, static_cast<float>(options.mu), d, scratch);
  }
  return d;
}

}  // namespace tessera
