#include "solvers/laplacian_system.h"

#include <cassert>
#include <numeric>
#include <string>

#include "octree/error.h"

namespace tessera {
namespace {

void check_order(int order) {
  if (order < 1 || order > 3)
    throw UsageError("a Laplacian of order " + std::to_string(order) + " is not supported: use 1, 2 or 3");
}

struct Split {
  std::vector<std::int32_t> free_vertices, fixed_vertices, free_column, fixed_column;
};

Split split(std::size_t n, std::span<const std::uint8_t> fixed) {
  if (fixed.size() != n)
    throw UsageError(std::to_string(fixed.size()) + " fixed flags for " + std::to_string(n) + " vertices");
  Split s;
  s.free_column.assign(n, -1);
  s.fixed_column.assign(n, -1);
  for (std::size_t i = 0; i < n; ++i) {
    auto& list = fixed[i] ? s.fixed_vertices : s.free_vertices;
    (fixed[i] ? s.fixed_column : s.free_column)[i] = static_cast<std::int32_t>(list.size());
    list.push_back(static_cast<std::int32_t>(i));
  }
  if (s.free_vertices.empty()) throw UsageError("every vertex is fixed: nothing to solve");
  return s;
}

/// From rows of the free vertices over all columns.
ConstrainedSystem split_columns(const SparseMatrix& rows, Split&& s) {
  std::vector<std::int32_t> all(static_cast<std::size_t>(rows.rows));
  std::iota(all.begin(), all.end(), 0);
  ConstrainedSystem out;
  out.matrix = select(rows, all, s.free_column, static_cast<std::int32_t>(s.free_vertices.size()));
  out.coupling = select(rows, all, s.fixed_column, static_cast<std::int32_t>(s.fixed_vertices.size()));
  out.free_vertices = std::move(s.free_vertices);
  out.fixed_vertices = std::move(s.fixed_vertices);
  return out;
}

std::vector<double> inverse(std::span<const double> mass) {
  std::vector<double> d(mass.size());
  for (std::size_t i = 0; i < d.size(); ++i) d[i] = 1.0 / mass[i];
  return d;
}

void negate(SparseMatrix& a) {
  for (double& v : a.value) v = -v;
}

}  // namespace

std::vector<double> ConstrainedSystem::right_hand_side(std::span<const double> values, int width,
                                                       std::span<const double> load) const {
  const auto w = static_cast<std::size_t>(width);
  std::vector<double> known(fixed_vertices.size() * w), b(free_vertices.size() * w);
  for (std::size_t k = 0; k < fixed_vertices.size(); ++k)
    for (std::size_t c = 0; c < w; ++c) known[k * w + c] = values[fixed_vertices[k] * w + c];
  multiply(coupling, known, b, width);
  for (std::size_t k = 0; k < free_vertices.size(); ++k)
    for (std::size_t c = 0; c < w; ++c)
      b[k * w + c] = (load.empty() ? 0.0 : load[free_vertices[k] * w + c]) - b[k * w + c];
  return b;
}

void ConstrainedSystem::scatter(std::span<const double> solution, std::span<double> values, int width) const {
  const auto w = static_cast<std::size_t>(width);
  assert(solution.size() == free_vertices.size() * w);
  for (std::size_t k = 0; k < free_vertices.size(); ++k)
    for (std::size_t c = 0; c < w; ++c) values[free_vertices[k] * w + c] = solution[k * w + c];
}

ConstrainedSystem constrain(const SparseMatrix& a, std::span<const std::uint8_t> fixed) {
  Split s = split(static_cast<std::size_t>(a.rows), fixed);
  ConstrainedSystem out;
  out.matrix = select(a, s.free_vertices, s.free_column, static_cast<std::int32_t>(s.free_vertices.size()));
  out.coupling =
      select(a, s.free_vertices, s.fixed_column, static_cast<std::int32_t>(s.fixed_vertices.size()));
  out.free_vertices = std::move(s.free_vertices);
  out.fixed_vertices = std::move(s.fixed_vertices);
  return out;
}

SparseMatrix laplacian_power(const Laplacian& operators, int order) {
  check_order(order);
  const std::vector<double> d = inverse(operators.mass);
  SparseMatrix p = operators.stiffness;
  for (int k = 1; k < order; ++k) p = product(p, operators.stiffness, d);
  if (order % 2 == 1) negate(p);
  return p;
}

ConstrainedSystem damped_laplacian_system(const SparseMatrix& stiffness,
                                          std::span<const std::vector<double>> scale,
                                          std::span<const std::uint8_t> fixed) {
  check_order(static_cast<int>(scale.size()) + 1);
  const auto n = static_cast<std::size_t>(stiffness.rows);
  Split s = split(n, fixed);
  std::vector<std::int32_t> identity(n);
  std::iota(identity.begin(), identity.end(), 0);
  SparseMatrix rows = select(stiffness, s.free_vertices, identity, static_cast<std::int32_t>(n));
  for (std::size_t j = scale.size(); j-- > 0;) rows = product(rows, stiffness, scale[j]);
  if (scale.size() % 2 == 0) negate(rows);
  return split_columns(rows, std::move(s));
}

ConstrainedSystem laplacian_system(const Laplacian& operators, int order,
                                   std::span<const std::uint8_t> fixed) {
  check_order(order);
  const std::vector<std::vector<double>> scale(static_cast<std::size_t>(order) - 1, inverse(operators.mass));
  return damped_laplacian_system(operators.stiffness, scale, fixed);
}

SparseMatrix implicit_step_matrix(const Laplacian& operators, double step, int order) {
  return sum(1.0, diagonal_matrix(operators.mass), step, laplacian_power(operators, order));
}

SparseMatrix mesh_neighbours(const Laplacian& operators, const ConstrainedSystem& system) {
  std::vector<std::int32_t> column(operators.mass.size(), -1);
  for (std::size_t k = 0; k < system.free_vertices.size(); ++k)
    column[system.free_vertices[k]] = static_cast<std::int32_t>(k);
  return select(operators.stiffness, system.free_vertices, column, system.matrix.rows);
}

}  // namespace tessera
