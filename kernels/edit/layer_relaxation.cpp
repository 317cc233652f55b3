#include "kernels/edit/layer_relaxation.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "octree/lanes.h"
#include "octree/lists.h"

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;

constexpr double kRelax = 0.8;     ///< of the way to the edges at rest that a round goes
constexpr double kFilter = 0.3;    ///< of the way to its neighbours that a ratio of heights goes
constexpr double kMaxStep = 0.25;  ///< of two sides of the base: what one projection may move
constexpr double kMaxWeight = 20;  ///< of an edge: slivers would hold everything else
constexpr double kOneSided = 0.5;  ///< of volumes: what must be left of them where signs cancel
constexpr double kMaxScale = 0.2;  ///< of heights, at once
constexpr double kMin = 0.02;      ///< of the longest displacement: ratios of shorter ones say nothing

constexpr std::size_t kOpen = 16;  ///< groups of prisms that are being filled
constexpr std::uint32_t kNone = 0xffffffffu;

/// A vector of a vertex, and a fourth number.
struct alignas(32) Row {
  double at[4] = {0, 0, 0, 0};
};

/// Four rows to four lanes of each number, and back.
void transpose(Double4& a, Double4& b, Double4& c, Double4& d) {
  const Double4 ab = __builtin_shufflevector(a, b, 0, 4, 2, 6),
                ba = __builtin_shufflevector(a, b, 1, 5, 3, 7),
                cd = __builtin_shufflevector(c, d, 0, 4, 2, 6),
                dc = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  a = __builtin_shufflevector(ab, cd, 0, 1, 4, 5);
  b = __builtin_shufflevector(ba, dc, 0, 1, 4, 5);
  c = __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
  d = __builtin_shufflevector(ba, dc, 2, 3, 6, 7);
}

/// The same corner of four prisms; `fourth` is the fourth number of its row.
struct Corner {
  Double4x3 at;
  Double4 fourth;
};
Corner gather(const Row* rows, const std::uint32_t* vertex) {
  Corner c{{load4(rows[vertex[0]].at), load4(rows[vertex[1]].at), load4(rows[vertex[2]].at)},
           load4(rows[vertex[3]].at)};
  transpose(c.at[0], c.at[1], c.at[2], c.fourth);
  return c;
}
void scatter(Corner c, Row* rows, const std::uint32_t* vertex) {
  transpose(c.at[0], c.at[1], c.at[2], c.fourth);
  store4(rows[vertex[0]].at, c.at[0]);
  store4(rows[vertex[1]].at, c.at[1]);
  store4(rows[vertex[2]].at, c.at[2]);
  store4(rows[vertex[3]].at, c.fourth);
}

/// Prisms by their base triangles (sides e, f from corner 0) and the displacements of their corners. Over the share s of the way
/// from base to top the triangle is linear, so the volume is the mean displacement times the mean of its area vector.
struct PrismLanes {
  Double4x3 e, f, g, k, mean, area;
  PrismLanes(const Double4x3& e_, const Double4x3& f_, const Double4x3& d0, const Double4x3& d1,
             const Double4x3& d2)
      : e(e_), f(f_), g(d1 - d0), k(d2 - d0), mean((d0 + d1 + d2) * (1.0 / 3.0)) {
    area = cross(e, f) * 0.5 + (cross(e, k) + cross(g, f)) * 0.25 + cross(g, k) * (1.0 / 6.0);
  }
  Double4 volume() const { return dot(mean, area); }
  /// By the displacements of the corners.
  std::array<Double4x3, 3> gradient() const {
    const Double4x3 by_g = cross(f * 0.25 + k * (1.0 / 6.0), mean),
                    by_k = cross(mean, e * 0.25 + g * (1.0 / 6.0)), third = area * (1.0 / 3.0);
    return {third - by_g - by_k, third + by_g, third + by_k};
  }
};

/// Four of them; lanes without a prism have the vertex behind the last one at all corners.
struct alignas(32) Prisms {
  double e[3][kDoubleLanes] = {}, f[3][kDoubleLanes] = {};
  double volume[kDoubleLanes] = {}, gained[kDoubleLanes] = {};
  double maximum[kDoubleLanes] = {};  ///< that a projection may move
  std::uint32_t corner[3][kDoubleLanes] = {};
  std::uint32_t face[kDoubleLanes] = {kNone, kNone, kNone, kNone};

