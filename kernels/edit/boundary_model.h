/// \file boundary_model.h
/// Boundary constraint modelling: the surface that minimises a bending energy between vertices that are given.
/// Source: Botsch, thesis 6.2.1 to 6.2.3; Botsch and Kobbelt, "An Intuitive Framework for Real-Time Freeform Modeling",
/// 2004. Order k solves Delta^k f = 0 on the free vertices, Delta being that of the undeformed surface: 1 membrane,
/// 2 thin plate, 3 minimum variation. The first k rings of given vertices are the boundary condition, C^(k-1); where a
/// given vertex has less smoothness, its Laplacians of higher order are damped (6.2.3).
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "octree/error.h"
#include "solvers/factor_store.h"
#include "solvers/laplacian.h"
#include "solvers/linear_solver.h"

namespace tessera {

struct BoundaryModelOptions {
  int order = 2;                   ///< 1, 2 or 3
  std::uint64_t memory_bytes = 0;  ///< a factor that is predicted to need more is not tried; 0 = no limit
  /// Where the factor lies; then it does not count. Empty, and outlives the model. Null: in memory.
  FactorStore* store = nullptr;
};

/// The system has no solution, or rounding leaves it none.
struct SingularSystem : InputError {
  SingularSystem(const std::string& message, std::int32_t at) : InputError(message), vertex(at) {}
  std::int32_t vertex;  ///< where; -1: nobody knows
};

struct BoundaryModelReport {
  std::size_t unknowns = 0;
  bool symmetric = true;  ///< false: order 3 with smoothness that differs along the boundary
  FactorReport factor;
  double residual = 0.0;  ///< of the last solve, relative, the largest of the columns
  int refinements = 0;    ///< of the last solve
};

class BoundaryModel {
 public:
  /// Assembles and factors.
  /// \param operators   of the undeformed surface, n vertices; copied
  /// \param free        n flags: 1 = to be found
  /// \param smoothness  n values in [0, order - 1], read where not free; empty: order - 1 everywhere
  /// \throws UsageError     sizes or order; no free vertex
  /// \throws SingularSystem
  /// \throws ResourceError  the factor does not fit
  BoundaryModel(const Laplacian& operators, std::span<const std::uint8_t> free,
                std::span<const double> smoothness, const BoundaryModelOptions& options);
  ~BoundaryModel();
  BoundaryModel(const BoundaryModel&) = delete;
  BoundaryModel& operator=(const BoundaryModel&) = delete;

  /// Fills in the free rows of `values` (n x width, interleaved) from the others. Refined against the operators themselves,
  /// in extended precision, until corrections vanish: constants and affine maps come out to rounding, which the squared
  /// and cubed condition of orders 2 and 3 would not give.
  void solve(std::span<double> values, int width);
  [[nodiscard]] const std::vector<std::int32_t>& free_vertices() const;  ///< ascending
  [[nodiscard]] const BoundaryModelReport& report() const;
  /// sum over the columns of f' (-1)^k L (M^-1 L)^(k-1) f over the rows that the model has: what it minimises.
  double energy(std::span<const double> values, int width) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
