#include "octree/quadric_field.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "octree/leaf_queries.h"
#include "octree/small_matrix.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Weight of the sphere in the fit of the quadric, in squared extents of the samples.
constexpr double kRidge = 0.02;

/// A cube and how far from it its cell counts as a whole: not at all within half an edge, fully from one edge on.
struct Taper {
  float low[3], high[3];
  float inverse_edge2;
};
/// Sums over a cell about its centre, relative to the leaf's corner, in cells.
struct Part {
  float x, y, z;
  float weight;
  std::array<float, 3> normal;
  std::array<float, 6> normal_moment;  ///< xx yy zz xy xz yz of the symmetric part of sum of m e
  std::array<float, 6> spread;         ///< likewise of sum of area e e
};

/// What the queries of one leaf see: parts of one parent in a row.
struct VisibleParts {
  struct Run {
    std::size_t end;     ///< of its parts
    std::int32_t own;    ///< taper of its one part, -1: counts fully
    std::int32_t above;  ///< taper of the parent, -1: counts not at all
  };
  std::vector<Part> parts;
  std::vector<Run> runs;
  std::vector<Taper> tapers;
};

class ListBuilder {
 public:
  ListBuilder(const MultipoleTree& far, const MultipoleTree* near, VisibleParts& out)
      : far_(far), near_(near), out_(out), finest_(finest_bits(far, near)) {}

  /// \param cell  coordinates of the leaf on the finest level
  void build(const Int3& cell) {
    cell_ = cell;
    out_.parts.clear();
    out_.runs.clear();
    out_.tapers.clear();
    visit(far_, far_.top_bits(), 0, far_.level(far_.top_bits()).cells.size(), -1);
  }

 private:
  /// \param above  taper of the cell around
  void visit(const MultipoleTree& tree, int bits, std::size_t begin, std::size_t end, std::int32_t above) {
    const MultipoleTree::Level& level = tree.level(bits);
    for (std::size_t c = begin; c < end; ++c) {
      const Multipole& m = level.cells[c];
      const Taper taper = make_taper(m.key, bits);
      const auto [nearest, farthest] = squared_range(taper);
      if (nearest * taper.inverse_edge2 >= 1.0f) {
        add(m, bits, -1, above);
        continue;
      }
      std::int32_t own = -1;
      if (farthest * taper.inverse_edge2 > 0.25f) {
        own = static_cast<std::int32_t>(out_.tapers.size());
        out_.tapers.push_back(taper);
        add(m, bits, own, above);
      }
      if (bits > tree.leaf_bits()) {
        visit(tree, bits - 1, level.first_child[c], level.first_child[c + 1], own);
      } else if (&tree == &far_ && near_) {
        const auto [first, last] = near_children(*near_, m.key);
        visit(*near_, near_->top_bits() - 1, first, last, own);
      } else {
        assert(level.first_child[c + 1] - level.first_child[c] == m.points &&
               "adjacent leaves have their dipoles");
        for (std::size_t i = level.first_child[c]; i < level.first_child[c + 1]; ++i)
          add(tree.dipoles()[i], own);
      }
    }
  }

  Taper make_taper(std::uint64_t key, int bits) const {
    const auto at = morton_decode(key);
    Taper t;
    const auto edge = static_cast<float>(std::int64_t{1} << bits);
    for (std::size_t a = 0; a < 3; ++a) {
      t.low[a] = static_cast<float>((static_cast<std::int64_t>(at[a]) << bits) -
                                    (static_cast<std::int64_t>(cell_[a]) << finest_));
      t.high[a] = t.low[a] + edge;
    }
    t.inverse_edge2 = 1.0f / (edge * edge);
    return t;
  }
  /// Least and largest squared distance of a point of the leaf from the cube.
  std::pair<float, float> squared_range(const Taper& t) const {
    const auto edge = static_cast<float>(std::int64_t{1} << finest_);
    float nearest = 0.0f, farthest = 0.0f;
    for (std::size_t a = 0; a < 3; ++a) {
      const float n = std::max({t.low[a] - edge, -t.high[a], 0.0f});
      const float f = std::max({t.low[a], edge - t.high[a], 0.0f});
      nearest += n * n;
      farthest += f * f;
    }
    return {nearest, farthest};
  }

  void push(const Part& part, std::int32_t own, std::int32_t above) {
    out_.parts.push_back(part);
    if (own < 0 && !out_.runs.empty() && out_.runs.back().own < 0 && out_.runs.back().above == above)
      out_.runs.back().end = out_.parts.size();
    else
      out_.runs.push_back({out_.parts.size(), own, above});
  }
  void add(const Multipole& m, int bits, std::int32_t own, std::int32_t above) {
    const Float3 p = relative_to_leaf(m.centre, cell_, finest_);
    const auto edge = static_cast<float>(std::int64_t{1} << bits);
    const float e2 = edge * edge, e3 = e2 * edge, e4 = e2 * e2;
    Part part{p[0], p[1], p[2], m.weight, m.first * e2, {}, {}};
    const float third = m.flux * (1.0f / 3.0f);
    part.normal_moment = {m.second[0] + third, m.second[1] + third, third - (m.second[0] + m.second[1]),
                          m.second[2],         m.second[3],         m.second[4]};
    for (float& v : part.normal_moment) v *= e3;
    for (std::size_t i = 0; i < 6; ++i) part.spread[i] = m.spread[i] * e4;
    push(part, own, above);
  }
  void add(const Dipole& d, std::int32_t above) {
    const Float3 p = relative_to_leaf(d.q, cell_, finest_);
    const Float3& n = d.moment;
    push({p[0], p[1], p[2], norm(n), n, {}, {}}, -1, above);
  }

