#include "kernels/polynomial_filter.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>

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

/// Vertices that are filtered together: with their rings they stay in the second-level cache, and the rings still
/// cost little beside them.
constexpr std::size_t kWindowVertices = std::size_t{1} << 15;

/// Some vertices and all that their displacements read, ring by ring, with their own numbers. Step after step the
/// outer rings are left out: what they would hold is not read any more.
class Window {
 public:
  Window(const SurfaceRows& rows, std::span<const Double3> position, int rings)
      : rows_(rows),
        position_(position),
        rings_(static_cast<std::size_t>(rings)),
        local_(rows.role.size(), kNone) {}

  /// The window around `core`.
  void move_to(std::span<const std::uint32_t> core) {
    for (const std::uint32_t v : vertex) local_[v] = kNone;
    vertex.assign(core.begin(), core.end());
    for (std::uint32_t i = 0; i < vertex.size(); ++i) local_[vertex[i]] = i;
    first.assign(1, 0);
    ring_end_.assign(1, vertex.size());
    std::size_t begin = 0;
    for (std::size_t ring = 0; ring < rings_; ++ring) {
      const std::size_t end = vertex.size();
      add_rows(begin, end);
      ring_end_.push_back(vertex.size());
      begin = end;
    }
  }

  /// Number of vertices within so many rings: the first ones.
  std::size_t within(int ring) const { return ring_end_[static_cast<std::size_t>(ring)]; }

  std::vector<std::uint32_t> vertex;  ///< number in the block
  // Of the vertices but the last ring's:
  std::vector<std::uint32_t> first, neighbour;
  std::vector<float> weight;  ///< 0 where a line names a free vertex
  std::vector<float> inverse_degree;
  std::vector<VertexRole> role;
  Field initial;  ///< A b

 private:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  /// The rows of vertices [begin, end); what they name for the first time is appended.
  void add_rows(std::size_t begin, std::size_t end) {
    std::size_t entries = first[begin];
    std::size_t most = entries;
    for (std::size_t i = begin; i < end; ++i) most += rows_.first[vertex[i] + 1] - rows_.first[vertex[i]];
    std::size_t n = vertex.size();
    vertex.resize(n + most - entries);
    neighbour.resize(most);
    weight.resize(most);
    first.resize(end + 1);
    inverse_degree.resize(end);
    role.resize(end);
    initial.resize(end);
    std::uint32_t* const names = vertex.data();
    std::uint32_t* const local = local_.data();
    std::uint32_t* const to = neighbour.data();
    float* const weights = weight.data();
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t v = names[i];
      // A b from differences, in doubles: exact enough far from the origin.
      const Double3 p = position_[v];
      double x = 0.0, y = 0.0, z = 0.0;
      const bool line = rows_.role[v] == VertexRole::kLine;
      const std::uint32_t last = rows_.first[v + 1];
      for (std::uint32_t e = rows_.first[v]; e < last; ++e) {
        const std::uint32_t u = rows_.neighbour[e];
        const float w = rows_.weight[e];
        const Double3& q = position_[u];
        const double wide = w;
        x += wide * (p[0] - q[0]);
        y += wide * (p[1] - q[1]);
        z += wide * (p[2] - q[2]);
        std::uint32_t at = local[u];
        if (at == kNone) {
          at = local[u] = static_cast<std::uint32_t>(n);
          names[n++] = u;
        }
        to[entries] = at;
        weights[entries++] = line && rows_.role[u] == VertexRole::kFree ? 0.0F : w;
      }
      first[i + 1] = static_cast<std::uint32_t>(entries);
      inverse_degree[i] = rows_.inverse_degree[v];
      role[i] = rows_.role[v];
      const double s = inverse_degree[i];
      initial[i].xyz = {static_cast<float>(x * s), static_cast<float>(y * s), static_cast<float>(z * s),
                        0.0F};
    }
    vertex.resize(n);
  }

  const SurfaceRows& rows_;
  std::span<const Double3> position_;
  std::size_t rings_;
  std::vector<std::uint32_t> local_;  ///< of every vertex of the block
  std::vector<std::size_t> ring_end_;
};

/// (A d)_i. Fixed vertices carry d = 0, so their empty rows give 0 as they must.
__m128 row_times(const Window& w, const Displacement* field, std::size_t i) {
  __m128 sum = _mm_setzero_ps();
  const std::uint32_t last = w.first[i + 1];
  const float* const weight = w.weight.data();
  const std::uint32_t* const neighbour = w.neighbour.data();
  for (std::uint32_t e = w.first[i]; e < last; ++e)
    sum = _mm_add_ps(sum, _mm_mul_ps(_mm_set1_ps(weight[e]), load(field[neighbour[e]])));
  return _mm_sub_ps(load(field[i]), _mm_mul_ps(_mm_set1_ps(w.inverse_degree[i]), sum));
}

/// A field before the Laplacian is applied again: each vertex reads its own kind only, so that no bending crosses a
/// crease.
class InnerField {
 public:
  void reset(std::size_t n) {
    free_.assign(n, {});
    line_.assign(n, {});
  }
  /// A (b + d) of the first `n` vertices.
  void set(const Window& w, const Field& d, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) {
      const __m128 value = _mm_add_ps(load(w.initial[i]), row_times(w, d.data(), i));
      store(w.role[i] == VertexRole::kLine ? line_[i] : free_[i], value);
    }
  }
  const Displacement* seen_by(VertexRole role) const {
    return role == VertexRole::kLine ? line_.data() : free_.data();
  }

 private:
  Field free_, line_;  // zero where the vertex is of the other kind
};

