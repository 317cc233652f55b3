/// \file dense_front.h
/// Dense kernels of the multifrontal factors (multifrontal_cholesky.h, multifrontal_lu.h). They call no BLAS, which picks its
/// kernels by the machine: every sum has one order and its fused multiplications are written out, so the bits are the same on
/// any.
/// Source: Goto, van de Geijn, "Anatomy of High-Performance Matrix Multiplication", 2008 (packed panels, tiles in
/// registers).
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

/// A matrix of which the first columns are eliminated: size x size by columns. Of a symmetric one the lower triangle counts, the
/// upper one is scratch.
struct DenseFront {
  std::span<double> value;  ///< size * size
  std::size_t size = 0;
  std::size_t eliminated = 0;  ///< columns

  double* column(std::size_t j) { return value.data() + j * size; }
};

/// Cholesky of the eliminated columns; the rest becomes its Schur complement.
/// \param smallest  of each eliminated column: what its pivot must exceed; >= 0 \param packed  scratch, kept between calls
/// \returns the first column whose pivot does not, -1 when there is none
std::ptrdiff_t eliminate(DenseFront& front, std::span<const double> smallest, std::vector<double>& packed);

/// Bytes that `packed` takes for a front of that size.
[[nodiscard]] std::size_t eliminate_bytes(std::size_t size);

/// LU of the eliminated rows and columns, L below the diagonal with units on it; the rest becomes its Schur complement. Where a
/// diagonal entry is small beside those below it, of the rows that are eliminated the one with the largest comes first.
/// \param smallest  of each eliminated column: what the size of its pivot must exceed; >= 0
/// \param swapped   per eliminated row: the one that it changed places with, in this order
/// \param packed    scratch, kept between calls
/// \returns the first column whose pivot does not, -1 when there is none
std::ptrdiff_t eliminate_lu(DenseFront& front, std::span<const double> smallest,
                            std::span<std::int32_t> swapped, std::vector<double>& packed);
[[nodiscard]] std::size_t eliminate_lu_bytes(std::size_t size);

/// The eliminated columns of a front, each from its diagonal down, one after the other.
struct FrontColumns {
  std::span<const double> value;  ///< trapezoid_entries(size, eliminated)
  std::size_t size = 0;
  std::size_t eliminated = 0;
};
[[nodiscard]] constexpr std::size_t trapezoid_entries(std::size_t size, std::size_t columns) {
  return columns * size - columns * (columns - (columns > 0)) / 2;
}

/// From so many right-hand sides on they go through a front beside each other, in multiples of it.
inline constexpr int kWideSolve = 8;

/// x = L^-1 x for the eliminated rows, what that takes from the others subtracted.
/// \param x  width columns of size rows; from kWideSolve on, a multiple of it, size rows of width numbers
void solve_forward(const FrontColumns& front, std::span<double> x, int width);
/// x = L^-T x for the eliminated rows, the others known.
void solve_backward(const FrontColumns& front, std::span<double> x, int width);

}  // namespace tessera
