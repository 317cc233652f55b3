/// \file polynomial_filter.h
/// Low-pass filters of a surface as polynomials of its Laplacian A (surface_rows.h): a fixed number of
/// rounds, no inner product, no global sum, so the displacement of a vertex is a function of the rings around
/// it alone.
///
/// All filters work on displacements d from the given positions b in floats: what is small stays accurate far
/// from the origin, and where A b = 0 (a plane) d is exactly zero. Sources: Taubin 1995; Desbrun, Meyer,
/// Schroeder, Barr 1999; Golub and Varga 1961 (Chebyshev semi-iteration).
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/smooth/surface_rows.h"

namespace tessera {

/// One displacement; the fourth number is zero and fills a vector register.
struct alignas(16) Displacement {
  std::array<float, 4> xyz = {0, 0, 0, 0};
};

enum class FilterKind : std::uint8_t {
  kLaplacian,    ///< x <- x - lambda A x, `degree` times
  kBilaplacian,  ///< x <- x - lambda A A x, `degree` times
  kTaubin,       ///< x <- x - lambda A x, x <- x - mu A x, `degree` times: does not shrink
  kImplicit,     ///< solves (1 + lambda A^order) x = b by `degree` steps of Chebyshev
};

struct FilterOptions {
  FilterKind kind = FilterKind::kImplicit;
  double lambda = 2.0;  ///< no unit: in steps of one ring
  double mu = -0.53;    ///< Taubin only
  int order = 1;        ///< implicit only: 1 or 2
  int degree = 10;      ///< > 0
  /// Implicit only: the steps are for eigenvalues of A from here to 2; what lies below, a coarse level has solved
  double lowest = 0.0;
};

/// Rings that the filter reads around a vertex.
[[nodiscard]] int filter_rings(const FilterOptions& options);

/// Number of steps after which an implicit filter that starts from zero is right to `accuracy`.
/// Order 1: of the right-hand side (in the norm of the degrees), by 2 ((sqrt K - 1) / (sqrt K + 1))^k with
/// K = 1 + 2 lambda. Order 2: of every wave's own displacement.
[[nodiscard]] int chebyshev_degree(double lambda, int order, double accuracy);

/// Where a filter is.
struct FilterState {
  std::vector<Displacement> moved;
  /// Order 2: sqrt(lambda) times the negative Laplacian of the surface it goes to. Empty: zero, not asked for
  std::vector<Displacement> laplacian;
};

/// Free vertices at the ends of lines do not move for the line.
/// With order 2 a surface continues with no bending at creases, a line bends along itself alone.
/// Order 2 is order 1 with a complex strength: 1 / (1 + lambda t^2) is the real part of 1 / (1 + i sqrt(lambda) t), so
/// it takes as few rings as a membrane of strength sqrt(lambda), and no product of two Laplacians.
/// Runs over windows of vertices that fit the cache together with the rings that they read.
/// \param position  n; the rows' own mesh
/// \param wanted    n flags of the vertices to compute, or empty: all
/// \param start     where to start from (implicit only), n or empty: zero
/// \return          moved: n, zero for fixed, open and unwanted vertices; bend: as many as start.bend
/// \cost 20 bytes a vertex, 16 more with a bend, and filter_window_bytes()
[[nodiscard]] FilterState filter_surface(const SurfaceRows& rows, std::span<const Double3> position,
                                         const FilterOptions& options,
                                         std::span<const std::uint8_t> wanted = {},
                                         const FilterState& start = {});

/// Bytes that a window takes in a block of so many vertices with a filter of so many rings.
[[nodiscard]] std::uint64_t filter_window_bytes(std::uint64_t vertices, int rings);

}  // namespace tessera