  Double4x3 side_e() const { return {load4(e[0]), load4(e[1]), load4(e[2])}; }
  Double4x3 side_f() const { return {load4(f[0]), load4(f[1]), load4(f[2])}; }
};

std::vector<Row> rows_of(std::span<const Double3> of) {
  std::vector<Row> out(of.size() + 1);
  for (std::size_t v = 0; v < of.size(); ++v) std::copy(of[v].begin(), of[v].end(), out[v].at);
  return out;
}

Double3 vector_of(const Row& r) {
  return {r.at[0], r.at[1], r.at[2]};
}

}  // namespace

struct LayerRelaxation::Impl {
  std::size_t n = 0, count = 0;
  std::vector<std::uint32_t> free;            ///< vertices
  std::vector<Row> base, rest_base, at_rest;  ///< of the pose; at rest; displacements at rest
  std::vector<Row> given, by;      ///< displacements: to begin with, and now; fourth number: 1 where free
  std::vector<Rotation> rotation;  ///< per free vertex
  std::vector<double> height, ratio;
  double longest = 0.0;
  std::vector<Prisms> prisms;
  // Neighbours of free vertices, and the two places, or kNone, of the edge opposite to each corner of a face.
  std::vector<std::uint32_t> first, neighbour;
  std::vector<double> weight;
  std::vector<std::array<std::uint32_t, 2>> slot;
  std::vector<Row> pull;  ///< per free vertex: what edges ask for beside displacements; fourth number: step

  void pack(PrismFaces faces, std::span<const std::uint8_t> is_free) {
    std::vector<std::uint16_t> in(n, 0);  // per vertex: open groups that move it
    std::array<Prisms, kOpen> open{};
    std::array<std::size_t, kOpen> filled{};
    const auto start = [&](std::size_t o) {
      open[o] = {};
      filled[o] = 0;
      for (auto& corners : open[o].corner)
        std::fill(std::begin(corners), std::end(corners), static_cast<std::uint32_t>(n));
    };
    const auto close = [&](std::size_t o) {
      if (filled[o] == 0) return;
      for (const auto& corners : open[o].corner)
        for (std::size_t l = 0; l < filled[o]; ++l)
          in[corners[l]] = static_cast<std::uint16_t>(in[corners[l]] & ~(1u << o));
      prisms.push_back(open[o]);
      start(o);
    };
    for (std::size_t o = 0; o < kOpen; ++o) start(o);
    std::size_t oldest = 0;
    for (std::uint32_t j = 0; j < faces.size(); ++j) {
      const Face& f = faces[j];
      if (!is_free[f[0]] && !is_free[f[1]] && !is_free[f[2]]) continue;
      ++count;
      const unsigned taken = in[f[0]] | in[f[1]] | in[f[2]];
      auto o = static_cast<std::size_t>(std::countr_one(taken));
      if (o >= kOpen) {
        o = oldest;
        oldest = (oldest + 1) % kOpen;
        close(o);
      }
      const std::size_t l = filled[o]++;
      open[o].face[l] = j;
      for (std::size_t k = 0; k < 3; ++k) {
        open[o].corner[k][l] = f[k];
        if (is_free[f[k]]) in[f[k]] = static_cast<std::uint16_t>(in[f[k]] | 1u << o);
      }
      if (filled[o] == kDoubleLanes) close(o);
    }
    for (std::size_t o = 0; o < kOpen; ++o) close(o);
  }

