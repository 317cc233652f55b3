#include "kernels/edit/boundary_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "octree/error.h"
#include "solvers/laplacian_system.h"
#include "solvers/multifrontal_solver.h"

namespace tessera {
namespace {

constexpr int kMaxRefinements = 4;
constexpr std::size_t kResidualColumns = 4;  ///< at a time, in extended precision
constexpr double kRoundingShare = 1e-13;     ///< of the largest value: corrections below it are rounding

/// Solutions are refined against the operators, not against the matrix.
constexpr double kAnyResidual = std::numeric_limits<double>::infinity();

/// Damping of the Laplacian of order `level` at a vertex (6.2.3).
double damping(double smoothness, int level) {
  return std::clamp(smoothness - (level - 1), 0.0, 1.0);
}

void require_solved(SolveStatus status, const std::string& message) {
  if (status == SolveStatus::kTooLarge) throw ResourceError(message);
  if (status != SolveStatus::kSolved) throw InputError("the surface cannot be solved for: " + message);
}

/// \param store  null: the factor lies in memory
std::unique_ptr<LinearSolver> make_boundary_solver(bool symmetric, const SolverOptions& options,
                                                   FactorStore* store) {
  if (store == nullptr) return make_solver(symmetric ? SolverKind::kFronts : SolverKind::kLu, options);
  return symmetric ? make_multifrontal_solver(options, *store) : make_lu_solver(options, *store);
}

}  // namespace

struct BoundaryModel::Impl {
  int order = 2;
  SparseMatrix stiffness;
  std::vector<std::vector<double>> scale;       ///< per level from 1: damping over mass
  std::vector<std::vector<std::int32_t>> rows;  ///< per level from 1: where its Laplacian is needed
  std::vector<std::uint8_t> free;
  ConstrainedSystem system;
  std::unique_ptr<LinearSolver> solver;
  BoundaryModelReport report;

  void find_rows() {
    rows.assign(static_cast<std::size_t>(order), {});
    rows.back() = system.free_vertices;
    std::vector<std::uint8_t> in(free.begin(), free.end());
    for (std::size_t level = rows.size() - 1; level-- > 0;) {
      for (const std::int32_t v : rows[level + 1])
        for (std::int32_t e = stiffness.start[v]; e < stiffness.start[v + 1]; ++e)
          in[stiffness.column[e]] = 1;
      for (std::size_t v = 0; v < in.size(); ++v)
        if (in[v]) rows[level].push_back(static_cast<std::int32_t>(v));
    }
  }

  /// Right-hand sides that are missing: -(-1)^k (L D L ...) f on the free vertices, from differences along edges.
  void residual(std::span<const double> values, int width, std::span<double> out) const {
    const auto w = static_cast<std::size_t>(width);
    for (std::size_t first = 0; first < w; first += kResidualColumns)
      residual(values, w, first, std::min(kResidualColumns, w - first), out);
  }

  /// Of the columns from `first` on. \param width  of all
  void residual(std::span<const double> values, std::size_t width, std::size_t first, std::size_t w,
                std::span<double> out) const {
    const std::size_t n = values.size() / width;
    std::vector<long double> f(n * w), next(n * w, 0.0L);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t c = 0; c < w; ++c) f[i * w + c] = values[i * width + first + c];
    for (int level = 1; level <= order; ++level) {
      for (const std::int32_t v : rows[static_cast<std::size_t>(level) - 1]) {
        const auto i = static_cast<std::size_t>(v);
        const long double by = level < order ? scale[static_cast<std::size_t>(level) - 1][i] : 1.0L;
        // Column by column: sums that long stay in a register.
        for (std::size_t c = 0; c < w; ++c) {
          const long double here = f[i * w + c];
          long double sum = 0.0L;
          for (std::int32_t e = stiffness.start[v]; e < stiffness.start[v + 1]; ++e) {
            const auto j = static_cast<std::size_t>(stiffness.column[e]);
            if (j != i) sum += stiffness.value[e] * (f[j * w + c] - here);
          }
          next[i * w + c] = by * sum;
        }
      }
      f.swap(next);  // what the next level reads is all of these rows
    }
    const double sign = order % 2 == 1 ? 1.0 : -1.0;
    for (std::size_t k = 0; k < system.free_vertices.size(); ++k)
      for (std::size_t c = 0; c < w; ++c)
        out[k * width + first + c] =
            static_cast<double>(sign * f[static_cast<std::size_t>(system.free_vertices[k]) * w + c]);
  }
};

