#include "solvers/dense_front.h"

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <utility>

namespace tessera {
namespace {

// A tile of the product lies in eight registers of four doubles; its rows and columns are read from the same slices.
constexpr std::size_t kTileRows = 8, kTileColumns = 4;
// Columns that are eliminated before the rest of the panel, of the front, sees them: eight in a register, and what keeps
// a slice of eight rows in the first cache.
constexpr std::size_t kInnerColumns = 8, kPanelColumns = 96;
// LU solves for the rows of a panel column by column: narrower panels leave more to products.
constexpr std::size_t kPanelRows = 32;
// Columns of a factor that right-hand sides pass at a time.
constexpr std::size_t kTogether = 4;
// Of the largest entry below it: a diagonal one that stays the pivot, so that few rows change places.
constexpr double kMinDiagonal = 0.1;

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

/// \param columns  from column `j` on, at most kTileColumns; at the end of the front rows are cut off
inline void subtract_tile(DenseFront& front, const Tile& tile, std::size_t row, std::size_t j,
                          std::size_t columns) {
  const std::size_t rows = std::min(kTileRows, front.size - row);
  if (rows == kTileRows && columns == kTileColumns)
    tile.subtract(front.column(j) + row, front.size);
  else
    tile.subtract(front.column(j) + row, front.size, rows, columns);
}

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
      subtract_tile(front, Tile(packed.data() + s * slice, right, to - from), to + s * kTileRows, j, columns);
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
double inner_product(const double* u, const double* v, std::size_t count) {
  __m256d sum = _mm256_setzero_pd();
  std::size_t i = 0;
  for (; i + 4 <= count; i += 4) sum = _mm256_fmadd_pd(_mm256_loadu_pd(u + i), _mm256_loadu_pd(v + i), sum);
  alignas(32) std::array<double, 4> part;
  _mm256_store_pd(part.data(), sum);
  double tail = 0.0;
  for (; i < count; ++i) tail += u[i] * v[i];
  return (part[0] + part[1]) + (part[2] + part[3]) + tail;
}

/// Rows [from, to) of columns [first, end), in slices of kTileRows columns, row by row; zeros behind.
void pack_rows(const DenseFront& front, std::size_t from, std::size_t to, std::size_t first, std::size_t end,
               double* packed) {
  for (std::size_t j = first; j < end; j += kTileRows) {
    const std::size_t columns = std::min(kTileRows, end - j);
    for (std::size_t k = from; k < to; ++k, packed += kTileRows)
      for (std::size_t c = 0; c < kTileRows; ++c)
        packed[c] = c < columns ? front.value[(j + c) * front.size + k] : 0.0;
  }
}

/// Columns [to, end) minus the eliminated columns [from, to) times their rows, rows from `to` down.
void subtract_lu_products(DenseFront& front, std::size_t from, std::size_t to, std::size_t end,
                          std::vector<double>& packed) {
  if (to >= end) return;
  const std::size_t slice = kTileRows * (to - from), below = slices(front.size - to) * slice;
  packed.resize(std::max(packed.size(), below + slices(end - to) * slice));
  pack(front, from, to, to, packed);
  pack_rows(front, from, to, to, end, packed.data() + below);
  for (std::size_t j = to; j < end; j += kTileColumns) {
    const std::size_t columns = std::min(kTileColumns, end - j);
    const double* right = packed.data() + below + (j - to) / kTileRows * slice + (j - to) % kTileRows;
    for (std::size_t s = 0; s < slices(front.size - to); ++s) {
      subtract_tile(front, Tile(packed.data() + s * slice, right, to - from), to + s * kTileRows, j, columns);
    }
  }
}

/// to -= factor * from
void subtract_scaled(double* to, const double* from, double factor, std::size_t count) {
  const __m256d f = _mm256_set1_pd(factor);
  std::size_t i = 0;
  for (; i + 4 <= count; i += 4)
    _mm256_storeu_pd(to + i, _mm256_fnmadd_pd(f, _mm256_loadu_pd(from + i), _mm256_loadu_pd(to + i)));
  for (; i < count; ++i) to[i] = std::fma(-factor, from[i], to[i]);
}

/// Rows [from, to) of columns [to, end): L^-1 times them.
void solve_rows(DenseFront& front, std::size_t from, std::size_t to, std::size_t end) {
  // By fours, so that a lower column is read once for all of them.
  std::size_t j = to;
  for (; j + 4 <= end; j += 4)
    for (std::size_t k = from; k + 1 < to; ++k) {
      const double* lower = front.column(k);
      const std::array<double*, 4> column = {front.column(j), front.column(j + 1), front.column(j + 2),
                                             front.column(j + 3)};
      const std::array<double, 4> above = {column[0][k], column[1][k], column[2][k], column[3][k]};
      std::size_t i = k + 1;
      for (; i + 4 <= to; i += 4) {
        const __m256d l = _mm256_loadu_pd(lower + i);
        for (std::size_t c = 0; c < 4; ++c)
          _mm256_storeu_pd(column[c] + i, _mm256_fnmadd_pd(_mm256_broadcast_sd(&above[c]), l,
                                                           _mm256_loadu_pd(column[c] + i)));
      }
      for (; i < to; ++i)
        for (std::size_t c = 0; c < 4; ++c) column[c][i] = std::fma(-above[c], lower[i], column[c][i]);
    }
  for (; j < end; ++j) {
    double* column = front.column(j);
    for (std::size_t k = from; k + 1 < to; ++k)
      subtract_scaled(column + k + 1, front.column(k) + k + 1, column[k], to - k - 1);
  }
}

/// Columns [from, to), one by one, with pivots from the rows that are eliminated.
std::ptrdiff_t eliminate_lu_columns(DenseFront& front, std::size_t from, std::size_t to,
                                    std::span<const double> smallest, std::span<std::int32_t> swapped) {
  for (std::size_t j = from; j < to; ++j) {
    double* column = front.column(j);
    for (std::size_t k = from; k < j; ++k)
      subtract_scaled(column + k + 1, front.column(k) + k + 1, column[k], front.size - k - 1);
    std::size_t best = j;
    for (std::size_t i = j + 1; i < front.eliminated; ++i)
      if (std::fabs(column[i]) > std::fabs(column[best])) best = i;
    if (std::fabs(column[j]) >= kMinDiagonal * std::fabs(column[best])) best = j;
    if (!(std::fabs(column[best]) > smallest[j])) return static_cast<std::ptrdiff_t>(j);
    swapped[j] = static_cast<std::int32_t>(best);
    if (best != j)
      for (std::size_t c = 0; c < front.size; ++c) std::swap(front.column(c)[j], front.column(c)[best]);
    const double per = 1.0 / column[j];
    for (std::size_t i = j + 1; i < front.size; ++i) column[i] *= per;
  }
  return -1;
}

/// Eight right-hand sides in registers of four.
struct Wide {
  __m256d low, high;