  void join(PrismFaces faces, std::span<const std::uint8_t> is_free) {
    struct Item {
      std::uint32_t to, side;  ///< side: 2 (3 face + corner), or one more
    };
    std::vector<std::uint32_t> number(n, kNone);
    for (std::uint32_t i = 0; i < free.size(); ++i) number[free[i]] = i;
    const Lists<Item> lists = make_lists<Item>(free.size(), [&](const auto& put) {
      for (std::uint32_t j = 0; j < faces.size(); ++j)
        for (std::uint32_t k = 0; k < 3; ++k) {
          const std::uint32_t a = faces[j][(k + 1) % 3], b = faces[j][(k + 2) % 3];
          if (is_free[a]) put(number[a], Item{b, 2 * (3 * j + k)});
          if (is_free[b]) put(number[b], Item{a, 2 * (3 * j + k) + 1});
        }
    });
    slot.assign(3 * faces.size(), {kNone, kNone});
    std::vector<std::uint32_t> seen(n, kNone);  // place of a vertex in the list at hand
    first.assign(1, 0);
    for (std::size_t i = 0; i < lists.size(); ++i) {
      for (const Item& item : lists[i]) {
        std::uint32_t& at = seen[item.to];
        if (at == kNone || at < first.back()) {
          at = static_cast<std::uint32_t>(neighbour.size());
          neighbour.push_back(item.to);
        }
        slot[item.side / 2][item.side % 2] = at;
      }
      first.push_back(static_cast<std::uint32_t>(neighbour.size()));
    }
    weight.resize(neighbour.size());
    pull.resize(free.size());
  }

  void take_sides() {
    for (Prisms& p : prisms) {
      const Corner a = gather(base.data(), p.corner[0]), b = gather(base.data(), p.corner[1]),
                   c = gather(base.data(), p.corner[2]);
      const Double4x3 e = b.at - a.at, f = c.at - a.at;
      store4(p.e[0], e[0]), store4(p.e[1], e[1]), store4(p.e[2], e[2]);
      store4(p.f[0], f[0]), store4(p.f[1], f[1]), store4(p.f[2], f[2]);
      store4(p.maximum, kMaxStep * (square_root(dot(e, e)) + square_root(dot(f, f))));
    }
  }

  Double4 volume(const Prisms& p, const std::vector<Row>& displacements) const {
    const Row* const d = displacements.data();
    return PrismLanes(p.side_e(), p.side_f(), gather(d, p.corner[0]).at, gather(d, p.corner[1]).at,
                      gather(d, p.corner[2]).at)
        .volume();
  }
};

LayerRelaxation::LayerRelaxation(const Layer& rest, const Layer& posed, PrismFaces faces,
                                 std::span<const std::uint8_t> free, std::span<const Rotation> rotation,
                                 std::span<const Double3> widening)
    : impl_(std::make_unique<Impl>()) {
  Impl& m = *impl_;
  m.n = rest.base.size();
  m.base = rows_of(posed.base);
  m.rest_base = rows_of(rest.base);
  m.at_rest.resize(m.n + 1);
  m.given.resize(m.n + 1);
  m.height.resize(m.n);
  m.ratio.resize(m.n);
  for (std::uint32_t v = 0; v < m.n; ++v) {
    const Double3 d = rest.surface[v] - rest.base[v];
    Double3 to = posed.surface[v] - posed.base[v];
    m.height[v] = norm(d);
    if (!widening.empty()) {
      to = to + widening[v];
      m.height[v] += norm(widening[v]);
    }
    m.longest = std::max(m.longest, m.height[v]);
    std::copy(d.begin(), d.end(), m.at_rest[v].at);
    std::copy(to.begin(), to.end(), m.given[v].at);
    m.given[v].at[3] = free[v] ? 1.0 : 0.0;
    if (!free[v]) continue;
    m.free.push_back(v);
    m.rotation.push_back(rotation[v]);
  }
  m.by = m.given;
  m.pack(faces, free);
  m.join(faces, free);
  m.take_sides();
  if (widening.empty()) return;
  const std::vector<Row> wide = rows_of(widening);
  for (Prisms& p : m.prisms) store4(p.gained, m.volume(p, wide));
}

LayerRelaxation::~LayerRelaxation() = default;

std::size_t LayerRelaxation::prisms() const {
  return impl_->count;
}

void LayerRelaxation::set(std::span<const Double3> surface) {
  Impl& m = *impl_;
  for (const std::uint32_t v : m.free)
    for (std::size_t c = 0; c < 3; ++c) m.by[v].at[c] = surface[v][c] - m.base[v].at[c];
}

