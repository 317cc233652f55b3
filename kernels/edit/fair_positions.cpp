#include "kernels/edit/fair_positions.h"

#include <algorithm>
#include <limits>
#include <memory>

#include "octree/edge_faces.h"
#include "octree/error.h"
#include "solvers/laplacian_system.h"
#include "solvers/multifrontal_solver.h"

namespace tessera {
namespace {

constexpr double kHalved = 4.0;  ///< lengths: of waves that lose half
constexpr double kInfiniteMass = 1e300;
constexpr double kTurn = 6.283185307179586;

void require(SolveStatus status, const std::string& message) {
  if (status == SolveStatus::kTooLarge) throw ResourceError(message);
  if (status != SolveStatus::kSolved) throw InputError("the surface cannot be smoothed: " + message);
}

}  // namespace

std::vector<Double3> fair_positions(const TriangleSpan& surface, const Laplacian& operators, double length,
                                    FactorStore* store) {
  const std::size_t n = surface.positions.size();
  std::vector<std::uint8_t> fixed(n, 0);
  EdgeFaces(n, surface.faces)
      .for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
        if (half.size() != 2) fixed[low] = fixed[high] = 1;
      });
  std::vector<Double3> out(surface.positions.begin(), surface.positions.end());
  if (std::find(fixed.begin(), fixed.end(), 0) == fixed.end()) return out;
  // An infinite mass: what pulls at the border counts nothing there, as its Laplacian is none.
  Laplacian inside = operators;
  for (std::size_t v = 0; v < n; ++v)
    if (fixed[v] != 0) inside.mass[v] = kInfiniteMass;
  const double root = kHalved * length / kTurn, square = root * root;
  const ConstrainedSystem system = constrain(implicit_step_matrix(inside, square * square, 2), fixed);
  std::vector<double> values, load;
  for (std::size_t v = 0; v < n; ++v)
    for (const double x : surface.positions[v]) {
      values.push_back(x);
      load.push_back(operators.mass[v] * x);
    }
  // Refined by nobody: a few digits do.
  const SolverOptions options{.tolerance = std::numeric_limits<double>::infinity(), .order = 2};
  const std::unique_ptr<LinearSolver> solver = store == nullptr ? make_solver(SolverKind::kFronts, options)
                                                                : make_multifrontal_solver(options, *store);
  const auto ready = [&](const FactorReport& r) { require(r.status, r.message); };
  ready(solver->analyse(system.matrix));
  ready(solver->factor(system.matrix));
  const std::vector<double> b = system.right_hand_side(values, 3, load);
  std::vector<double> x(b.size());
  const SolveReport solved = solver->solve(b, x, 3);
  require(solved.status, solved.message);
  system.scatter(x, values, 3);
  for (std::size_t v = 0; v < n; ++v) out[v] = {values[3 * v], values[3 * v + 1], values[3 * v + 2]};
  return out;
}

}  // namespace tessera
