#include "kernels/boolean/exact_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

constexpr double kHalfUlp = 0x1p-53;

using Big3 = std::array<BigInt, 3>;

Big3 big_cross(const Big3& a, const Big3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
BigInt big_dot(const Big3& a, const Big3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Big3 big_minus(const Big3& a, const Big3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
/// b - a, times both denominators.
Big3 scaled_difference(const ExactPoint& a, const ExactPoint& b) {
  Big3 d;
  for (std::size_t k = 0; k < 3; ++k) d[k] = b.x[k] * a.w - a.x[k] * b.w;
  return d;
}

/// The exponent of the last bit of x that is set.
int last_bit(double x) {
  int exponent = 0;
  const double part = std::frexp(x, &exponent);
  const auto whole = static_cast<std::int64_t>(std::ldexp(part, 53));
  return exponent - 53 + __builtin_ctzll(static_cast<std::uint64_t>(whole));
}

/// (s q - t p) / (s - t): where a line from p to q is zero of what is s at p and t at q.
ExactPoint zero_between(const Big3& p, const Big3& q, const BigInt& s, const BigInt& t) {
  ExactPoint out;
  const bool falls = s > t;
  out.w = falls ? s - t : t - s;
  for (std::size_t k = 0; k < 3; ++k) {
    out.x[k] = s * q[k] - t * p[k];
    if (!falls) out.x[k] = -out.x[k];
  }
  return out;
}

BigInt big_orient2d(const Big3& a, const Big3& b, const Big3& c, std::size_t u, std::size_t v) {
  return (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]);
}

}  // namespace

ExactGrid::ExactGrid(std::span<const Double3> points) {
  int least = std::numeric_limits<int>::max();
  for (const Double3& p : points)
    for (const double x : p)
      if (x != 0.0) least = std::min(least, last_bit(x));
  exponent_ = least == std::numeric_limits<int>::max() ? 0 : least;
}

BigInt ExactGrid::steps(double x) const {
  if (x == 0.0) return 0;
  const int bit = last_bit(x);
  BigInt n = static_cast<std::int64_t>(std::ldexp(x, -bit));
  n <<= static_cast<unsigned>(bit - exponent_);
  return n;
}

Big3 ExactGrid::steps(const Double3& p) const {
  return {steps(p[0]), steps(p[1]), steps(p[2])};
}

ExactPoint ExactGrid::point(const Double3& p) const {
  return {steps(p), 1};
}

Double3 ExactGrid::rounded(const ExactPoint& p) const {
  constexpr int kBits = 55;  // two more than a double holds: the last one tells whether anything follows
  Double3 out;
  for (std::size_t k = 0; k < 3; ++k) {
    const bool negative = p.x[k] < 0;
    BigInt n = negative ? BigInt(-p.x[k]) : p.x[k], w = p.w;
    if (n == 0) {
      out[k] = 0.0;
      continue;
    }
    const int shift = kBits + static_cast<int>(boost::multiprecision::msb(w)) -
                      static_cast<int>(boost::multiprecision::msb(n));
    if (shift >= 0) {
      n <<= static_cast<unsigned>(shift);
    } else {
      w <<= static_cast<unsigned>(-shift);
    }
    BigInt quotient, rest;
    boost::multiprecision::divide_qr(n, w, quotient, rest);
    auto whole = quotient.convert_to<std::uint64_t>();
    if (rest != 0) whole |= 1;
    const double size = std::ldexp(static_cast<double>(whole), exponent_ - shift);
    out[k] = negative ? -size : size;
  }
  return out;
}

ExactPoint ExactGrid::on_plane(const Double3& p, const Double3& q, const Double3& a, const Double3& b,
                               const Double3& c) const {
  const Big3 from = steps(p), to = steps(q), at = steps(a);
  const Big3 normal = big_cross(big_minus(steps(b), at), big_minus(steps(c), at));
  return zero_between(from, to, big_dot(normal, big_minus(from, at)), big_dot(normal, big_minus(to, at)));
}

ExactPoint ExactGrid::on_line(const Double3& p, const Double3& q, const Double3& a, const Double3& b) const {
  const Big3 from = steps(p), to = steps(q), c = steps(a), d = steps(b);
  for (std::size_t k = 0;; ++k) {
    const std::size_t u = (k + 1) % 3, v = (k + 2) % 3;
    const BigInt s = big_orient2d(c, d, from, u, v), t = big_orient2d(c, d, to, u, v);
    if (s != t || k == 2) return zero_between(from, to, s, t);
  }
}

PointTable::PointTable(std::vector<Double3> given)
    : grid_(given), given_(given.size()), near_(std::move(given)) {}

std::uint32_t PointTable::add(ExactPoint made) {
  near_.push_back(grid_.rounded(made));
  made_.push_back(std::move(made));
  return static_cast<std::uint32_t>(near_.size() - 1);
}

std::uint32_t PointTable::add_middle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  const ExactPoint p = exact(a), q = exact(b), r = exact(c);
  ExactPoint middle;
  for (std::size_t k = 0; k < 3; ++k)
    middle.x[k] = p.x[k] * (q.w * r.w) + q.x[k] * (p.w * r.w) + r.x[k] * (p.w * q.w);
  middle.w = 3 * (p.w * q.w) * r.w;
  return add(std::move(middle));
}

