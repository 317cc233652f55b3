#include "kernels/smooth/coarse_system.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "octree/error.h"
#include "solvers/multifrontal_solver.h"

namespace tessera {

namespace {

constexpr double kCoarseTolerance = 1e-5;
/// Steps of a plate's system end when the last one changed it by this share; in time each leaves 0.17 of the error, if
/// the two systems in it are solved well enough, and the cycles of smoothing leave more.
constexpr double kPlateTolerance = 0.02;
constexpr double kPlateInnerTolerance = 1e-4;
constexpr int kMaxPlateSteps = 20;

/// Matrix and unknowns.
constexpr std::uint64_t kBytesPerUnknown = 100, kBytesPerEntry = 16, kPlateBytesPerEntry = 24;
/// Right-hand sides, solutions and a plate's vectors, three columns each.
constexpr std::uint64_t kVectorsPerUnknown = 150, kPlateVectorsPerUnknown = 350;
/// Fronts of a factor; 500 on a terrain, 860 on a sphere. Multigrid takes less.
constexpr std::uint64_t kFrontsPerUnknown = 1000, kFrontsBytes = std::uint64_t{8} << 20;

/// Systems of three columns that a step asks for in its cycles, of order 1 and 2.
constexpr double kSystems = 3, kPlateSystems = 32;
/// CPU seconds: of factors by operation and, in every system, by entry; of multigrid, which takes about a hundred cycles
/// here, by entry of the matrix.
constexpr double kPerFlop = 5e-11, kPerFactorEntry = 3.2e-9, kPerMultigridEntry = 2.1e-7;

/// Whether a factor takes less time than multigrid, and no more memory than is reserved.
bool factor_pays(const FactorReport& factor, const SparseMatrix& a, bool plate) {
  const double systems = plate ? kPlateSystems : kSystems;
  const double direct =
      kPerFlop * factor.flops + systems * kPerFactorEntry * static_cast<double>(factor.factor_entries);
  return direct <= systems * kPerMultigridEntry * static_cast<double>(a.entries()) &&
         factor.peak_bytes <= kFrontsPerUnknown * static_cast<std::uint64_t>(a.rows) + kFrontsBytes;
}

/// V f = (D + V) f - D f, and D f. Three columns. \param mass  of D, by the pattern of D + V
void multiply_plate(const SparseMatrix& own, std::span<const double> mass, std::span<const double> f,
                    std::span<double> stiffness_f, std::span<double> mass_f) {
  for (std::int32_t i = 0; i < own.rows; ++i) {
    Double3 both = {0, 0, 0}, part = {0, 0, 0};
    for (std::int32_t e = own.start[i]; e < own.start[i + 1]; ++e) {
      const double* at = f.data() + 3 * static_cast<std::size_t>(own.column[e]);
      for (std::size_t a = 0; a < 3; ++a) {
        both[a] += own.value[e] * at[a];
        part[a] += mass[static_cast<std::size_t>(e)] * at[a];
      }
    }
    for (std::size_t a = 0; a < 3; ++a) {
      stiffness_f[3 * static_cast<std::size_t>(i) + a] = both[a] - part[a];
      mass_f[3 * static_cast<std::size_t>(i) + a] = part[a];
    }
  }
}

}  // namespace

CoarseSystem::CoarseSystem(std::vector<CoarseUnknown> unknowns, const CoarseOptions& options)
    : unknowns_(std::move(unknowns)), lambda_(options.lambda), plate_(options.order == 2) {
  slot_.reserve(unknowns_.size());
  for (const CoarseUnknown& u : unknowns_) {
    Part& part = u.on_line != 0 ? line_ : free_;
    slot_.push_back(static_cast<std::int32_t>(part.position.size()));
    part.position.push_back(u.position);
  }
  for (Part* part : {&free_, &line_}) {
    part->own.rows = part->own.columns = static_cast<std::int32_t>(part->position.size());
    part->own.start.push_back(0);
    part->seen.start.push_back(0);
  }
  free_.seen.rows = free_.own.rows;
  free_.seen.columns = line_.own.rows;
}

std::size_t CoarseSystem::number(std::uint64_t name) const {
  const auto at = std::lower_bound(unknowns_.begin(), unknowns_.end(), name,
                                   [](const CoarseUnknown& u, std::uint64_t k) { return u.name < k; });
  if (at == unknowns_.end() || at->name != name)
    throw std::logic_error("the coarse level has no unknown " + std::to_string(name));
  return static_cast<std::size_t>(at - unknowns_.begin());
}

void CoarseSystem::end_row(Part& part) const {
  part.own.start.push_back(static_cast<std::int32_t>(part.own.column.size()));
  part.seen.start.push_back(static_cast<std::int32_t>(part.seen.column.size()));
}

void CoarseSystem::add(const CoarseEntry& entry) {
  const std::size_t row = number(entry.row), column = number(entry.column);
  for (; row_ < row; ++row_) end_row(unknowns_[row_].on_line != 0 ? line_ : free_);
  const bool line = unknowns_[row].on_line != 0;
  Part& part = line ? line_ : free_;
  if (line && unknowns_[column].on_line == 0) return;  // lines do not see the surface
  const bool own = line == (unknowns_[column].on_line != 0);
  SparseMatrix& m = own ? part.own : part.seen;
  m.column.push_back(slot_[column]);
  m.value.push_back(entry.mass + lambda_ * entry.stiffness);
  if (own && plate_) part.mass.push_back(entry.mass);
}

/// With V = lambda (D - W): the matrix (D, -V; V, D), preconditioned by (D, -V; V, D + 2 V), has its eigenvalues in
/// [1/2, 1], and the latter takes two systems with D + V.
void CoarseSystem::solve_plate(const Part& part, LinearSolver& solver, const Fields& load, Fields& x,
                               SolveReport& report) {
  const std::size_t n = load.moved.size();
  std::vector<double> right(n), both(n), first(n), mass(n), sum(n);
  const auto solve = [&](std::vector<double>& to) {
    report = solver.solve(right, to, 3);
    ++systems_;
    cycles_ += report.iterations;
    return report.status == SolveStatus::kSolved;
  };
  const auto stiffness_times = [&](const std::vector<double>& f) {
    multiply_plate(part.own, part.mass, f, sum, mass);
  };
  Fields residual = load, before = x;
  constexpr double kCentre = 0.75, kHalfWidth = 0.25;
  double rho = kHalfWidth / kCentre, momentum = 0.0, gain = 1.0 / kCentre;
  for (int step = 0; step < kMaxPlateSteps; ++step) {
    for (std::size_t i = 0; i < n; ++i) right[i] = residual.moved[i] + residual.laplacian[i];
    if (!solve(both)) return;
    stiffness_times(both);
    for (std::size_t i = 0; i < n; ++i) right[i] = residual.moved[i] + sum[i];
    if (!solve(first)) return;
    double change = 0.0, size = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double moved = x.moved[i], laplacian = x.laplacian[i];
      x.moved[i] += momentum * (moved - before.moved[i]) + gain * first[i];
      x.laplacian[i] += momentum * (laplacian - before.laplacian[i]) + gain * (both[i] - first[i]);
      before.moved[i] = moved;
      before.laplacian[i] = laplacian;
      change += first[i] * first[i] + (both[i] - first[i]) * (both[i] - first[i]);
      size += x.moved[i] * x.moved[i] + x.laplacian[i] * x.laplacian[i];
    }
    report.residual = size > 0.0 ? std::sqrt(change / size) : 0.0;
    if (report.residual <= kPlateTolerance) return;
    stiffness_times(x.moved);
    for (std::size_t i = 0; i < n; ++i) {
      residual.moved[i] = load.moved[i] - mass[i];
      residual.laplacian[i] = load.laplacian[i] - sum[i];
    }
    stiffness_times(x.laplacian);
    for (std::size_t i = 0; i < n; ++i) {
      residual.moved[i] += sum[i];
      residual.laplacian[i] -= mass[i];
    }
    const double next = 1.0 / (2.0 * kCentre / kHalfWidth - rho);
    momentum = next * rho;
    gain = 2.0 * next / kHalfWidth;
    rho = next;
  }
  report.status = SolveStatus::kNotConverged;
  report.message = "the plate's last step still changes it by " + std::to_string(report.residual);
}