BoundaryModel::BoundaryModel(const Laplacian& operators, std::span<const std::uint8_t> free,
                             std::span<const double> smoothness, const BoundaryModelOptions& options)
    : impl_(std::make_unique<Impl>()) {
  Impl& m = *impl_;
  const std::size_t n = operators.mass.size();
  if (options.order < 1 || options.order > 3)
    throw UsageError("the order of an energy is 1, 2 or 3, not " + std::to_string(options.order));
  if (free.size() != n || (!smoothness.empty() && smoothness.size() != n))
    throw UsageError("flags and smoothness of a boundary model do not fit its vertices");
  m.order = options.order;
  m.free.assign(free.begin(), free.end());
  m.stiffness = operators.stiffness;
  std::vector<std::uint8_t> fixed(n);
  for (std::size_t v = 0; v < n; ++v) fixed[v] = free[v] == 0;
  for (int level = 1; level < m.order; ++level) {
    std::vector<double> scale(n);
    for (std::size_t v = 0; v < n; ++v)
      scale[v] = (free[v] || smoothness.empty() ? 1.0 : damping(smoothness[v], level)) / operators.mass[v];
    m.scale.push_back(std::move(scale));
  }
  m.system = damped_laplacian_system(m.stiffness, m.scale, fixed);
  m.find_rows();
  // Two dampings between three Laplacians: symmetric where both are the same (7.2).
  if (m.order == 3)
    for (const std::int32_t v : m.rows[0])
      m.report.symmetric = m.report.symmetric &&
                           m.scale[0][static_cast<std::size_t>(v)] == m.scale[1][static_cast<std::size_t>(v)];
  m.report.unknowns = m.system.free_vertices.size();
  m.solver = make_boundary_solver(
      m.report.symmetric, {.memory_bytes = options.memory_bytes, .tolerance = kAnyResidual, .order = m.order},
      options.store);
  m.report.factor = m.solver->analyse(m.system.matrix);
  require_solved(m.report.factor.status, m.report.factor.message);
  m.report.factor = m.solver->factor(m.system.matrix);
  if (const FactorReport& factor = m.report.factor; factor.status == SolveStatus::kSingular)
    throw SingularSystem(
        "the surface cannot be solved for: " + factor.message,
        factor.unknown < 0 ? -1 : m.system.free_vertices[static_cast<std::size_t>(factor.unknown)]);
  require_solved(m.report.factor.status, m.report.factor.message);
}

BoundaryModel::~BoundaryModel() = default;

void BoundaryModel::solve(std::span<double> values, int width) {
  Impl& m = *impl_;
  const auto w = static_cast<std::size_t>(width);
  const std::vector<std::int32_t>& free = m.system.free_vertices;
  std::vector<double> b = m.system.right_hand_side(values, width), x(b.size());
  SolveReport solved = m.solver->solve(b, x, width);
  require_solved(solved.status, solved.message);
  m.report.residual = solved.residual;
  m.system.scatter(x, values, width);
  m.report.refinements = 0;
  if (m.order == 1) return;
  double before = 0.0;
  for (int step = 0; step < kMaxRefinements; ++step) {
    m.residual(values, width, b);
    solved = m.solver->solve(b, x, width);
    require_solved(solved.status, solved.message);
    double largest = 0.0, correction = 0.0;
    for (std::size_t k = 0; k < free.size(); ++k)
      for (std::size_t c = 0; c < w; ++c) {
        const double value = values[static_cast<std::size_t>(free[k]) * w + c];
        largest = std::max(largest, std::fabs(value));
        correction = std::max(correction, std::fabs(x[k * w + c]));
      }
    if (step > 0 && !(correction < 0.5 * before)) break;  // does not converge any more
    const double earlier = before;
    before = correction;
    for (std::size_t k = 0; k < free.size(); ++k)
      for (std::size_t c = 0; c < w; ++c) values[static_cast<std::size_t>(free[k]) * w + c] += x[k * w + c];
    ++m.report.refinements;
    // Every correction is to the one before as this one is, or the first one to the solution.
    const double to = step == 0 ? largest : earlier;
    if (correction <= kRoundingShare * largest || correction * correction <= kRoundingShare * largest * to)
      break;
  }
}

const std::vector<std::int32_t>& BoundaryModel::free_vertices() const {
  return impl_->system.free_vertices;
}

const BoundaryModelReport& BoundaryModel::report() const {
  return impl_->report;
}

double BoundaryModel::energy(std::span<const double> values, int width) const {
  // Over the whole surface, undamped: f' (-1)^k L (D L)^(k-1) f, by halves so that squares stay squares.
  const Impl& m = *impl_;
  std::vector<double> f(values.begin(), values.end()), g(f.size());
  const auto w = static_cast<std::size_t>(width);
  if (m.order >= 2) {
    multiply(m.stiffness, f, g, width);
    if (m.order == 2) {
      double sum = 0.0;
      for (std::size_t i = 0; i < g.size(); ++i)
        if (m.free[i / w]) sum += g[i] * g[i] * m.scale[0][i / w];
      return sum;
    }
    for (std::size_t i = 0; i < g.size(); ++i) f[i] = g[i] * m.scale[0][i / w];
  }
  double sum = 0.0;
  for (std::int32_t v = 0; v < m.stiffness.rows; ++v)
    for (std::int32_t e = m.stiffness.start[v]; e < m.stiffness.start[v + 1]; ++e) {
      const std::int32_t j = m.stiffness.column[e];
      if (j <= v || !(m.free[static_cast<std::size_t>(v)] || m.free[static_cast<std::size_t>(j)])) continue;
      for (std::size_t c = 0; c < w; ++c) {
        const double d = f[static_cast<std::size_t>(j) * w + c] - f[static_cast<std::size_t>(v) * w + c];
        sum += m.stiffness.value[e] * d * d;
      }
    }
  return sum;
}

}  // namespace tessera
