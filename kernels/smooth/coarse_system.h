/// \file coarse_system.h
/// The linear system of the coarse level of smoothing (coarse_level.h), summed over the whole mesh and solved in
/// core.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "kernels/smooth/coarse_level.h"

#include "solvers/factor_store.h"
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
  Double3 laplacian = {0, 0, 0};  ///< order 2
};

/// Where the factors lie, of the unknowns on lines and of the others: empty, or as an earlier solve() with the same entries
/// left them. Then they serve again.
struct CoarseFactors {
  FactorStore& line;
  FactorStore& free;
};

class CoarseSystem {
 public:
  /// \param unknowns  ascending names
  CoarseSystem(std::vector<CoarseUnknown> unknowns, const CoarseOptions& options);

  /// \pre ascending rows, ascending columns within a row, each pair once
  /// \throws std::logic_error when one of them is no unknown
  void add(const CoarseEntry& entry);

  /// The values, in the order of the unknowns: those on lines are solved first, then the others, which see them.
  /// Order 1: by a factor, or by multigrid to a residual of 1e-5 where the factor would take longer or more than
  /// solve_bytes(), which the matrix alone decides. Order 2: by Chebyshev steps, each with two systems of order 1
  /// (block matrices of Axelsson, Neytcheva, Ahmad 2014). On one thread: the same bits on every machine.
  /// \pre all entries are added
  /// \throws InputError when there is no solution, with the reason
  /// \throws std::logic_error when a load names no unknown
  std::vector<CoarseValue> solve(std::span<const CoarseLoad> loads, const CoarseFactors& factors);
  /// The same with factors in memory.
  std::vector<CoarseValue> solve(std::span<const CoarseLoad> loads);

  [[nodiscard]] std::uint64_t entries() const {
    return free_.own.entries() + free_.seen.entries() + line_.own.entries();
  }
  /// In the last solve(): systems of order 1, three columns each, and cycles of multigrid, 0 with factors.
  [[nodiscard]] int systems() const { return systems_; }
  [[nodiscard]] int cycles() const { return cycles_; }

  /// Upper bounds for so many unknowns and entries: of what is held once all is added, and of what solve() takes beside
  /// that and its factors.
  [[nodiscard]] static std::uint64_t bytes(std::uint64_t unknowns, std::uint64_t entries, int order);
  [[nodiscard]] static std::uint64_t solve_bytes(std::uint64_t unknowns, int order);

 private:
  struct Part {
    SparseMatrix own;          ///< among unknowns of this kind: D + lambda (D - W)
    std::vector<double> mass;  ///< order 2: of D, by the same pattern
    SparseMatrix seen;         ///< of the free part: lambda (D - W), columns are unknowns on lines
    std::vector<Double3> position;
  };
  /// Three columns each, interleaved.
  struct Fields {
    std::vector<double> moved, laplacian;
  };
  std::size_t number(std::uint64_t name) const;
  void end_row(Part& part) const;
  std::unique_ptr<LinearSolver> make_part_solver(const Part& part, FactorStore& factor) const;
  Fields solve_part(Part& part, const Fields& load, FactorStore& factor);
  void solve_plate(const Part& part, LinearSolver& solver, const Fields& load, Fields& x,
                   SolveReport& report);

  std::vector<CoarseUnknown> unknowns_;
  double lambda_;
  bool plate_;
  std::vector<std::int32_t> slot_;  ///< of each unknown in its part
  Part free_, line_;
  std::size_t row_ = 0;  ///< that is being filled
  int systems_ = 0, cycles_ = 0;
};

}  // namespace tessera