  const MultipoleTree& far_;
  const MultipoleTree* near_;
  VisibleParts& out_;
  int finest_;
  Int3 cell_ = {0, 0, 0};
};

constexpr std::size_t kSums = 19;  // weight, p, n, turn, spread

/// Weighted sums about each of eight queries.
struct Sums {
  Pack sum[kSums] = {};
};

/// 0 within half an edge of the cube, 1 beyond a whole one, smooth between.
Pack taper_at(const Taper& t, Pack qx, Pack qy, Pack qz) {
  const Pack zero = _mm256_setzero_ps();
  const auto beyond = [&](std::size_t a, Pack q) {
    return _mm256_max_ps(_mm256_max_ps(all(t.low[a]) - q, q - all(t.high[a])), zero);
  };
  const Pack x = beyond(0, qx), y = beyond(1, qy), z = beyond(2, qz);
  const Pack u = (x * x + y * y + z * z) * all(t.inverse_edge2);
  const Pack s = _mm256_min_ps(_mm256_max_ps((u - all(0.25f)) * all(1.0f / 0.75f), zero), all(1.0f));
  return s * s * (all(3.0f) - all(2.0f) * s);
}

template <bool kTapered>
void add_parts(std::span<const Part> parts, Pack factor, Pack qx, Pack qy, Pack qz, Pack core2, Sums& sums) {
  for (const Part& p : parts) {
    const Pack x = all(p.x) - qx, y = all(p.y) - qy, z = all(p.z) - qz;
    const Pack d2 = x * x + y * y + z * z;
    const Pack q = all(1.0f) / (d2 + core2);
    Pack w = q * q * q * q;
    if constexpr (kTapered) w *= factor;
    const Pack wa = w * all(p.weight);
    sums.sum[0] += wa;
    const Pack ax = wa * x, ay = wa * y, az = wa * z;
    sums.sum[1] += ax;
    sums.sum[2] += ay;
    sums.sum[3] += az;
    const Pack nx = w * all(p.normal[0]), ny = w * all(p.normal[1]), nz = w * all(p.normal[2]);
    sums.sum[4] += nx;
    sums.sum[5] += ny;
    sums.sum[6] += nz;
    const Pack half = all(0.5f);
    sums.sum[7] += w * all(p.normal_moment[0]) + nx * x;
    sums.sum[8] += w * all(p.normal_moment[1]) + ny * y;
    sums.sum[9] += w * all(p.normal_moment[2]) + nz * z;
    sums.sum[10] += w * all(p.normal_moment[3]) + half * (nx * y + ny * x);
    sums.sum[11] += w * all(p.normal_moment[4]) + half * (nx * z + nz * x);
    sums.sum[12] += w * all(p.normal_moment[5]) + half * (ny * z + nz * y);
    sums.sum[13] += w * all(p.spread[0]) + ax * x;
    sums.sum[14] += w * all(p.spread[1]) + ay * y;
    sums.sum[15] += w * all(p.spread[2]) + az * z;
    sums.sum[16] += w * all(p.spread[3]) + ax * y;
    sums.sum[17] += w * all(p.spread[4]) + ax * z;
    sums.sum[18] += w * all(p.spread[5]) + ay * z;
  }
}

using Six = std::array<double, 6>;  // xx yy zz xy xz yz

double contract(const Six& a, const Six& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5]);
}
Double3 times(const Six& a, const Double3& p) {
  return {a[0] * p[0] + a[3] * p[1] + a[4] * p[2], a[3] * p[0] + a[1] * p[1] + a[5] * p[2],
          a[4] * p[0] + a[5] * p[1] + a[2] * p[2]};
}