std::unique_ptr<LinearSolver> CoarseSystem::make_part_solver(const Part& part, FactorStore& factor) const {
  SolverOptions options;
  options.tolerance = plate_ ? kPlateInnerTolerance : kCoarseTolerance;
  options.positions = part.position;
  options.ordering = Ordering::kMinimumDegree;  // later rounds read the factor of the first one
  auto direct = make_multifrontal_solver(options, factor);
  const FactorReport analysed = direct->analyse(part.own);
  if (analysed.status == SolveStatus::kSolved && factor_pays(analysed, part.own, plate_)) return direct;
  auto multigrid = make_solver(SolverKind::kMultigrid, options);
  multigrid->analyse(part.own);
  return multigrid;
}

CoarseSystem::Fields CoarseSystem::solve_part(Part& part, const Fields& load, FactorStore& store) {
  Fields x;
  x.moved.assign(load.moved.size(), 0.0);
  x.laplacian.assign(load.laplacian.size(), 0.0);
  if (load.moved.empty()) return x;
  const auto solver = make_part_solver(part, store);
  const FactorReport factor = solver->factor(part.own);
  SolveReport report{factor.status, 0.0, 0, factor.message};
  if (factor.status == SolveStatus::kSolved) {
    if (plate_) {
      solve_plate(part, *solver, load, x, report);
    } else {
      report = solver->solve(load.moved, x.moved, 3);
      ++systems_;
      cycles_ += report.iterations;
    }
  }
  if (report.status != SolveStatus::kSolved)
    throw InputError("the coarse level of smoothing has no solution: " + report.message);
  return x;
}