void LayerRelaxation::scale(double free_by, double others_to) {
  Impl& m = *impl_;
  for (std::size_t v = 0; v < m.n; ++v)
    for (std::size_t c = 0; c < 3; ++c)
      m.by[v].at[c] = m.by[v].at[3] > 0.0 ? m.by[v].at[c] * free_by : m.given[v].at[c] * others_to;
}

void LayerRelaxation::aim(double share) {
  Impl& m = *impl_;
  std::fill(m.weight.begin(), m.weight.end(), 0.0);
  for (Prisms& p : m.prisms) {
    std::array<Double4x3, 3> at, d;
    for (std::size_t k = 0; k < 3; ++k) {
      d[k] = gather(m.at_rest.data(), p.corner[k]).at * share;
      at[k] = gather(m.rest_base.data(), p.corner[k]).at;
    }
    store4(p.volume,
           PrismLanes(at[1] - at[0], at[2] - at[0], d[0], d[1], d[2]).volume() + load4(p.gained) * share);
    for (std::size_t k = 0; k < 3; ++k) at[k] = at[k] + d[k];
    const Double4x3 normal = cross(at[1] - at[0], at[2] - at[0]);
    const Double4 area = square_root(dot(normal, normal));
    for (std::size_t k = 0; k < 3; ++k) {
      // Cotangents at rest; an obtuse corner pulls nothing.
      const Double4 along = dot(at[(k + 1) % 3] - at[k], at[(k + 2) % 3] - at[k]);
      for (std::size_t l = 0; l < kDoubleLanes; ++l) {
        if (p.face[l] == kNone || !(area[l] > 0.0)) continue;
        const double w = std::clamp(along[l] / area[l], 0.0, kMaxWeight);
        for (const std::uint32_t slot : m.slot[3 * p.face[l] + k])
          if (slot != kNone) m.weight[slot] += w;
      }
    }
  }
  for (std::size_t i = 0; i < m.free.size(); ++i) {
    const std::uint32_t v = m.free[i];
    Double3 now{}, was{};
    double sum = 0.0;
    for (std::uint32_t e = m.first[i]; e < m.first[i + 1]; ++e) {
      const std::uint32_t u = m.neighbour[e];
      const double w = m.weight[e];
      sum += w;
      for (std::size_t c = 0; c < 3; ++c) {
        now[c] += w * (m.base[u].at[c] - m.base[v].at[c]);
        was[c] += w * (m.rest_base[u].at[c] - m.rest_base[v].at[c] +
                       (m.at_rest[u].at[c] - m.at_rest[v].at[c]) * share);
      }
    }
    const Double3 missing = now - rotated(m.rotation[i], was);
    std::copy(missing.begin(), missing.end(), m.pull[i].at);
    m.pull[i].at[3] = sum > 0.0 ? kRelax / sum : 0.0;
  }
}

void LayerRelaxation::project(double relaxation) {
  Impl& m = *impl_;
  Row* const rows = m.by.data();
  for (const Prisms& p : m.prisms) {
    std::array<Corner, 3> d = {gather(rows, p.corner[0]), gather(rows, p.corner[1]),
                               gather(rows, p.corner[2])};
    const PrismLanes prism(p.side_e(), p.side_f(), d[0].at, d[1].at, d[2].at);
    const std::array<Double4x3, 3> g = prism.gradient();
    Double4 square{};
    for (std::size_t k = 0; k < 3; ++k) square += dot(g[k], g[k]) * d[k].fourth;
    const Double4 missing = (load4(p.volume) - prism.volume()) * relaxation, maximum = load4(p.maximum);
    const auto some = square > 0.0;
    Double4 step = some ? missing / square : Double4{};
    // Way = step * sqrt(square): only a few are too long.
    const auto far = step * step * square > maximum * maximum;
    if ((far[0] | far[1] | far[2] | far[3]) != 0) {
      const Double4 shorter = maximum / square_root(square);
      step = far ? (step > 0.0 ? shorter : -shorter) : step;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      d[k].at = d[k].at + g[k] * (step * d[k].fourth);
      scatter(d[k], rows, p.corner[k]);
    }
  }
}

