#include "solvers/sparse_matrix.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxEntries = std::numeric_limits<std::int32_t>::max();

template <int kWidth>
void multiply_rows(const SparseMatrix& a, const double* x, double* y) {
  for (std::int32_t i = 0; i < a.rows; ++i) {
    std::array<double, kWidth> s{};
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e) {
      const double* xj = x + static_cast<std::size_t>(a.column[e]) * kWidth;
      for (int c = 0; c < kWidth; ++c) s[c] += a.value[e] * xj[c];
    }
    for (int c = 0; c < kWidth; ++c) y[static_cast<std::size_t>(i) * kWidth + c] = s[c];
  }
}

}  // namespace

double entry(const SparseMatrix& a, std::int32_t row, std::int32_t column) {
  const auto first = a.column.begin() + a.start[row], last = a.column.begin() + a.start[row + 1];
  const auto it = std::lower_bound(first, last, column);
  return it != last && *it == column ? a.value[it - a.column.begin()] : 0.0;
}

void multiply(const SparseMatrix& a, std::span<const double> x, std::span<double> y, int width) {
  const auto w = static_cast<std::size_t>(width);
  assert(width >= 1 && x.size() == a.columns * w && y.size() == a.rows * w);
  if (width == 1) return multiply_rows<1>(a, x.data(), y.data());
  if (width == 2) return multiply_rows<2>(a, x.data(), y.data());
  if (width == 3) return multiply_rows<3>(a, x.data(), y.data());
  if (width == 4) return multiply_rows<4>(a, x.data(), y.data());
  for (std::int32_t i = 0; i < a.rows; ++i) {
    double* yi = y.data() + i * w;
    std::fill(yi, yi + w, 0.0);
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e) {
      const double* xj = x.data() + a.column[e] * w;
      for (std::size_t c = 0; c < w; ++c) yi[c] += a.value[e] * xj[c];
    }
  }
}

SparseMatrix transpose(const SparseMatrix& a) {
  SparseMatrix t;
  t.rows = a.columns;
  t.columns = a.rows;
  t.start.assign(static_cast<std::size_t>(a.columns) + 1, 0);
  for (const std::int32_t j : a.column) ++t.start[j + 1];
  for (std::int32_t j = 0; j < a.columns; ++j) t.start[j + 1] += t.start[j];
  t.column.resize(a.entries());
  t.value.resize(a.entries());
  std::vector<std::int32_t> next(t.start.begin(), t.start.end() - 1);
  for (std::int32_t i = 0; i < a.rows; ++i)
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e) {
      const std::int32_t to = next[a.column[e]]++;
      t.column[to] = i;
      t.value[to] = a.value[e];
    }
  return t;
}

SparseMatrix product(const SparseMatrix& a, const SparseMatrix& b, std::span<const double> middle) {
  assert(a.columns == b.rows);
  assert(middle.empty() || middle.size() == static_cast<std::size_t>(b.rows));
  SparseMatrix p;
  p.rows = a.rows;
  p.columns = b.columns;
  p.start.assign(static_cast<std::size_t>(a.rows) + 1, 0);
  std::vector<std::int32_t> seen(static_cast<std::size_t>(b.columns), -1);
  std::size_t entries = 0;
  for (std::int32_t i = 0; i < a.rows; ++i) {
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e)
      for (std::int32_t f = b.start[a.column[e]]; f < b.start[a.column[e] + 1]; ++f)
        if (seen[b.column[f]] != i) {
          seen[b.column[f]] = i;
          ++entries;
        }
    if (entries > kMaxEntries)
      throw ResourceError("a sparse product has more than 2^31 entries: use fewer unknowns or a lower order");
    p.start[i + 1] = static_cast<std::int32_t>(entries);
  }
  p.column.resize(entries);
  p.value.resize(entries);
  std::fill(seen.begin(), seen.end(), -1);
  std::vector<double> row(static_cast<std::size_t>(b.columns), 0.0);
  for (std::int32_t i = 0; i < a.rows; ++i) {
    std::int32_t end = p.start[i];
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e) {
      const std::int32_t k = a.column[e];
      const double w = middle.empty() ? a.value[e] : a.value[e] * middle[k];
      for (std::int32_t f = b.start[k]; f < b.start[k + 1]; ++f) {
        const std::int32_t j = b.column[f];
        if (seen[j] != i) {
          seen[j] = i;
          p.column[end++] = j;
          row[j] = w * b.value[f];
        } else {
          row[j] += w * b.value[f];
        }
      }
    }
    std::sort(p.column.begin() + p.start[i], p.column.begin() + end);
    for (std::int32_t e = p.start[i]; e < end; ++e) p.value[e] = row[p.column[e]];
  }
  return p;
}

