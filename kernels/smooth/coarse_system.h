/// \file coarse_system.h
/// The linear system of the coarse level of smoothing (coarse_level.h), summed over the whole mesh and solved in
/// core.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/smooth/coarse_level.h"

#include "solvers/linear_solver.h"

namespace tessera {

struct CoarseUnknown {
  std::uint64_t name = 0;
  Double3 position = {0, 0, 0};  ///< of the vertex that names it
  std::uint64_t on_line = 0;     ///< 1: of a line
};

/// What the coarse level adds at an unknown.
struct CoarseValue {
  Double3 moved = {0, 0, 0};
  Double3 bend = {0, 0, 0};  ///< order 2
};

class CoarseSystem {
 public:
  /// \param unknowns  ascending names
  CoarseSystem(std::vector<CoarseUnknown> unknowns, const CoarseOptions& options);

  /// \pre ascending rows, ascending columns within a row, each pair once; both are unknowns
  void add(const CoarseEntry& entry);

  /// The values, in the order of the unknowns: those on lines are solved first, then the others, which see them.
  /// Order 1: by multigrid to a residual of 1e-5. Order 2: by Chebyshev steps, each with two systems of order 1 (block
  /// matrices of Axelsson, Neytcheva, Ahmad 2014). On one thread: the same bits on every machine.
  /// \pre all entries are added; every load names an unknown
  /// \param memory_bytes  for the solver beside the matrix; 0 = no limit
  /// \throws InputError when there is no solution, with the reason
  std::vector<CoarseValue> solve(std::span<const CoarseLoad> loads, std::uint64_t memory_bytes = 0);

  std::uint64_t entries() const { return free_.own.entries() + free_.seen.entries() + line_.own.entries(); }
  /// Cycles of multigrid in the last solve().
  int cycles() const { return cycles_; }

  /// Upper bound of what adding and solving takes for so many unknowns and entries.
  static std::uint64_t bytes(std::uint64_t unknowns, std::uint64_t entries, int order);

 private:
  struct Part {
    SparseMatrix own;   ///< among unknowns of this kind: D + lambda (D - W)
    SparseMatrix mass;  ///< order 2: D, the same pattern
    SparseMatrix seen;  ///< of the free part: lambda (D - W), columns are unknowns on lines
    std::vector<Double3> position;
  };
  /// Three columns each, interleaved.
  struct Fields {
    std::vector<double> moved, bend;
  };
  std::size_t number(std::uint64_t name) const;
  void end_row(Part& part) const;
  Fields solve_part(Part& part, const Fields& load, std::uint64_t memory_bytes);
  void solve_plate(const Part& part, LinearSolver& solver, const Fields& load, Fields& x,
                   SolveReport& report);

  std::vector<CoarseUnknown> unknowns_;
  double lambda_;
  bool plate_;
  std::vector<std::int32_t> place_;  ///< of each unknown in its part
  Part free_, line_;
  std::size_t row_ = 0;  ///< that is being filled
  int cycles_ = 0;
};

}  // namespace tessera