std::vector<CoarseValue> CoarseSystem::solve(std::span<const CoarseLoad> loads) {
  MemoryFactorStore line, free;
  return solve(loads, {line, free});
}

std::vector<CoarseValue> CoarseSystem::solve(std::span<const CoarseLoad> loads,
                                             const CoarseFactors& factors) {
  for (; row_ < unknowns_.size(); ++row_) end_row(unknowns_[row_].on_line != 0 ? line_ : free_);
  const auto zeros = [&](const Part& part) {
    const std::vector<double> none(3 * part.position.size(), 0.0);
    return Fields{none, plate_ ? none : std::vector<double>()};
  };
  Fields free_load = zeros(free_), line_load = zeros(line_);
  for (const CoarseLoad& l : loads) {
    const std::size_t i = number(l.row);
    Fields& to = unknowns_[i].on_line != 0 ? line_load : free_load;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t at = 3 * static_cast<std::size_t>(slot_[i]) + a;
      to.moved[at] += l.moved[a];
      if (plate_) to.laplacian[at] += l.laplacian[a];
    }
  }
  systems_ = cycles_ = 0;
  const Fields on_lines = solve_part(line_, line_load, factors.line);
  if (!on_lines.moved.empty()) {
    std::vector<double>& to = plate_ ? free_load.laplacian : free_load.moved;
    std::vector<double> seen(to.size());
    multiply(free_.seen, on_lines.moved, seen, 3);
    for (std::size_t i = 0; i < seen.size(); ++i) to[i] -= seen[i];
  }
  const Fields free = solve_part(free_, free_load, factors.free);
  std::vector<CoarseValue> out(unknowns_.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Fields& x = unknowns_[i].on_line != 0 ? on_lines : free;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t at = 3 * static_cast<std::size_t>(slot_[i]) + a;
      out[i].moved[a] = x.moved[at];
      if (plate_) out[i].laplacian[a] = x.laplacian[at];
    }
  }
  return out;
}

std::uint64_t CoarseSystem::bytes(std::uint64_t unknowns, std::uint64_t entries, int order) {
  return unknowns * kBytesPerUnknown + entries * (order == 2 ? kPlateBytesPerEntry : kBytesPerEntry);
}

std::uint64_t CoarseSystem::solve_bytes(std::uint64_t unknowns, int order) {
  return unknowns * (kFrontsPerUnknown + (order == 2 ? kPlateVectorsPerUnknown : kVectorsPerUnknown)) +
         kFrontsBytes;
}

}  // namespace tessera
