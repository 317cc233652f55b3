#include "octree/multipole.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

/// Sums in units of one cell's edge, about one centre; symmetric tensors, not yet traceless.
/// b = xx xy xz yy yz zz, c = xxx xxy xxz xyy xyz xzz yyy yyz yzz zzz.
struct Moments {
  std::array<double, 3> a{};
  std::array<double, 6> b{};
  std::array<double, 10> c{};

  /// Adds what stands about a centre displaced by t from ours.
  void add(const Moments& o, const Double3& t) {
    const auto [x, y, z] = t;
    const auto& m = o.a;
    const auto& s = o.b;
    for (std::size_t i = 0; i < 3; ++i) a[i] += m[i];
    b[0] += s[0] + m[0] * x;
    b[1] += s[1] + 0.5 * (m[0] * y + m[1] * x);
    b[2] += s[2] + 0.5 * (m[0] * z + m[2] * x);
    b[3] += s[3] + m[1] * y;
    b[4] += s[4] + 0.5 * (m[1] * z + m[2] * y);
    b[5] += s[5] + m[2] * z;
    c[0] += o.c[0] + s[0] * x + 0.5 * m[0] * x * x;
    c[1] += o.c[1] + (s[0] * y + 2.0 * s[1] * x) / 3.0 + (2.0 * m[0] * x * y + m[1] * x * x) / 6.0;
    c[2] += o.c[2] + (s[0] * z + 2.0 * s[2] * x) / 3.0 + (2.0 * m[0] * x * z + m[2] * x * x) / 6.0;
    c[3] += o.c[3] + (s[3] * x + 2.0 * s[1] * y) / 3.0 + (2.0 * m[1] * x * y + m[0] * y * y) / 6.0;
    c[4] +=
        o.c[4] + (s[1] * z + s[2] * y + s[4] * x) / 3.0 + (m[0] * y * z + m[1] * x * z + m[2] * x * y) / 6.0;
    c[5] += o.c[5] + (s[5] * x + 2.0 * s[2] * z) / 3.0 + (2.0 * m[2] * x * z + m[0] * z * z) / 6.0;
    c[6] += o.c[6] + s[3] * y + 0.5 * m[1] * y * y;
    c[7] += o.c[7] + (s[3] * z + 2.0 * s[4] * y) / 3.0 + (2.0 * m[1] * y * z + m[2] * y * y) / 6.0;
    c[8] += o.c[8] + (s[5] * y + 2.0 * s[4] * z) / 3.0 + (2.0 * m[2] * y * z + m[1] * z * z) / 6.0;
    c[9] += o.c[9] + s[5] * z + 0.5 * m[2] * z * z;
  }

  /// From the stored, traceless form of a cell whose edge is `ratio` of ours.
  static Moments of(const Multipole& p, double ratio) {
    Moments o;
    const double r2 = ratio * ratio, r3 = r2 * ratio, r4 = r2 * r2;
    for (std::size_t i = 0; i < 3; ++i) o.a[i] = double{p.first[i]} * r2;
    const auto& s = p.second;
    o.b = {s[0] * r3, s[2] * r3, s[3] * r3, s[1] * r3, s[4] * r3, -(double{s[0]} + double{s[1]}) * r3};
    const auto& t = p.third;
    const double xzz = -(double{t[0]} + double{t[3]}), yzz = -(double{t[1]} + double{t[2]}),
                 zzz = -(double{t[4]} + double{t[5]});
    o.c = {t[0] * r4, t[2] * r4, t[4] * r4, t[3] * r4, t[6] * r4,
           xzz * r4,  t[1] * r4, t[5] * r4, yzz * r4,  zzz * r4};
    return o;
  }

