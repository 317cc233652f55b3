#include "kernels/mesh/orientation_sign.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace tessera {
namespace {

constexpr double kHalfUlp = 0x1p-53;
/// Bounds of the error of a determinant, in sums of the sizes of its terms (Shewchuk's "A" filters).
constexpr double kBound2d = (3.0 + 16.0 * kHalfUlp) * kHalfUlp;
constexpr double kBound3d = (7.0 + 56.0 * kHalfUlp) * kHalfUlp;

/// high + low, without error.
struct Pair {
  double high, low;
};

Pair exact_sum(double a, double b) {
  const double sum = a + b, part = sum - a;
  return {sum, (a - (sum - part)) + (b - part)};
}

Pair exact_product(double a, double b) {
  const double product = a * b;
  return {product, std::fma(a, b, -product)};
}

/// An exact sum of doubles that do not overlap, ascending in size: the last one tells the sign.
template <std::size_t kCapacity>
class Expansion {
 public:
  void add(double x) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const Pair sum = exact_sum(x, part_[i]);
      x = sum.high;
      if (sum.low != 0.0) part_[kept++] = sum.low;
    }
    if (x != 0.0) part_[kept++] = x;
    size_ = kept;
  }
  int sign() const { return size_ == 0 ? 0 : part_[size_ - 1] > 0.0 ? 1 : -1; }

 private:
  std::array<double, kCapacity> part_;
  std::size_t size_ = 0;
};

/// a - b, without error.
std::array<double, 2> difference(double a, double b) {
  const Pair d = exact_sum(a, -b);
  return {d.high, d.low};
}

using Parts = std::array<double, 2>;

template <std::size_t kCapacity>
void add_product(Expansion<kCapacity>& sum, const Parts& a, const Parts& b, double sign) {
  for (const double x : a)
    for (const double y : b) {
      if (x == 0.0 || y == 0.0) continue;
      const Pair p = exact_product(x, y);
      sum.add(sign * p.low);
      sum.add(sign * p.high);
    }
}

template <std::size_t kCapacity>
void add_product(Expansion<kCapacity>& sum, const Parts& a, const Parts& b, const Parts& c, double sign) {
  for (const double x : a)
    for (const double y : b) {
      if (x == 0.0 || y == 0.0) continue;
      const Pair p = exact_product(x, y);
      for (const double z : c)
        for (const double part : {p.low, p.high}) {
          if (z == 0.0 || part == 0.0) continue;
          const Pair q = exact_product(part, z);
          sum.add(sign * q.low);
          sum.add(sign * q.high);
        }
    }
}

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic"
using Int128 = __int128;
using Unsigned128 = unsigned __int128;
#pragma GCC diagnostic pop

/// A sum of products of 192 bits.
class WideSum {
 public:
  void add_product(Int128 a, std::int64_t b) {
    const Unsigned128 size = a < 0 ? -static_cast<Unsigned128>(a) : static_cast<Unsigned128>(a);
    const std::uint64_t by = b < 0 ? -static_cast<std::uint64_t>(b) : static_cast<std::uint64_t>(b);
    const Unsigned128 low = Unsigned128{static_cast<std::uint64_t>(size)} * by;
    const auto high = static_cast<Int128>((size >> 64) * by + (low >> 64));
    const auto rest = static_cast<std::uint64_t>(low);
    if ((a < 0) == (b < 0)) {
      low_ += rest;
      high_ += high + (low_ < rest ? 1 : 0);
    } else {
      high_ -= high + (low_ < rest ? 1 : 0);
      low_ -= rest;
    }
  }
  int sign() const { return high_ < 0 ? -1 : high_ > 0 || low_ > 0 ? 1 : 0; }

 private:
  std::uint64_t low_ = 0;
  Int128 high_ = 0;
};

