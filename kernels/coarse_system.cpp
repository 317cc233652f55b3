#include "kernels/coarse_system.h"

#include <algorithm>

#include "octree/error.h"
#include "solvers/linear_solver.h"

namespace tessera {

namespace {

constexpr double kCoarseTolerance = 1e-5;

/// Matrix, unknowns, right-hand side and solution; multigrid with its levels and vectors for three columns. Measured
/// on 10^4 to 10^6 unknowns.
constexpr std::uint64_t kBytesPerUnknown = 600;
constexpr std::uint64_t kBytesPerEntry = 16;

}  // namespace

CoarseSystem::CoarseSystem(std::vector<CoarseUnknown> unknowns) : unknowns_(std::move(unknowns)) {
  place_.reserve(unknowns_.size());
  for (const CoarseUnknown& u : unknowns_) {
    Part& part = u.on_line != 0 ? line_ : free_;
    place_.push_back(static_cast<std::int32_t>(part.position.size()));
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
    throw InputError("the coarse level has no unknown " + std::to_string(name) + "; run again with --force");
  return static_cast<std::size_t>(at - unknowns_.begin());
}

void CoarseSystem::end_row(Part& part) {
  part.own.start.push_back(static_cast<std::int32_t>(part.own.column.size()));
  part.seen.start.push_back(static_cast<std::int32_t>(part.seen.column.size()));
}

void CoarseSystem::add(const CoarseEntry& entry) {
  const std::size_t row = number(entry.row), column = number(entry.column);
  for (; row_ < row; ++row_) end_row(unknowns_[row_].on_line != 0 ? line_ : free_);
  const bool line = unknowns_[row].on_line != 0;
  Part& part = line ? line_ : free_;
  if (line && unknowns_[column].on_line == 0) return;  // lines do not see the surface
  SparseMatrix& m = line == (unknowns_[column].on_line != 0) ? part.own : part.seen;
  m.column.push_back(place_[column]);
  m.value.push_back(entry.value);
}

std::vector<double> CoarseSystem::solve_part(Part& part, const std::vector<double>& load,
                                             std::uint64_t memory_bytes) {
  std::vector<double> x(load.size(), 0.0);
  if (load.empty()) return x;
  SolverOptions options;
  options.tolerance = kCoarseTolerance;
  options.positions = part.position;
  options.memory_bytes = memory_bytes;
  const auto solver = make_solver(SolverKind::kMultigrid, options);
  FactorReport factor = solver->analyse(part.own);
  if (factor.status == SolveStatus::kTooLarge) throw ResourceError("the coarse level: " + factor.message);
  if (factor.status == SolveStatus::kSolved) factor = solver->factor(part.own);
  SolveReport report{factor.status, 0.0, 0, factor.message};
  if (factor.status == SolveStatus::kSolved) report = solver->solve(load, x, 3);
  cycles_ = std::max(cycles_, report.iterations);
  if (report.status != SolveStatus::kSolved)
    throw InputError("the coarse level of smoothing has no solution: " + report.message);
  return x;
}

std::vector<Double3> CoarseSystem::solve(std::span<const CoarseLoad> loads, std::uint64_t memory_bytes) {
  for (; row_ < unknowns_.size(); ++row_) end_row(unknowns_[row_].on_line != 0 ? line_ : free_);
  std::vector<double> free_load(3 * free_.position.size(), 0.0), line_load(3 * line_.position.size(), 0.0);
  for (const CoarseLoad& l : loads) {
    const std::size_t i = number(l.row);
    std::vector<double>& to = unknowns_[i].on_line != 0 ? line_load : free_load;
    for (std::size_t a = 0; a < 3; ++a) to[3 * static_cast<std::size_t>(place_[i]) + a] += l.value[a];
  }
  cycles_ = 0;
  const std::vector<double> on_lines = solve_part(line_, line_load, memory_bytes);
  if (!on_lines.empty()) {
    std::vector<double> seen(free_load.size());
    multiply(free_.seen, on_lines, seen, 3);
    for (std::size_t i = 0; i < seen.size(); ++i) free_load[i] -= seen[i];
  }
  const std::vector<double> free = solve_part(free_, free_load, memory_bytes);
  std::vector<Double3> out(unknowns_.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double* const x =
        (unknowns_[i].on_line != 0 ? on_lines : free).data() + 3 * static_cast<std::size_t>(place_[i]);
    out[i] = {x[0], x[1], x[2]};
  }
  return out;
}

std::uint64_t CoarseSystem::bytes(std::uint64_t unknowns, std::uint64_t entries) {
  return unknowns * kBytesPerUnknown + entries * kBytesPerEntry;
}

}  // namespace tessera