/// The quadric of one query from its sums about it.
QuadricValue fit(const std::array<double, kSums>& sum) {
  if (!(sum[0] > 0.0)) return {};
  const double inverse = 1.0 / sum[0];
  const Double3 p = {sum[1] * inverse, sum[2] * inverse, sum[3] * inverse};
  const Double3 n = {sum[4] * inverse, sum[5] * inverse, sum[6] * inverse};
  Six normal_moment, spread, whole;
  for (std::size_t i = 0; i < 6; ++i)
    normal_moment[i] = sum[7 + i] * inverse, whole[i] = sum[13 + i] * inverse;
  const Six pp = {p[0] * p[0], p[1] * p[1], p[2] * p[2], p[0] * p[1], p[0] * p[2], p[1] * p[2]};
  const Six np = {n[0] * p[0],
                  n[1] * p[1],
                  n[2] * p[2],
                  0.5 * (n[0] * p[1] + n[1] * p[0]),
                  0.5 * (n[0] * p[2] + n[2] * p[0]),
                  0.5 * (n[1] * p[2] + n[2] * p[1])};
  for (std::size_t i = 0; i < 6; ++i) normal_moment[i] -= np[i], spread[i] = whole[i] - pp[i];
  const double size = spread[0] + spread[1] + spread[2];
  Six hessian{};  // the Hessian
  double explained = dot(n, n);
  if (size > 1e-6 * (whole[0] + whole[1] + whole[2])) {
    const auto [xx, yy, zz, xy, xz, yz] = spread;
    const double ridge = kRidge * size,
                 sphere = (normal_moment[0] + normal_moment[1] + normal_moment[2]) / size;
    const SmallMatrix<6> k = {{xx + ridge,
                               0,
                               0,
                               xy,
                               xz,
                               0,  //
                               0,
                               yy + ridge,
                               0,
                               xy,
                               0,
                               yz,  //
                               0,
                               0,
                               zz + ridge,
                               0,
                               xz,
                               yz,  //
                               xy,
                               xy,
                               0,
                               xx + yy + 2 * ridge,
                               yz,
                               xz,  //
                               xz,
                               0,
                               xz,
                               yz,
                               xx + zz + 2 * ridge,
                               xy,  //
                               0,
                               yz,
                               yz,
                               xz,
                               xy,
                               yy + zz + 2 * ridge}};
    SmallMatrix<6> factor = k;
    if (!cholesky_factor(factor)) return {};
    hessian = {normal_moment[0] + ridge * sphere,
               normal_moment[1] + ridge * sphere,
               normal_moment[2] + ridge * sphere,
               2 * normal_moment[3],
               2 * normal_moment[4],
               2 * normal_moment[5]};
    cholesky_solve(factor, hessian);
    // What is left of the normals' variance: that of A p - n.
    double steep =
        -ridge * (hessian[0] * hessian[0] + hessian[1] * hessian[1] + hessian[2] * hessian[2] +
                  2 * (hessian[3] * hessian[3] + hessian[4] * hessian[4] + hessian[5] * hessian[5]));
    for (std::size_t i = 0; i < 6; ++i)
      for (std::size_t j = 0; j < 6; ++j) steep += hessian[i] * k(i, j) * hessian[j];
    explained += 2.0 * contract(hessian, normal_moment) - steep;
  }
  const Double3 ap = times(hessian, p);
  const Double3 u = n - ap;
  const double value = -(dot(u, p) + 0.5 * contract(hessian, whole));
  const double slope2 = dot(u, u);
  if (!(slope2 > 1e-12)) return {};
  const double curve = dot(u, times(hessian, u)) / slope2;
  const double below = std::sqrt(slope2) + std::sqrt(std::max(slope2 - 2.0 * curve * value, 0.0));
  return {static_cast<float>(2.0 * value / below), static_cast<float>(std::clamp(1.0 - explained, 0.0, 1.0))};
}

}  // namespace

void QuadricField::evaluate(std::span<const Int3> queries, std::span<QuadricValue> value) const {
  assert(value.size() == queries.size() && core_ > 0.0f);
  const Pack core2 = all(core_ * core_);
  VisibleParts lists;
  ListBuilder builder(far_, near_, lists);
  std::vector<float> tapers;  // eight lanes each
  const auto begin_leaf = [&](const Int3& leaf) {
    builder.build(leaf);
    tapers.resize(kLanes * lists.tapers.size());
  };
  const auto eight = [&](std::size_t at, std::size_t count, Pack qx, Pack qy, Pack qz) {
    for (std::size_t t = 0; t < lists.tapers.size(); ++t)
      _mm256_storeu_ps(&tapers[kLanes * t], taper_at(lists.tapers[t], qx, qy, qz));
    const auto taper = [&](std::int32_t t) {
      return _mm256_loadu_ps(&tapers[kLanes * static_cast<std::size_t>(t)]);
    };
    Sums sums;
    std::size_t first = 0;
    for (const VisibleParts::Run& run : lists.runs) {
      const std::span<const Part> parts = std::span(lists.parts).subspan(first, run.end - first);
      first = run.end;
      Pack factor = all(1.0f);
      if (run.own >= 0) factor = taper(run.own);
      if (run.above >= 0) factor *= all(1.0f) - taper(run.above);
      if (run.own < 0 && run.above < 0)
        add_parts<false>(parts, factor, qx, qy, qz, core2, sums);
      else
        add_parts<true>(parts, factor, qx, qy, qz, core2, sums);
    }
    alignas(32) std::array<std::array<float, kLanes>, kSums> out;
    for (std::size_t s = 0; s < kSums; ++s) _mm256_store_ps(out[s].data(), sums.sum[s]);
    for (std::size_t i = 0; i < count; ++i) {
      std::array<double, kSums> sum;
      for (std::size_t s = 0; s < kSums; ++s) sum[s] = static_cast<double>(out[s][i]);
      value[at + i] = fit(sum);
    }
  };
  for_each_eight(queries, finest_bits(far_, near_), begin_leaf, eight);
}

}  // namespace tessera