  void store(Multipole& out) const {
    for (std::size_t i = 0; i < 3; ++i) out.first[i] = static_cast<float>(a[i]);
    const double third = (b[0] + b[3] + b[5]) / 3.0;
    const std::array<double, 5> two = {b[0] - third, b[3] - third, b[1], b[2], b[4]};
    for (std::size_t i = 0; i < 5; ++i) out.second[i] = static_cast<float>(two[i]);
    const double tx = (c[0] + c[3] + c[5]) / 5.0, ty = (c[1] + c[6] + c[8]) / 5.0,
                 tz = (c[2] + c[7] + c[9]) / 5.0;
    const std::array<double, 7> three = {c[0] - 3.0 * tx, c[6] - 3.0 * ty, c[1] - ty, c[3] - tx,
                                         c[2] - tz,       c[7] - tz,       c[4]};
    for (std::size_t i = 0; i < 7; ++i) out.third[i] = static_cast<float>(three[i]);
  }
};

/// Cells from a centre to a point, in edges of a cell of level `bits`.
Double3 displacement(const Int3& from, const Int3& to, int bits) {
  const double scale = 1.0 / (double{kQuantaPerCell} * static_cast<double>(std::int64_t{1} << bits));
  Double3 t;
  for (std::size_t i = 0; i < 3; ++i)
    t[i] = (static_cast<double>(to[i]) - static_cast<double>(from[i])) * scale;
  return t;
}

/// s += w t t
void add_square(std::array<double, 6>& s, double w, const Double3& t) {
  s[0] += w * t[0] * t[0];
  s[1] += w * t[1] * t[1];
  s[2] += w * t[2] * t[2];
  s[3] += w * t[0] * t[1];
  s[4] += w * t[0] * t[2];
  s[5] += w * t[1] * t[2];
}

Int3 rounded(const Double3& sum, double weight) {
  Int3 q;
  for (std::size_t i = 0; i < 3; ++i) q[i] = static_cast<std::int32_t>(std::floor(sum[i] / weight + 0.5));
  return q;
}

std::uint32_t saturated(std::uint64_t count) {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(count, std::numeric_limits<std::uint32_t>::max()));
}

/// Index of the first element that is not in the cell, given that of the first one that is.
template <typename KeyOf>
std::size_t cell_end(std::size_t begin, std::size_t size, std::uint64_t key, const KeyOf& key_of) {
  while (begin < size && key_of(begin) == key) ++begin;
  return begin;
}

}  // namespace

Multipole multipole_of(std::span<const Dipole> dipoles, int bits) {
  assert(!dipoles.empty());
  Multipole out;
  out.key = cell_key(dipoles.front().q, bits);
  out.points = saturated(dipoles.size());
  double weight = 0.0;
  Double3 sum = {0, 0, 0};
  for (const Dipole& d : dipoles) {
    const double x = double{d.moment[0]}, y = double{d.moment[1]}, z = double{d.moment[2]};
    const double w = std::sqrt(x * x + y * y + z * z);
    weight += w;
    for (std::size_t i = 0; i < 3; ++i) sum[i] += w * static_cast<double>(d.q[i]);
  }
  out.weight = static_cast<float>(weight);
  out.centre = weight > 0.0 ? rounded(sum, weight) : dipoles.front().q;
  const double area = 1.0 / static_cast<double>(std::int64_t{1} << (2 * bits));
  Moments moments, one;
  double flux = 0.0;
  std::array<double, 6> spread{};
  for (const Dipole& d : dipoles) {
    for (std::size_t i = 0; i < 3; ++i) one.a[i] = double{d.moment[i]} * area;
    const Double3 t = displacement(out.centre, d.q, bits);
    moments.add(one, t);
    flux += dot(one.a, t);
    add_square(spread, std::sqrt(dot(one.a, one.a)), t);
  }
  moments.store(out);
  out.flux = static_cast<float>(flux);
  for (std::size_t i = 0; i < 6; ++i) out.spread[i] = static_cast<float>(spread[i]);
  return out;
}