int PointTable::orient2d(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::size_t u,
                         std::size_t v) const {
  const Double3 &p = near_[a], &q = near_[b], &r = near_[c];
  if (is_given(a) && is_given(b) && is_given(c))
    return orient2d_sign({p[u], p[v]}, {q[u], q[v]}, {r[u], r[v]});
  const double size = std::max(
      {std::fabs(p[u]), std::fabs(q[u]), std::fabs(r[u]), std::fabs(p[v]), std::fabs(q[v]), std::fabs(r[v])});
  const double qu = q[u] - p[u], qv = q[v] - p[v], ru = r[u] - p[u], rv = r[v] - p[v];
  const double determinant = qu * rv - qv * ru;
  // A difference is off by 4 of these: each coordinate by one, and its own rounding by at most two.
  const double off = kHalfUlp * size;
  const double bound =
      16.0 * off * (std::fabs(qu) + std::fabs(qv) + std::fabs(ru) + std::fabs(rv)) + 64.0 * off * off;
  if (std::fabs(determinant) > bound) return determinant > 0.0 ? 1 : -1;
  const ExactPoint i = exact(a), j = exact(b), k = exact(c);
  const BigInt left = (j.x[u] * i.w - i.x[u] * j.w) * (k.x[v] * i.w - i.x[v] * k.w);
  const BigInt right = (j.x[v] * i.w - i.x[v] * j.w) * (k.x[u] * i.w - i.x[u] * k.w);
  return left.compare(right) > 0 ? 1 : left == right ? 0 : -1;
}

int PointTable::orient3d(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) const {
  if (is_given(a) && is_given(b) && is_given(c) && is_given(d))
    return orient3d_sign(near_[a], near_[b], near_[c], near_[d]);
  const Double3 p = near_[b] - near_[a], q = near_[c] - near_[a], r = near_[d] - near_[a];
  double size = 0.0, wide = 0.0;
  for (const std::uint32_t i : {a, b, c, d})
    for (const double x : near_[i]) size = std::max(size, std::fabs(x));
  for (std::size_t k = 0; k < 3; ++k)
    wide = std::max({wide, std::fabs(p[k]), std::fabs(q[k]), std::fabs(r[k])});
  const double determinant = dot(cross(p, q), r), off = kHalfUlp * size;
  // Six products of three differences, each difference off by 4 of these, and their rounding.
  if (std::fabs(determinant) > 200.0 * off * wide * wide + 1e4 * off * off * (off + wide))
    return determinant > 0.0 ? 1 : -1;
  const ExactPoint i = exact(a);
  return big_dot(big_cross(scaled_difference(i, exact(b)), scaled_difference(i, exact(c))),
                 scaled_difference(i, exact(d)))
      .sign();
}

}  // namespace tessera
