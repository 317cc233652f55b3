#include "kernels/smooth/polynomial_filter.h"

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <utility>

#include "octree/lists.h"

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

/// What a plate moves a vertex by, and how it bends there: a complex number for each coordinate, in one register.
struct alignas(32) Pair {
  std::array<float, 8> xyz = {0, 0, 0, 0, 0, 0, 0, 0};  ///< moved (real), bend (imaginary)
};

__m256 load(const Pair& p) {
  return _mm256_load_ps(p.xyz.data());
}
void store(Pair& p, __m256 v) {
  _mm256_store_ps(p.xyz.data(), v);
}

/// A complex factor of pairs.
class Factor {
 public:
  explicit Factor(std::complex<double> c)
      : real_(_mm256_set1_ps(static_cast<float>(c.real()))),
        imag_(_mm256_set_m128(_mm_set1_ps(static_cast<float>(c.imag())),
                              _mm_set1_ps(static_cast<float>(-c.imag())))) {}
  __m256 times(__m256 p) const {
    return _mm256_add_ps(_mm256_mul_ps(real_, p), _mm256_mul_ps(imag_, _mm256_permute2f128_ps(p, p, 1)));
  }

 private:
  __m256 real_, imag_;
};

/// Vertices that are filtered together: with their rings they stay in the second-level cache, and the rings still
/// cost little beside them.
constexpr std::size_t kWindowVertices = std::size_t{1} << 15;

/// Some vertices and all that their displacements read, ring by ring, with their own numbers. Step after step the
/// outer rings are left out: what they would hold is not read any more.
class Window {
 public:
  /// \param lines_last  free vertices name their neighbours on lines last, from `lines` on
  Window(const SurfaceRows& rows, std::span<const Double3> position, int rings, bool lines_last)
      : rows_(rows),
        position_(position),
        rings_(static_cast<std::size_t>(rings)),
        lines_last_(lines_last),
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
  std::vector<std::uint32_t> lines;  ///< with lines_last
  std::vector<float> weight;         ///< 0 where a line names a free vertex
  std::vector<float> inverse_degree;
  std::vector<VertexRole> role;
  Field initial;  ///< A b

