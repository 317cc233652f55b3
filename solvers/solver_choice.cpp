// Which solver for which system: a fit of what tools/bench solvers measures.
#include <algorithm>
#include <cmath>
#include <string>

#include "octree/error.h"
#include "solvers/linear_solver.h"

namespace tessera {
namespace {

/// At a million unknowns, per unknown: bytes, microseconds before the first solution, microseconds a
/// right-hand side.
struct Cost {
  double bytes, setup, column;
};

struct Measured {
  Cost cholesky, multigrid;
};
constexpr Measured kMeasured[] = {
    {{840.0, 3.6, 0.10}, {200.0, 1.0, 0.35}},
    {{2400.0, 12.0, 0.25}, {650.0, 4.5, 1.5}},
    {{5500.0, 40.0, 0.50}, {950.0, 8.0, 20.0}},
};
// Fill grows with the logarithm of the size, work with about its power 1.5; small factors live in cache.
constexpr double kWorkExponent = 1.2;
constexpr double kLuOverCholesky = 2.5;  // memory

std::string mebibytes(double bytes) {
  return std::to_string(static_cast<std::uint64_t>(bytes / 1048576.0) + 1) + " MiB";
}

}  // namespace

SolverChoice choose_solver(std::size_t unknowns, int order, std::size_t right_hand_sides,
                           std::uint64_t memory_bytes, bool symmetric) {
  if (order < 1 || order > 3)
    throw UsageError("a Laplacian of order " + std::to_string(order) + " is not supported");
  const Measured& m = kMeasured[order - 1];
  const double n = static_cast<double>(std::max<std::size_t>(unknowns, 2)),
               columns = static_cast<double>(right_hand_sides);
  const double fill = std::log2(n) / std::log2(1e6);
  double direct_bytes = n * m.cholesky.bytes * fill;
  if (!symmetric) direct_bytes *= kLuOverCholesky;
  const double iterative_bytes = n * m.multigrid.bytes;
  const bool fits = memory_bytes == 0 || direct_bytes <= static_cast<double>(memory_bytes);
  const std::string what = std::to_string(unknowns) + " unknowns of order " + std::to_string(order) + ", " +
                           std::to_string(right_hand_sides) + " right-hand sides: ";
  SolverChoice out;
  if (!symmetric) {
    out.kind = fits ? SolverKind::kLu : SolverKind::kBicgstab;
    out.predicted_bytes = static_cast<std::uint64_t>(fits ? direct_bytes : iterative_bytes);
    out.reason = what + "not symmetric, " +
                 (fits ? "LU fits in " + mebibytes(direct_bytes)
                       : "LU would need " + mebibytes(direct_bytes) + ", above the cap, so BiCGSTAB");
    return out;
  }
  const double scale = n * 1e-6;
  const double direct =
      m.cholesky.setup * std::pow(scale, kWorkExponent) + m.cholesky.column * columns * scale * fill;
  const double multigrid = (m.multigrid.setup + m.multigrid.column * columns) * scale;
  if (!fits) {
    out.kind = SolverKind::kMultigrid;
    out.reason = what + "a Cholesky factor would need " + mebibytes(direct_bytes) + ", above the cap of " +
                 mebibytes(static_cast<double>(memory_bytes)) + ", so multigrid";
  } else {
    out.kind = direct <= multigrid ? SolverKind::kCholesky : SolverKind::kMultigrid;
    const auto seconds = [](double s) {
      return std::to_string(static_cast<int>(std::ceil(s * 10.0))) + " tenths of a second";
    };
    out.reason = what + "Cholesky about " + seconds(direct) + ", multigrid about " + seconds(multigrid);
  }
  out.predicted_bytes =
      static_cast<std::uint64_t>(out.kind == SolverKind::kCholesky ? direct_bytes : iterative_bytes);
  return out;
}

}  // namespace tessera
