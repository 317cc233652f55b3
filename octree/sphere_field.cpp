#include "octree/sphere_field.h"

#include <immintrin.h>

#include <algorithm>
#include <cassert>
#include <cmath>

namespace tessera {
namespace {

constexpr std::size_t kLanes = 8;

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
  float flux, spread;
};

/// What the queries of one leaf see: parts of one parent in a row.
struct Lists {
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
  ListBuilder(const MultipoleTree& far, const MultipoleTree* near, Lists& out)
      : far_(far), near_(near), out_(out), finest_(near ? near->leaf_bits() : far.leaf_bits()) {}

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
        const MultipoleTree::Level& top = near_->level(near_->top_bits());
        const auto root = std::lower_bound(top.cells.begin(), top.cells.end(), m.key,
                                           [](const Multipole& l, std::uint64_t key) { return l.key < key; });
        assert(root != top.cells.end() && root->key == m.key && "the near tree holds all adjacent cells");
        const auto index = static_cast<std::size_t>(root - top.cells.begin());
        visit(*near_, near_->top_bits() - 1, top.first_child[index], top.first_child[index + 1], own);
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

  Float3 relative(const Int3& q) const {
    Float3 p;
    for (std::size_t a = 0; a < 3; ++a)
      p[a] = static_cast<float>(q[a] - cell_[a] * (kQuantaPerCell << finest_)) * (1.0f / kQuantaPerCell);
    return p;
  }
  void push(const Part& part, std::int32_t own, std::int32_t above) {
    out_.parts.push_back(part);
    if (own < 0 && !out_.runs.empty() && out_.runs.back().own < 0 && out_.runs.back().above == above)
      out_.runs.back().end = out_.parts.size();
    else
      out_.runs.push_back({out_.parts.size(), own, above});
  }
  void add(const Multipole& m, int bits, std::int32_t own, std::int32_t above) {
    const Float3 p = relative(m.centre);
    const auto edge = static_cast<float>(std::int64_t{1} << bits);
    const float e2 = edge * edge, e3 = e2 * edge, e4 = e2 * e2;
    push({p[0],
          p[1],
          p[2],
          m.weight,
          {m.first[0] * e2, m.first[1] * e2, m.first[2] * e2},
          m.flux * e3,
          m.spread * e4},
         own, above);
  }
  void add(const Dipole& d, std::int32_t above) {
    const Float3 p = relative(d.q);
    const Float3& n = d.moment;
    push({p[0], p[1], p[2], std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]), n, 0.0f, 0.0f}, -1, above);
  }

  const MultipoleTree& far_;
  const MultipoleTree* near_;
  Lists& out_;
  int finest_;
  Int3 cell_ = {0, 0, 0};
};

using Pack = __m256;
Pack all(float v) {
  return _mm256_set1_ps(v);
}

/// Weighted sums about each of eight queries.
struct Sums {
  Pack weight = _mm256_setzero_ps();
  Pack x = _mm256_setzero_ps(), y = _mm256_setzero_ps(), z = _mm256_setzero_ps();
  Pack nx = _mm256_setzero_ps(), ny = _mm256_setzero_ps(), nz = _mm256_setzero_ps();
  Pack flux = _mm256_setzero_ps(), spread = _mm256_setzero_ps();
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
    sums.weight += wa;
    sums.x += wa * x;
    sums.y += wa * y;
    sums.z += wa * z;
    const Pack nx = all(p.normal[0]), ny = all(p.normal[1]), nz = all(p.normal[2]);
    sums.nx += w * nx;
    sums.ny += w * ny;
    sums.nz += w * nz;
    sums.flux += w * (all(p.flux) + (nx * x + ny * y + nz * z));
    sums.spread += wa * d2 + w * all(p.spread);
  }
}