 private:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  /// The rows of vertices [begin, end); what they name for the first time is appended.
  void add_rows(std::size_t begin, std::size_t end) {
    std::size_t entries = first[begin];
    std::size_t maximum = entries;
    for (std::size_t i = begin; i < end; ++i) maximum += rows_.first[vertex[i] + 1] - rows_.first[vertex[i]];
    std::size_t n = vertex.size();
    vertex.resize(n + maximum - entries);
    neighbour.resize(maximum);
    weight.resize(maximum);
    first.resize(end + 1);
    inverse_degree.resize(end);
    role.resize(end);
    initial.resize(end);
    if (lines_last_) lines.resize(end);
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
        if (lines_last_ && !line && rows_.role[u] == VertexRole::kLine) {
          kept_.push_back({at, w});
          continue;
        }
        to[entries] = at;
        weights[entries++] = line && rows_.role[u] == VertexRole::kFree ? 0.0F : w;
      }
      if (lines_last_) {
        lines[i] = static_cast<std::uint32_t>(entries);
        for (const auto& [at, w] : kept_) {
          to[entries] = at;
          weights[entries++] = w;
        }
        kept_.clear();
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
  bool lines_last_;
  std::vector<std::pair<std::uint32_t, float>> kept_;  ///< neighbours on lines of the row that is being added
  std::vector<std::uint32_t> local_;                   ///< of every vertex of the block
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
  std::vector<Pair> plate, plate_other;
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

/// Chebyshev semi-iteration for (1 + lambda A) d = -lambda A b on the spectrum [1 + lambda lowest, 1 + 2 lambda].
void membrane_filter(const Window& w, const FilterOptions& options, Scratch& s) {
  const double top = options.lambda * 2.0;
  const double bottom = options.lambda * options.lowest;
  const double half_width = 0.5 * (top - bottom);
  const double centre = 1.0 + 0.5 * (top + bottom);
  const __m128 lambda = _mm_set1_ps(static_cast<float>(options.lambda));
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
    const std::size_t n = w.within(--ring);
    for (std::size_t i = 0; i < n; ++i) {
      const __m128 here = load(s.d[i]);
      const __m128 laplacian = _mm_add_ps(load(w.initial[i]), row_times(w, s.d.data(), i));
      const __m128 residual = _mm_sub_ps(_mm_sub_ps(_mm_setzero_ps(), here), _mm_mul_ps(lambda, laplacian));
      const __m128 moved = _mm_add_ps(here, _mm_add_ps(_mm_mul_ps(alpha, _mm_sub_ps(here, load(s.other[i]))),
                                                       _mm_mul_ps(beta, residual)));
      store(s.other[i], moved);
    }
    s.d.swap(s.other);
  }
}

/// A z + A b. A free vertex does not see the bend of a line: a plate does not bend across a crease.
__m256 laplacian_times(const Window& w, const Pair* field, std::size_t i) {
  __m256 sum = _mm256_setzero_ps();
  const std::uint32_t last = w.first[i + 1], lines = w.lines[i];
  const float* const weight = w.weight.data();
  const std::uint32_t* const neighbour = w.neighbour.data();
  for (std::uint32_t e = w.first[i]; e < lines; ++e)
    sum = _mm256_add_ps(sum, _mm256_mul_ps(_mm256_set1_ps(weight[e]), load(field[neighbour[e]])));
  for (std::uint32_t e = lines; e < last; ++e)
    sum = _mm256_add_ps(sum, _mm256_mul_ps(_mm256_set_m128(_mm_setzero_ps(), _mm_set1_ps(weight[e])),
                                           load(field[neighbour[e]])));
  const __m256 times = _mm256_sub_ps(load(field[i]), _mm256_mul_ps(_mm256_set1_ps(w.inverse_degree[i]), sum));
  return _mm256_add_ps(times, _mm256_set_m128(_mm_setzero_ps(), load(w.initial[i])));
}

using Complex = std::complex<double>;

Complex inverse(Complex c) {
  return std::conj(c) * (1.0 / std::norm(c));
}

/// z <- z + of_z z + of_momentum (z - previous z) + of_laplacian A (b + z) + of_initial A b
struct PlateStep {
  Complex of_z, of_momentum, of_laplacian, of_initial;
};

/// Where the spectrum of A ends in Chebyshev's variable: at i / root, -1 / (i root) in units of A.
Complex plate_pole(double root) {
  return {1.0, -1.0 / root};
}

/// Steps that the filter begins with so that long waves, which move far less than they bend, are as exact as short ones.
int plate_start_steps(double root) {
  return static_cast<int>(std::ceil(1.5 * std::sqrt(root)));
}

/// The steps for (1 + i root A) z = -i root A b, whose real part solves (1 + root^2 A^2) d = -root^2 A^2 b. From zero
/// the first j steps leave the share (1 - T_j(1 - A)) / (1 - T_j(1 - i / root)) of the error, which vanishes with A;
/// the others are Chebyshev's on the spectrum [lowest, 2] of A.
std::vector<PlateStep> plate_steps(const FilterOptions& options) {
  const double root = std::sqrt(options.lambda);
  std::vector<PlateStep> steps;
  const int start = options.lowest > 0.0 ? 0 : std::min(plate_start_steps(root), options.degree / 2);
  if (start > 0) {
    steps.push_back({0.0, 0.0, Complex{0.0, -root}, 0.0});
    const Complex x = plate_pole(root);
    Complex t_before = 1.0, t = x;
    while (static_cast<int>(steps.size()) < start) {
      const Complex t_next = 2.0 * x * t - t_before, scale = inverse(1.0 - t_next);
      steps.push_back(
          {2.0 * (x - 1.0) * t * scale, (1.0 - t_before) * scale, -2.0 * (1.0 - t) * scale, 2.0 * scale});
      t_before = t;
      t = t_next;
    }
  }
  const Complex unit{0.0, root};
  const Complex half_width = unit * (0.5 * (2.0 - options.lowest));
  const Complex centre = 1.0 + unit * (0.5 * (2.0 + options.lowest));
  const Complex ratio = 2.0 * centre * inverse(half_width);
  Complex rho = half_width * inverse(centre), momentum = 0.0, gain = inverse(centre);
  while (static_cast<int>(steps.size()) < options.degree) {
    steps.push_back({-gain, momentum, -unit * gain, 0.0});
    const Complex next = inverse(ratio - rho);
    momentum = next * rho;
    gain = 2.0 * next * inverse(half_width);
    rho = next;
  }
  return steps;
}

void plate_filter(const Window& w, const FilterOptions& options, Scratch& s) {
  int ring = filter_rings(options) - 1;
  for (const PlateStep& step : plate_steps(options)) {
    const Factor of_z(step.of_z), of_momentum(step.of_momentum), of_laplacian(step.of_laplacian),
        of_initial(step.of_initial);
    const bool initial = step.of_initial != 0.0;
    const std::size_t n = w.within(--ring);
    for (std::size_t i = 0; i < n; ++i) {
      if (!(w.inverse_degree[i] > 0.0F)) continue;
      const __m256 here = load(s.plate[i]);
      __m256 move =
          _mm256_add_ps(of_z.times(here), of_laplacian.times(laplacian_times(w, s.plate.data(), i)));
      move = _mm256_add_ps(move, of_momentum.times(_mm256_sub_ps(here, load(s.plate_other[i]))));
      if (initial)
        move = _mm256_add_ps(move, of_initial.times(_mm256_set_m128(_mm_setzero_ps(), load(w.initial[i]))));
      store(s.plate_other[i], _mm256_add_ps(here, move));
    }
    s.plate.swap(s.plate_other);
  }
}

bool is_plate(const FilterOptions& options) {
  return options.kind == FilterKind::kImplicit && options.order == 2;
}

void run(const Window& w, const FilterOptions& options, Scratch& s) {
  switch (options.kind) {
    case FilterKind::kLaplacian:
    case FilterKind::kTaubin:
      return explicit_filter(w, options, s);
    case FilterKind::kBilaplacian:
      s.inner.reset(w.vertex.size());
      return bilaplacian_filter(w, options, s);
    case FilterKind::kImplicit:
      return is_plate(options) ? plate_filter(w, options, s) : membrane_filter(w, options, s);
  }
}

/// Orders vertices by the number of their neighbours: rows of one length after the other leave nothing to guess to
/// the branch predictor, which takes a third of the time otherwise.
void sort_by_degree(const SurfaceRows& rows, std::vector<std::uint32_t>& vertices,
                    std::vector<std::uint32_t>& scratch) {
  constexpr std::uint32_t kMax = 15;
  const auto degree = [&](std::uint32_t v) { return std::min(rows.first[v + 1] - rows.first[v], kMax); };
  std::array<std::uint32_t, kMax + 2> begin;
  scratch.resize(vertices.size());
  counting_sort<std::uint32_t>(vertices, scratch, begin, degree);
  vertices.swap(scratch);
}

}  // namespace

