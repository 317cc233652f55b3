#include "solvers/dense_front.h"

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

namespace tessera {
namespace {

// A tile of the product lies in eight registers of four doubles; its rows and columns are read from the same slices.
constexpr std::size_t kTileRows = 8, kTileColumns = 4;
// Columns that are eliminated before the rest of the panel, of the front, sees them: eight in a register, and what keeps
// a slice of eight rows in the first cache.
constexpr std::size_t kInnerColumns = 8, kPanelColumns = 96;

constexpr std::size_t slices(std::size_t rows) {
  return (rows + kTileRows - 1) / kTileRows;
}

/// Rows [first, size) of columns [from, to), in slices of kTileRows rows, column by column; zeros below.
void pack(const DenseFront& front, std::size_t from, std::size_t to, std::size_t first,
          std::vector<double>& packed) {
  const std::size_t depth = to - from;
  packed.resize(std::max(packed.size(), slices(front.size - first) * kTileRows * depth));
  for (std::size_t s = 0; s < slices(front.size - first); ++s) {
    const std::size_t row = first + s * kTileRows, rows = std::min(kTileRows, front.size - row);
    double* to_slice = packed.data() + s * kTileRows * depth;
    for (std::size_t k = 0; k < depth; ++k) {
      const double* from_column = front.value.data() + (from + k) * front.size + row;
      for (std::size_t r = 0; r < rows; ++r) to_slice[k * kTileRows + r] = from_column[r];
      for (std::size_t r = rows; r < kTileRows; ++r) to_slice[k * kTileRows + r] = 0.0;
    }
  }
}

/// sum over k of the rows of `left` times the columns of `right`, in ascending k.
struct Tile {
  __m256d sum[kTileColumns][2];