/// The sphere of one query from its sums about it: weight, p, n, flux, spread.
SphereValue solve(const std::array<double, 9>& sum) {
  const double weight = sum[0];
  if (!(weight > 0.0)) return {};
  const double inverse = 1.0 / weight;
  const Double3 p = {sum[1] * inverse, sum[2] * inverse, sum[3] * inverse};
  const Double3 n = {sum[4] * inverse, sum[5] * inverse, sum[6] * inverse};
  const double pp = sum[8] * inverse;
  const double flux = sum[7] * inverse - (p[0] * n[0] + p[1] * n[1] + p[2] * n[2]);
  const double spread = pp - (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
  const double bend = spread > 1e-6 * pp ? 0.5 * flux / spread : 0.0;  // the sphere's quadratic coefficient
  Double3 u;
  for (std::size_t a = 0; a < 3; ++a) u[a] = n[a] - 2.0 * bend * p[a];
  const double value = -(u[0] * p[0] + u[1] * p[1] + u[2] * p[2] + bend * pp);
  const double slope2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
  const double root = std::sqrt(std::max(slope2 - 4.0 * bend * value, 0.0));
  const double below = std::sqrt(slope2) + root;
  if (!(below > 1e-6)) return {};
  const double explained = n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + 2.0 * bend * flux;
  return {static_cast<float>(2.0 * value / below), static_cast<float>(std::clamp(1.0 - explained, 0.0, 1.0))};
}

}  // namespace

void SphereField::evaluate(std::span<const Int3> queries, std::span<SphereValue> value) const {
  assert(value.size() == queries.size() && core_ > 0.0f);
  const int finest = near_ ? near_->leaf_bits() : far_.leaf_bits();
  const int shift = kQuantumBits + finest;
  const auto cell_of = [&](const Int3& q) { return Int3{q[0] >> shift, q[1] >> shift, q[2] >> shift}; };
  const Pack core2 = all(core_ * core_);
  Lists lists;
  ListBuilder builder(far_, near_, lists);
  std::vector<float> tapers;  // eight lanes each
  for (std::size_t begin = 0, end = 0; begin < queries.size(); begin = end) {
    const Int3 cell = cell_of(queries[begin]);
    for (end = begin + 1; end < queries.size() && cell_of(queries[end]) == cell;) ++end;
    builder.build(cell);
    tapers.resize(kLanes * lists.tapers.size());
    for (std::size_t at = begin; at < end; at += kLanes) {
      const std::size_t count = std::min(kLanes, end - at);
      alignas(32) std::array<std::array<float, kLanes>, 3> q{};
      for (std::size_t i = 0; i < kLanes; ++i)
        for (std::size_t a = 0; a < 3; ++a)
          q[a][i] = static_cast<float>(queries[at + std::min(i, count - 1)][a] - (cell[a] << shift)) *
                    (1.0f / kQuantaPerCell);
      const Pack qx = _mm256_load_ps(q[0].data()), qy = _mm256_load_ps(q[1].data()),
                 qz = _mm256_load_ps(q[2].data());
      for (std::size_t t = 0; t < lists.tapers.size(); ++t)
        _mm256_storeu_ps(&tapers[kLanes * t], taper_at(lists.tapers[t], qx, qy, qz));
      const auto taper = [&](std::int32_t t) {
        return _mm256_loadu_ps(&tapers[kLanes * static_cast<std::size_t>(t)]);
      };
      Sums sums;
      std::size_t first = 0;
      for (const Lists::Run& run : lists.runs) {
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
      alignas(32) std::array<std::array<float, kLanes>, 9> out;
      const Pack* const packs[9] = {&sums.weight, &sums.x,  &sums.y,    &sums.z,     &sums.nx,
                                    &sums.ny,     &sums.nz, &sums.flux, &sums.spread};
      for (std::size_t s = 0; s < 9; ++s) _mm256_store_ps(out[s].data(), *packs[s]);
      for (std::size_t i = 0; i < count; ++i) {
        std::array<double, 9> sum;
        for (std::size_t s = 0; s < 9; ++s) sum[s] = static_cast<double>(out[s][i]);
        value[at + i] = solve(sum);
      }
    }
  }
}

}  // namespace tessera