void LayerRelaxation::relax_edges() {
  Impl& m = *impl_;
  for (std::size_t i = 0; i < m.free.size(); ++i) {
    const std::uint32_t v = m.free[i];
    const Double4 here = load4(m.by[v].at), pull = load4(m.pull[i].at);
    Double4 sum = pull;
    for (std::uint32_t e = m.first[i]; e < m.first[i + 1]; ++e)
      sum += m.weight[e] * (load4(m.by[m.neighbour[e]].at) - here);
    const double step = m.pull[i].at[3];
    const Double4 by = {step, step, step, 0.0};
    store4(m.by[v].at, here + sum * by);
  }
}

void LayerRelaxation::relax_heights() {
  Impl& m = *impl_;
  const double minimum = kMin * m.longest;
  for (std::size_t v = 0; v < m.n; ++v)
    m.ratio[v] = m.height[v] > minimum ? norm(vector_of(m.by[v])) / m.height[v] : 0.0;
  for (std::size_t i = 0; i < m.free.size(); ++i) {
    const std::uint32_t v = m.free[i];
    if (!(m.ratio[v] > 0.0)) continue;
    double sum = 0.0, weight = 0.0;
    for (std::uint32_t e = m.first[i]; e < m.first[i + 1]; ++e) {
      const double r = m.ratio[m.neighbour[e]], w = r > 0.0 ? m.weight[e] : 0.0;
      sum += w * r;
      weight += w;
    }
    if (!(weight > 0.0)) continue;
    const double by =
        std::clamp(1.0 + kFilter * (sum / (weight * m.ratio[v]) - 1.0), 1.0 - kFilter, 1.0 + kFilter);
    for (std::size_t c = 0; c < 3; ++c) m.by[v].at[c] *= by;
  }
}

void LayerRelaxation::scale_heights(int rings) {
  Impl& m = *impl_;
  // Wanted and present volume, and both without signs.
  std::vector<Row> sum(m.n + 1), next;
  for (const Prisms& p : m.prisms) {
    const Double4 volume = m.volume(p, m.by);
    for (std::size_t l = 0; l < kDoubleLanes; ++l) {
      const Double4 share = {p.volume[l], volume[l], std::fabs(p.volume[l]), std::fabs(volume[l])};
      for (const auto& corners : p.corner) store4(sum[corners[l]].at, load4(sum[corners[l]].at) + share);
    }
  }
  for (int ring = 0; ring < rings; ++ring) {
    next = sum;
    for (std::size_t i = 0; i < m.free.size(); ++i) {
      Double4 all = load4(sum[m.free[i]].at);
      for (std::uint32_t e = m.first[i]; e < m.first[i + 1]; ++e) all += load4(sum[m.neighbour[e]].at);
      store4(next[m.free[i]].at, all * (1.0 / (1.0 + m.first[i + 1] - m.first[i])));
    }
    sum.swap(next);
  }
  for (const std::uint32_t v : m.free) {
    const auto& [wanted, present, all_wanted, all_present] = sum[v].at;
    if (!(wanted * present > 0.0) || std::fabs(wanted) < kOneSided * all_wanted ||
        std::fabs(present) < kOneSided * all_present)
      continue;
    const double by = std::clamp(wanted / present, 1.0 - kMaxScale, 1.0 + kMaxScale);
    for (std::size_t c = 0; c < 3; ++c) m.by[v].at[c] *= by;
  }
}

void LayerRelaxation::measure(double& off, double& whole) const {
  const Impl& m = *impl_;
  double sum = 0.0, wrong = 0.0, now = 0.0;
  for (const Prisms& p : m.prisms) {
    const Double4 volume = m.volume(p, m.by);
    for (std::size_t l = 0; l < kDoubleLanes; ++l) {
      const double missing = volume[l] - p.volume[l];
      sum += std::fabs(p.volume[l]);
      wrong += std::fabs(missing);
      now += missing;
    }
  }
  off = sum > 0.0 ? wrong / sum : 0.0;
  whole = sum > 0.0 ? 1.0 + now / sum : 1.0;
}

std::vector<Double3> LayerRelaxation::surface() const {
  const Impl& m = *impl_;
  std::vector<Double3> out(m.n);
  for (std::size_t v = 0; v < m.n; ++v) out[v] = vector_of(m.base[v]) + vector_of(m.by[v]);
  return out;
}

}  // namespace tessera