  Tile(const double* left, const double* right, std::size_t depth) {
    for (auto& column : sum) column[0] = column[1] = _mm256_setzero_pd();
    for (std::size_t k = 0; k < depth; ++k) {
      const __m256d low = _mm256_loadu_pd(left + k * kTileRows),
                    high = _mm256_loadu_pd(left + k * kTileRows + 4);
      for (std::size_t c = 0; c < kTileColumns; ++c) {
        const __m256d factor = _mm256_broadcast_sd(right + k * kTileRows + c);
        sum[c][0] = _mm256_fmadd_pd(low, factor, sum[c][0]);
        sum[c][1] = _mm256_fmadd_pd(high, factor, sum[c][1]);
      }
    }
  }
  /// Subtracts from `to`, whose columns are `stride` apart.
  void subtract(double* to, std::size_t stride) const {
    for (std::size_t c = 0; c < kTileColumns; ++c)
      for (std::size_t half = 0; half < 2; ++half) {
        double* at = to + c * stride + 4 * half;
        _mm256_storeu_pd(at, _mm256_sub_pd(_mm256_loadu_pd(at), sum[c][half]));
      }
  }
  /// The same at an edge of the front.
  void subtract(double* to, std::size_t stride, std::size_t rows, std::size_t columns) const {
    alignas(32) std::array<double, kTileRows * kTileColumns> part;
    for (std::size_t c = 0; c < kTileColumns; ++c)
      for (std::size_t half = 0; half < 2; ++half)
        _mm256_store_pd(part.data() + c * kTileRows + 4 * half, sum[c][half]);
    for (std::size_t c = 0; c < columns; ++c)
      for (std::size_t r = 0; r < rows; ++r) to[c * stride + r] -= part[c * kTileRows + r];
  }
};

/// Columns [to, end) minus what the eliminated columns [from, to) take from them, rows from `to` down.
void subtract_products(DenseFront& front, std::size_t from, std::size_t to, std::size_t end,
                       std::vector<double>& packed) {
  if (to >= end) return;
  pack(front, from, to, to, packed);
  const std::size_t slice = kTileRows * (to - from);
  for (std::size_t j = to; j < end; j += kTileColumns) {
    const std::size_t above = (j - to) / kTileRows, columns = std::min(kTileColumns, end - j);
    const double* right = packed.data() + above * slice + (j - to) % kTileRows;
    for (std::size_t s = above; s < slices(front.size - to); ++s) {
      const Tile tile(packed.data() + s * slice, right, to - from);
      const std::size_t row = to + s * kTileRows, rows = std::min(kTileRows, front.size - row);
      if (rows == kTileRows && columns == kTileColumns)
        tile.subtract(front.column(j) + row, front.size);
      else
        tile.subtract(front.column(j) + row, front.size, rows, columns);
    }
  }
}

/// Columns [from, to), one by one.
std::ptrdiff_t eliminate_columns(DenseFront& front, std::size_t from, std::size_t to,
                                 std::span<const double> smallest) {
  for (std::size_t j = from; j < to; ++j) {
    double* column = front.column(j);
    for (std::size_t k = from; k < j; ++k) {
      const double* before = front.column(k);
      const double factor = before[j];
      for (std::size_t i = j; i < front.size; ++i) column[i] -= factor * before[i];
    }
    if (!(column[j] > smallest[j])) return static_cast<std::ptrdiff_t>(j);
    column[j] = std::sqrt(column[j]);
    const double per = 1.0 / column[j];
    for (std::size_t i = j + 1; i < front.size; ++i) column[i] *= per;
  }
  return -1;
}

/// sum of u[i] v[i]: four sums of every fourth, then their sum.
double dot(const double* u, const double* v, std::size_t count) {
  __m256d sum = _mm256_setzero_pd();
  std::size_t i = 0;
  for (; i + 4 <= count; i += 4) sum = _mm256_fmadd_pd(_mm256_loadu_pd(u + i), _mm256_loadu_pd(v + i), sum);
  alignas(32) std::array<double, 4> part;
  _mm256_store_pd(part.data(), sum);
  double rest = 0.0;
  for (; i < count; ++i) rest += u[i] * v[i];
  return (part[0] + part[1]) + (part[2] + part[3]) + rest;
}

}  // namespace

std::ptrdiff_t eliminate(DenseFront& front, std::span<const double> smallest, std::vector<double>& packed) {
  assert(front.value.size() == front.size * front.size && front.eliminated <= front.size &&
         smallest.size() == front.eliminated);
  for (std::size_t panel = 0; panel < front.eliminated; panel += kPanelColumns) {
    const std::size_t end = std::min(front.eliminated, panel + kPanelColumns);
    for (std::size_t inner = panel; inner < end; inner += kInnerColumns) {
      const std::size_t to = std::min(end, inner + kInnerColumns);
      if (const std::ptrdiff_t bad = eliminate_columns(front, inner, to, smallest); bad >= 0) return bad;
      subtract_products(front, inner, to, end, packed);
    }
    subtract_products(front, panel, end, front.size, packed);
  }
  return -1;
}

std::size_t eliminate_bytes(std::size_t size) {
  return sizeof(double) * slices(size) * kTileRows * std::min(size, kPanelColumns);
}

void solve_forward(const FrontColumns& front, std::span<double> x, int width) {
  assert(front.value.size() == trapezoid_entries(front.size, front.eliminated));
  const double* column = front.value.data();
  for (std::size_t j = 0; j < front.eliminated; ++j) {
    const std::size_t below = front.size - j;
    for (std::size_t c = 0; c < static_cast<std::size_t>(width); ++c) {
      double* at = x.data() + c * front.size + j;
      at[0] /= column[0];
      const double solved = at[0];
      for (std::size_t i = 1; i < below; ++i) at[i] -= column[i] * solved;
    }
    column += below;
  }
}

void solve_backward(const FrontColumns& front, std::span<double> x, int width) {
  assert(front.value.size() == trapezoid_entries(front.size, front.eliminated));
  const double* column = front.value.data() + front.value.size();
  for (std::size_t j = front.eliminated; j-- > 0;) {
    const std::size_t below = front.size - j;
    column -= below;
    for (std::size_t c = 0; c < static_cast<std::size_t>(width); ++c) {
      double* at = x.data() + c * front.size + j;
      at[0] = (at[0] - dot(column + 1, at + 1, below - 1)) / column[0];
    }
  }
}

}  // namespace tessera