Multipole merge_multipoles(std::span<const Multipole> children, int bits) {
  assert(!children.empty());
  Multipole out;
  out.key = children.front().key >> 3;
  double weight = 0.0;
  Double3 sum = {0, 0, 0};
  std::uint64_t points = 0;
  for (const Multipole& c : children) {
    points += c.points;
    weight += double{c.weight};
    for (std::size_t i = 0; i < 3; ++i) sum[i] += double{c.weight} * static_cast<double>(c.centre[i]);
  }
  out.points = saturated(points);
  out.weight = static_cast<float>(weight);
  out.centre = weight > 0.0 ? rounded(sum, weight) : children.front().centre;
  Moments moments;
  double flux = 0.0;
  std::array<double, 6> spread{};
  const double area = 1.0 / static_cast<double>(std::int64_t{1} << (2 * bits));
  for (const Multipole& c : children) {
    const Moments one = Moments::of(c, 0.5);
    const Double3 t = displacement(out.centre, c.centre, bits);
    moments.add(one, t);
    flux += double{c.flux} * 0.125 + dot(one.a, t);
    for (std::size_t i = 0; i < 6; ++i) spread[i] += double{c.spread[i]} * 0.0625;
    add_square(spread, double{c.weight} * area, t);
  }
  moments.store(out);
  out.flux = static_cast<float>(flux);
  for (std::size_t i = 0; i < 6; ++i) out.spread[i] = static_cast<float>(spread[i]);
  return out;
}

MultipoleTree::MultipoleTree(std::vector<Dipole> dipoles, int leaf_bits, int top_bits)
    : leaf_bits_(leaf_bits), dipoles_(std::move(dipoles)) {
  Level leaves;
  const auto key_of = [&](std::size_t i) { return cell_key(dipoles_[i].q, leaf_bits); };
  for (std::size_t begin = 0; begin < dipoles_.size();) {
    const std::size_t end = cell_end(begin, dipoles_.size(), key_of(begin), key_of);
    leaves.cells.push_back(multipole_of(std::span(dipoles_).subspan(begin, end - begin), leaf_bits));
    begin = end;
  }
  levels_.push_back(std::move(leaves));
  attach_dipoles();
  build_upwards(top_bits);
}

MultipoleTree::MultipoleTree(std::vector<Multipole> leaves, std::vector<Dipole> dipoles, int leaf_bits,
                             int top_bits)
    : leaf_bits_(leaf_bits), dipoles_(std::move(dipoles)) {
  levels_.push_back({std::move(leaves), {}});
  attach_dipoles();
  build_upwards(top_bits);
}

void MultipoleTree::attach_dipoles() {
  Level& leaves = levels_.front();
  leaves.first_child.assign(leaves.cells.size() + 1, 0);
  std::size_t next = 0;
  for (std::size_t c = 0; c < leaves.cells.size(); ++c) {
    leaves.first_child[c] = static_cast<std::uint32_t>(next);
    assert(c == 0 || leaves.cells[c - 1].key < leaves.cells[c].key);
    next = cell_end(next, dipoles_.size(), leaves.cells[c].key,
                    [&](std::size_t i) { return cell_key(dipoles_[i].q, leaf_bits_); });
  }
  leaves.first_child.back() = static_cast<std::uint32_t>(next);
  assert(next == dipoles_.size() && "every dipole lies in a leaf, in canonical order");
}

void MultipoleTree::build_upwards(int top_bits) {
  for (int bits = leaf_bits_ + 1; bits <= top_bits; ++bits) {
    const std::vector<Multipole>& below = levels_.back().cells;
    Level level;
    for (std::size_t begin = 0; begin < below.size();) {
      const std::size_t end = cell_end(begin, below.size(), below[begin].key >> 3,
                                       [&](std::size_t i) { return below[i].key >> 3; });
      level.first_child.push_back(static_cast<std::uint32_t>(begin));
      level.cells.push_back(merge_multipoles(std::span(below).subspan(begin, end - begin), bits));
      begin = end;
    }
    level.first_child.push_back(static_cast<std::uint32_t>(below.size()));
    levels_.push_back(std::move(level));
  }
}

std::uint64_t MultipoleTree::bytes() const {
  std::uint64_t sum = dipoles_.size() * sizeof(Dipole);
  for (const Level& l : levels_) sum += l.cells.size() * sizeof(Multipole) + l.first_child.size() * 4;
  return sum;
}

}  // namespace tessera