/// Of dot(cross(u, v), w), if all nine are whole multiples below 2^62 of one power of two, as differences of coordinates mostly
/// are.
std::optional<int> whole_number_sign(const Double3& u, const Double3& v, const Double3& w) {
  constexpr int kBits = 62;
  double size = 0.0;
  for (std::size_t k = 0; k < 3; ++k)
    size = std::max({size, std::fabs(u[k]), std::fabs(v[k]), std::fabs(w[k])});
  const double scale = std::ldexp(1.0, kBits - 1 - std::ilogb(size));
  const auto whole = [&](const Double3& x, std::array<std::int64_t, 3>& out) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double scaled = x[k] * scale;
      out[k] = static_cast<std::int64_t>(scaled);
      if (static_cast<double>(out[k]) != scaled) return false;
    }
    return true;
  };
  std::array<std::int64_t, 3> i, j, k;
  if (!std::isfinite(scale) || !whole(u, i) || !whole(v, j) || !whole(w, k)) return std::nullopt;
  WideSum sum;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t b = (a + 1) % 3, c = (a + 2) % 3;
    sum.add_product(Int128{i[b]} * j[c] - Int128{i[c]} * j[b], k[a]);
  }
  return sum.sign();
}

int exact_orient3d(const Double3& a, const Double3& b, const Double3& c, const Double3& d) {
  std::array<Parts, 3> u, v, w;
  for (std::size_t k = 0; k < 3; ++k) {
    u[k] = difference(b[k], a[k]);
    v[k] = difference(c[k], a[k]);
    w[k] = difference(d[k], a[k]);
  }
  const auto exact = [](const std::array<Parts, 3>& x) {
    return x[0][1] == 0.0 && x[1][1] == 0.0 && x[2][1] == 0.0;
  };
  const auto high = [](const std::array<Parts, 3>& x) { return Double3{x[0][0], x[1][0], x[2][0]}; };
  if (exact(u) && exact(v) && exact(w))
    if (const auto sign = whole_number_sign(high(u), high(v), high(w))) return *sign;
  Expansion<200> sum;  // at most 6 x 8 products of three, four doubles each
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t l = (k + 1) % 3, m = (k + 2) % 3;
    add_product(sum, u[l], v[m], w[k], 1.0);
    add_product(sum, u[m], v[l], w[k], -1.0);
  }
  return sum.sign();
}

int sign_of(double x) {
  return x > 0.0 ? 1 : x < 0.0 ? -1 : 0;
}

}  // namespace

int orient2d_sign(const Double2& a, const Double2& b, const Double2& c) {
  const double left = (b[0] - a[0]) * (c[1] - a[1]), right = (b[1] - a[1]) * (c[0] - a[0]);
  const double determinant = left - right, bound = kBound2d * (std::abs(left) + std::abs(right));
  if (std::abs(determinant) > bound || bound == 0.0) return sign_of(determinant);
  Expansion<20> sum;
  add_product(sum, difference(b[0], a[0]), difference(c[1], a[1]), 1.0);
  add_product(sum, difference(b[1], a[1]), difference(c[0], a[0]), -1.0);
  return sum.sign();
}

int orient3d_sign(const Double3& a, const Double3& b, const Double3& c, const Double3& d) {
  const Double3 u = b - a, v = c - a, w = d - a;
  double determinant = 0.0, size = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t l = (k + 1) % 3, m = (k + 2) % 3;
    const double left = u[l] * v[m], right = u[m] * v[l];
    determinant += (left - right) * w[k];
    size += (std::abs(left) + std::abs(right)) * std::abs(w[k]);
  }
  const double bound = kBound3d * size;
  if (std::abs(determinant) > bound || bound == 0.0) return sign_of(determinant);
  return exact_orient3d(a, b, c, d);
}

bool collinear(const Double3& a, const Double3& b, const Double3& c) {
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t l = (k + 1) % 3;
    if (orient2d_sign({a[k], a[l]}, {b[k], b[l]}, {c[k], c[l]}) != 0) return false;
  }
  return true;
}

}  // namespace tessera