int filter_rings(const FilterOptions& options) {
  // One ring more than rows are applied: a line must know whether its ends are free.
  switch (options.kind) {
    case FilterKind::kLaplacian:
    case FilterKind::kImplicit:
      return options.degree + 1;
    case FilterKind::kBilaplacian:
    case FilterKind::kTaubin:
      return 2 * options.degree + 1;
  }
  return 0;
}

int chebyshev_degree(double lambda, int order, double accuracy) {
  constexpr int kMax = 100000;
  if (order == 1) {
    const double root = std::sqrt(1.0 + lambda * 2.0);
    const double rate = (root - 1.0) / (root + 1.0);
    int degree = 0;
    for (double error = 2.0; error > accuracy && degree < kMax; error *= rate) ++degree;
    return degree < 1 ? 1 : degree;
  }
  const double root = std::sqrt(lambda);
  const Complex x = plate_pole(root);
  Complex t_before = 1.0, t = x;
  int degree = 1;
  for (; std::norm(t) * accuracy * accuracy < 1.0 && degree < kMax; ++degree)
    t_before = std::exchange(t, 2.0 * x * t - t_before);
  return degree + plate_start_steps(root);
}

FilterState filter_surface(const SurfaceRows& rows, std::span<const Double3> position,
                           const FilterOptions& options, std::span<const std::uint8_t> wanted,
                           const FilterState& start) {
  const auto n = static_cast<std::uint32_t>(position.size());
  FilterState out;
  out.moved.resize(n);
  out.laplacian.resize(start.laplacian.size());
  const bool plate = is_plate(options);
  Window window(rows, position, filter_rings(options) - 1, plate);
  Scratch scratch;
  std::vector<std::uint32_t> core, sorted;
  for (std::uint32_t v = 0; v < n;) {
    core.clear();
    for (; v < n && core.size() < kWindowVertices; ++v)
      if (wanted.empty() || wanted[v] != 0) core.push_back(v);
    if (core.empty()) break;
    sort_by_degree(rows, core, sorted);
    window.move_to(core);
    const std::size_t size = window.vertex.size();
    if (plate) {
      scratch.plate.assign(size, {});
      for (std::size_t i = 0; i < size; ++i) {
        const std::uint32_t u = window.vertex[i];
        if (!(rows.inverse_degree[u] > 0.0F)) continue;
        if (!start.moved.empty()) std::copy_n(start.moved[u].xyz.begin(), 4, scratch.plate[i].xyz.begin());
        if (!start.laplacian.empty())
          std::copy_n(start.laplacian[u].xyz.begin(), 4, scratch.plate[i].xyz.begin() + 4);
      }
      scratch.plate_other = scratch.plate;
    } else {
      scratch.d.assign(size, {});
      if (!start.moved.empty())
        for (std::size_t i = 0; i < size; ++i)
          if (rows.inverse_degree[window.vertex[i]] > 0.0F) scratch.d[i] = start.moved[window.vertex[i]];
      scratch.other = scratch.d;
    }
    run(window, options, scratch);
    for (std::size_t i = 0; i < core.size(); ++i) {
      if (!plate) {
        out.moved[core[i]] = scratch.d[i];
        continue;
      }
      const auto& both = scratch.plate[i].xyz;
      std::copy_n(both.begin(), 4, out.moved[core[i]].xyz.begin());
      if (!out.laplacian.empty()) std::copy_n(both.begin() + 4, 4, out.laplacian[core[i]].xyz.begin());
    }
  }
  return out;
}

std::uint64_t filter_window_bytes(std::uint64_t vertices, int rings) {
  // Rows take 61 bytes and fields up to 80. A run of vertices is no disk: four times one with its rings.
  const double across = std::sqrt(static_cast<double>(kWindowVertices)) + 2.0 * rings;
  return std::min(vertices, static_cast<std::uint64_t>(4.0 * across * across)) * 150;
}

}  // namespace tessera