SparseMatrix sum(double alpha, const SparseMatrix& a, double beta, const SparseMatrix& b) {
  assert(a.rows == b.rows && a.columns == b.columns);
  SparseMatrix s;
  s.rows = a.rows;
  s.columns = a.columns;
  s.start.assign(static_cast<std::size_t>(a.rows) + 1, 0);
  s.column.reserve(std::max(a.entries(), b.entries()));
  s.value.reserve(s.column.capacity());
  for (std::int32_t i = 0; i < a.rows; ++i) {
    std::int32_t e = a.start[i], f = b.start[i];
    while (e < a.start[i + 1] || f < b.start[i + 1]) {
      const std::int32_t j = e < a.start[i + 1] ? a.column[e] : a.columns;
      const std::int32_t k = f < b.start[i + 1] ? b.column[f] : b.columns;
      double v = 0.0;
      if (j <= k) v += alpha * a.value[e++];
      if (k <= j) v += beta * b.value[f++];
      s.column.push_back(std::min(j, k));
      s.value.push_back(v);
    }
    if (s.entries() > kMaxEntries) throw ResourceError("a sparse sum has more than 2^31 entries");
    s.start[i + 1] = static_cast<std::int32_t>(s.entries());
  }
  return s;
}

SparseMatrix diagonal_matrix(std::span<const double> d) {
  SparseMatrix m;
  m.rows = m.columns = static_cast<std::int32_t>(d.size());
  m.start.resize(d.size() + 1);
  m.column.resize(d.size());
  m.value.assign(d.begin(), d.end());
  for (std::int32_t i = 0; i < m.rows; ++i) {
    m.start[i + 1] = i + 1;
    m.column[i] = i;
  }
  return m;
}

SparseMatrix select(const SparseMatrix& a, std::span<const std::int32_t> rows,
                    std::span<const std::int32_t> new_column, std::int32_t columns) {
  assert(new_column.size() == static_cast<std::size_t>(a.columns));
  SparseMatrix s;
  s.rows = static_cast<std::int32_t>(rows.size());
  s.columns = columns;
  s.start.assign(rows.size() + 1, 0);
  std::size_t entries = 0;
  for (const std::int32_t i : rows)
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e) entries += new_column[a.column[e]] >= 0;
  s.column.reserve(entries);
  s.value.reserve(entries);
  for (std::int32_t r = 0; r < s.rows; ++r) {
    for (std::int32_t e = a.start[rows[r]]; e < a.start[rows[r] + 1]; ++e) {
      const std::int32_t j = new_column[a.column[e]];
      if (j < 0) continue;
      s.column.push_back(j);
      s.value.push_back(a.value[e]);
    }
    s.start[r + 1] = static_cast<std::int32_t>(s.column.size());
  }
  return s;
}

bool all_finite(std::span<const double> values) {
  // NaN and infinity give NaN, everything else 0: one test at the end.
  double s = 0.0;
  for (const double v : values) s += v * 0.0;
  return s == 0.0;
}

namespace {

/// Of `W` columns, or of any number where W is 0: a number that the compiler knows keeps the sums in registers.
template <std::size_t W>
double residual_of(const SparseMatrix& a, std::span<const double> x, std::span<const double> b,
                   std::size_t width) {
  const std::size_t w = W > 0 ? W : width;
  std::vector<double> rr(w, 0.0), bb(w, 0.0), more(W > 0 ? 0 : w);
  std::array<double, W> few;
  double* const row = W > 0 ? few.data() : more.data();
  for (std::int32_t i = 0; i < a.rows; ++i) {
    for (std::size_t c = 0; c < w; ++c) row[c] = b[i * w + c];
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e)
      for (std::size_t c = 0; c < w; ++c) row[c] -= a.value[e] * x[a.column[e] * w + c];
    for (std::size_t c = 0; c < w; ++c) {
      rr[c] += row[c] * row[c];
      bb[c] += b[i * w + c] * b[i * w + c];
    }
  }
  double worst = 0.0;
  for (std::size_t c = 0; c < w; ++c) {
    const double r = std::sqrt(rr[c]) / (bb[c] > 0.0 ? std::sqrt(bb[c]) : 1.0);
    if (!(r <= worst)) worst = r;  // a NaN stays
  }
  return worst;
}

}  // namespace

double relative_residual(const SparseMatrix& a, std::span<const double> x, std::span<const double> b,
                         int width) {
  const auto w = static_cast<std::size_t>(width);
  assert(b.size() == a.rows * w && x.size() == a.columns * w);
  return w == 1   ? residual_of<1>(a, x, b, w)
         : w == 3 ? residual_of<3>(a, x, b, w)
                  : residual_of<0>(a, x, b, w);
}

SparseMatrix real_form(const SparseMatrix& a, const SparseMatrix& skew) {
  SparseMatrix m;
  m.rows = m.columns = 2 * a.rows;
  m.start.reserve(2 * static_cast<std::size_t>(a.rows) + 1);
  m.column.reserve(2 * (a.entries() + skew.entries()));
  m.value.reserve(m.column.capacity());
  m.start.push_back(0);
  std::vector<std::pair<std::int32_t, double>> row;
  for (std::int32_t i = 0; i < a.rows; ++i)
    for (const int part : {0, 1}) {
      row.clear();
      for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e)
        row.emplace_back(2 * a.column[e] + part, a.value[e]);
      for (std::int32_t e = skew.start[i]; e < skew.start[i + 1]; ++e)
        row.emplace_back(2 * skew.column[e] + 1 - part, part == 0 ? -skew.value[e] : skew.value[e]);
      std::sort(row.begin(), row.end());
      for (const auto& [column, value] : row) {
        m.column.push_back(column);
        m.value.push_back(value);
      }
      m.start.push_back(static_cast<std::int32_t>(m.column.size()));
    }
  return m;
}

}  // namespace tessera