/// What the steps keep between two windows, so that it is allocated once.
struct Scratch {
  Field d, other;
  InnerField inner;
};

/// d <- d - factor A (b + d) for the first `n` vertices.
void explicit_step(const Window& w, float factor, std::size_t n, Scratch& s) {
  const __m128 f = _mm_set1_ps(factor);
  for (std::size_t i = 0; i < n; ++i) {
    const __m128 lap = _mm_add_ps(load(w.initial[i]), row_times(w, s.d.data(), i));
    store(s.other[i], _mm_sub_ps(load(s.d[i]), _mm_mul_ps(f, lap)));
  }
  s.d.swap(s.other);
}

void explicit_filter(const Window& w, const FilterOptions& options, Scratch& s) {
  const auto lambda = static_cast<float>(options.lambda);
  int ring = filter_rings(options) - 1;
  for (int step = 0; step < options.degree; ++step) {
    explicit_step(w, lambda, w.within(--ring), s);
    if (options.kind == FilterKind::kTaubin)
      explicit_step(w, static_cast<float>(options.mu), w.within(--ring), s);
  }
}

/// d <- d - lambda A A (b + d)
void bilaplacian_filter(const Window& w, const FilterOptions& options, Scratch& s) {
  const __m128 f = _mm_set1_ps(static_cast<float>(options.lambda));
  int ring = filter_rings(options) - 1;
  for (int step = 0; step < options.degree; ++step) {
    s.inner.set(w, s.d, w.within(--ring));
    const std::size_t n = w.within(--ring);
    for (std::size_t i = 0; i < n; ++i)
      if (w.inverse_degree[i] > 0.0F)
        store(s.d[i], _mm_sub_ps(load(s.d[i]), _mm_mul_ps(f, row_times(w, s.inner.seen_by(w.role[i]), i))));
  }
}

/// Chebyshev semi-iteration for (1 + lambda A^order) d = -lambda A^order b on the spectrum [1 + lambda lowest^order,
/// 1 + lambda 2^order].
void implicit_filter(const Window& w, const FilterOptions& options, Scratch& s) {
  const double top = options.lambda * (options.order == 1 ? 2.0 : 4.0);
  const double bottom = options.lambda * options.lowest * (options.order == 1 ? 1.0 : options.lowest);
  const double half_width = 0.5 * (top - bottom);
  const double centre = 1.0 + 0.5 * (top + bottom);
  const __m128 lambda = _mm_set1_ps(static_cast<float>(options.lambda));
  const bool twice = options.order == 2;
  double rho = half_width / centre;
  int ring = filter_rings(options) - 1;
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
    if (twice) s.inner.set(w, s.d, w.within(--ring));
    const std::size_t n = w.within(--ring);
    for (std::size_t i = 0; i < n; ++i) {
      const __m128 here = load(s.d[i]);
      const __m128 bend = twice ? row_times(w, s.inner.seen_by(w.role[i]), i)
                                : _mm_add_ps(load(w.initial[i]), row_times(w, s.d.data(), i));
      const __m128 residual = _mm_sub_ps(_mm_sub_ps(_mm_setzero_ps(), here), _mm_mul_ps(lambda, bend));
      const __m128 moved = _mm_add_ps(here, _mm_add_ps(_mm_mul_ps(alpha, _mm_sub_ps(here, load(s.other[i]))),
                                                       _mm_mul_ps(beta, residual)));
      store(s.other[i], moved);
    }
    s.d.swap(s.other);
  }
}

void run(const Window& w, const FilterOptions& options, Scratch& s) {
  const bool squared = options.kind == FilterKind::kBilaplacian ||
                       (options.kind == FilterKind::kImplicit && options.order == 2);
  if (squared) s.inner.reset(w.vertex.size());
  switch (options.kind) {
    case FilterKind::kLaplacian:
    case FilterKind::kTaubin:
      return explicit_filter(w, options, s);
    case FilterKind::kBilaplacian:
      return bilaplacian_filter(w, options, s);
    case FilterKind::kImplicit:
      return implicit_filter(w, options, s);
  }
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

std::vector<Displacement> filter_surface(const SurfaceRows& rows, std::span<const Double3> position,
                                         const FilterOptions& options, std::span<const std::uint8_t> wanted,
                                         std::span<const Displacement> start) {
  const auto n = static_cast<std::uint32_t>(position.size());
  std::vector<Displacement> out(n);
  Window window(rows, position, filter_rings(options) - 1);
  Scratch scratch;
  std::vector<std::uint32_t> core;
  for (std::uint32_t v = 0; v < n;) {
    core.clear();
    for (; v < n && core.size() < kWindowVertices; ++v)
      if (wanted.empty() || wanted[v] != 0) core.push_back(v);
    if (core.empty()) break;
    window.move_to(core);
    scratch.d.assign(window.vertex.size(), {});
    if (!start.empty())
      for (std::size_t i = 0; i < window.vertex.size(); ++i)
        if (rows.inverse_degree[window.vertex[i]] > 0.0F) scratch.d[i] = start[window.vertex[i]];
    scratch.other = scratch.d;
    run(window, options, scratch);
    for (std::size_t i = 0; i < core.size(); ++i) out[core[i]] = scratch.d[i];
  }
  return out;
}

std::uint64_t filter_window_bytes(std::uint64_t vertices, int rings) {
  // Rows take 57 bytes and up to five fields 16 each. A run of vertices is no disk: four times one with its rings.
  const double across = std::sqrt(static_cast<double>(kWindowVertices)) + 2.0 * rings;
  return std::min(vertices, static_cast<std::uint64_t>(4.0 * across * across)) * 150;
}

}  // namespace tessera