  explicit Wide(const double* from) : low(_mm256_loadu_pd(from)), high(_mm256_loadu_pd(from + 4)) {}
  void store(double* to) const {
    _mm256_storeu_pd(to, low);
    _mm256_storeu_pd(to + 4, high);
  }
  void subtract(const double* factor, const Wide& times) {
    const __m256d f = _mm256_broadcast_sd(factor);
    low = _mm256_fnmadd_pd(f, times.low, low);
    high = _mm256_fnmadd_pd(f, times.high, high);
  }
  void divide(double by) {
    const __m256d d = _mm256_set1_pd(by);
    low = _mm256_div_pd(low, d);
    high = _mm256_div_pd(high, d);
  }
};

/// Columns of the factor from `first` on, at most kTogether of them, from their diagonals down.
struct FewColumns {
  std::array<const double*, kTogether> column;
  std::size_t count;

  FewColumns(const FrontColumns& front, std::size_t first)
      : count(std::min(kTogether, front.eliminated - first)) {
    for (std::size_t k = 0; k < count; ++k)
      column[k] = front.value.data() + trapezoid_entries(front.size, first + k) - (first + k);
  }
};

void solve_forward_wide(const FrontColumns& front, double* x, std::size_t width) {
  for (std::size_t first = 0; first < front.eliminated; first += kTogether) {
    const FewColumns few(front, first);
    for (std::size_t c = 0; c < width; c += kWideSolve) {
      std::array<Wide, kTogether> solved = {Wide(x + first * width + c), Wide(x + first * width + c),
                                            Wide(x + first * width + c), Wide(x + first * width + c)};
      for (std::size_t k = 0; k < few.count; ++k) {
        solved[k] = Wide(x + (first + k) * width + c);
        for (std::size_t before = 0; before < k; ++before)
          solved[k].subtract(few.column[before] + first + k, solved[before]);
        solved[k].divide(few.column[k][first + k]);
        solved[k].store(x + (first + k) * width + c);
      }
      if (few.count == kTogether) {
        for (std::size_t i = first + kTogether; i < front.size; ++i) {
          Wide row(x + i * width + c);
          for (std::size_t k = 0; k < kTogether; ++k) row.subtract(few.column[k] + i, solved[k]);
          row.store(x + i * width + c);
        }
      } else {
        for (std::size_t i = first + few.count; i < front.size; ++i) {
          Wide row(x + i * width + c);
          for (std::size_t k = 0; k < few.count; ++k) row.subtract(few.column[k] + i, solved[k]);
          row.store(x + i * width + c);
        }
      }
    }
  }
}

void solve_backward_wide(const FrontColumns& front, double* x, std::size_t width) {
  for (std::size_t first = (front.eliminated - 1) / kTogether * kTogether + kTogether; first > 0;) {
    first -= kTogether;
    const FewColumns few(front, first);
    for (std::size_t c = 0; c < width; c += kWideSolve) {
      std::array<Wide, kTogether> sum = {Wide(x + first * width + c), Wide(x + first * width + c),
                                         Wide(x + first * width + c), Wide(x + first * width + c)};
      for (std::size_t k = 1; k < few.count; ++k) sum[k] = Wide(x + (first + k) * width + c);
      if (few.count == kTogether) {
        for (std::size_t i = first + kTogether; i < front.size; ++i) {
          const Wide row(x + i * width + c);
          for (std::size_t k = 0; k < kTogether; ++k) sum[k].subtract(few.column[k] + i, row);
        }
      } else {
        for (std::size_t i = first + few.count; i < front.size; ++i) {
          const Wide row(x + i * width + c);
          for (std::size_t k = 0; k < few.count; ++k) sum[k].subtract(few.column[k] + i, row);
        }
      }
      for (std::size_t k = few.count; k-- > 0;) {
        for (std::size_t after = k + 1; after < few.count; ++after)
          sum[k].subtract(few.column[k] + first + after, sum[after]);
        sum[k].divide(few.column[k][first + k]);
        sum[k].store(x + (first + k) * width + c);
      }
    }
  }
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

std::ptrdiff_t eliminate_lu(DenseFront& front, std::span<const double> smallest,
                            std::span<std::int32_t> swapped, std::vector<double>& packed) {
  assert(front.value.size() == front.size * front.size && front.eliminated <= front.size &&
         smallest.size() == front.eliminated && swapped.size() == front.eliminated);
  for (std::size_t panel = 0; panel < front.eliminated; panel += kPanelRows) {
    const std::size_t end = std::min(front.eliminated, panel + kPanelRows);
    for (std::size_t inner = panel; inner < end; inner += kInnerColumns) {
      const std::size_t to = std::min(end, inner + kInnerColumns);
      if (const std::ptrdiff_t bad = eliminate_lu_columns(front, inner, to, smallest, swapped); bad >= 0)
        return bad;
      solve_rows(front, inner, to, end);
      subtract_lu_products(front, inner, to, end, packed);
    }
    solve_rows(front, panel, end, front.size);
    subtract_lu_products(front, panel, end, front.size, packed);
  }
  return -1;
}

std::size_t eliminate_lu_bytes(std::size_t size) {
  return sizeof(double) * 2 * slices(size) * kTileRows * std::min(size, kPanelRows);
}

void solve_forward(const FrontColumns& front, std::span<double> x, int width) {
  assert(front.value.size() == trapezoid_entries(front.size, front.eliminated));
  if (width >= kWideSolve) return solve_forward_wide(front, x.data(), static_cast<std::size_t>(width));
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
  if (width >= kWideSolve) return solve_backward_wide(front, x.data(), static_cast<std::size_t>(width));
  const double* column = front.value.data() + front.value.size();
  for (std::size_t j = front.eliminated; j-- > 0;) {
    const std::size_t below = front.size - j;
    column -= below;
    for (std::size_t c = 0; c < static_cast<std::size_t>(width); ++c) {
      double* at = x.data() + c * front.size + j;
      at[0] = (at[0] - inner_product(column + 1, at + 1, below - 1)) / column[0];
    }
  }
}

}  // namespace tessera
