#include "kernels/edit/displacement_volumes.h"

#include <algorithm>
#include <cmath>

#include "kernels/edit/coarse_layer.h"
#include "kernels/edit/edit_basis.h"
#include "kernels/edit/normal_displacement.h"

namespace tessera {
namespace {

using Triple = std::array<Double3, 3>;
using Turn = std::array<double, 9>;

constexpr double kRelax = 0.8;      ///< of the way to the edges at rest that a round goes
constexpr double kFilter = 0.3;     ///< of the way to its neighbours that a ratio of heights goes
constexpr double kMostStep = 0.25;  ///< of two sides of the base: what one projection may move
constexpr double kMostWeight = 20;  ///< of an edge: slivers would hold everything else
constexpr std::size_t kLevelRatio = 8,
                      kLevelStep = 4;  ///< of faces: a level more where so many wait, and its own
constexpr double kLeast = 0.02;        ///< of the longest displacement: ratios of shorter ones say nothing

/// A prism by its base triangle (sides e, f from corner 0) and the displacements of its corners. Over the share s of the way
/// from base to top the triangle is linear, so the volume is the mean displacement times the mean of its area vector.
struct Prism {
  Double3 e, f, g, k, mean, area;
  Prism(const Double3& e_, const Double3& f_, const Double3& d0, const Double3& d1, const Double3& d2)
      : e(e_), f(f_), g(d1 - d0), k(d2 - d0), mean((d0 + d1 + d2) * (1.0 / 3.0)) {
    area = cross(e, f) * 0.5 + (cross(e, k) + cross(g, f)) * 0.25 + cross(g, k) * (1.0 / 6.0);
  }
  double volume() const { return dot(mean, area); }
  /// By the displacements of the corners.
  Triple gradient() const {
    const Double3 by_g = cross(f * 0.25 + k * (1.0 / 6.0), mean),
                  by_k = cross(mean, e * 0.25 + g * (1.0 / 6.0));
    const Double3 third = area * (1.0 / 3.0);
    return {third - by_g - by_k, third + by_g, third + by_k};
  }
};

Double3 turned(const Turn& r, const Double3& p) {
  return {r[0] * p[0] + r[1] * p[1] + r[2] * p[2], r[3] * p[0] + r[4] * p[1] + r[5] * p[2],
          r[6] * p[0] + r[7] * p[1] + r[8] * p[2]};
}

std::vector<Double3> difference(std::span<const Double3> a, std::span<const Double3> b) {
  std::vector<Double3> out(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) out[i] = a[i] - b[i];
  return out;
}

/// One level: displacements of its vertices from the base in its pose.
class Relaxation {
 public:
  Relaxation(const Layer& rest, const Layer& posed, PrismFaces faces, std::span<const std::uint8_t> free,
             std::span<const Double3> widening)
      : rest_base_(rest.base),
        base_(posed.base),
        free_(free),
        at_rest_(difference(rest.surface, rest.base)),
        given_(difference(posed.surface, posed.base)),
        turn_(turns(rest.base, posed.base, faces)),
        height_(at_rest_.size()),
        pull_(at_rest_.size()),
        sum_(at_rest_.size()),
        weight_(at_rest_.size()) {
    for (std::size_t v = 0; v < at_rest_.size(); ++v) height_[v] = norm(at_rest_[v]);
    for (const auto& f : faces)
      if (free[f[0]] || free[f[1]] || free[f[2]]) faces_.push_back(f);
    volume_.resize(faces_.size());
    edge_.resize(3 * faces_.size());
    gained_.assign(faces_.size(), 0.0);
    if (!widening.empty()) {
      for (std::size_t v = 0; v < at_rest_.size(); ++v) {
        given_[v] = given_[v] + widening[v];
        height_[v] += norm(widening[v]);
      }
      for (std::size_t j = 0; j < faces_.size(); ++j) gained_[j] = prism(base_, widening, j).volume();
    }
    longest_ = height_.empty() ? 0.0 : *std::max_element(height_.begin(), height_.end());
    by_ = given_;
  }

  std::size_t prisms() const { return faces_.size(); }

  /// From a layer as thin as one over `scales` of the whole.
  void grow(int scales, int rounds) {
    for (int scale = 1; scale <= scales; ++scale) {
      const double share = static_cast<double>(scale) / scales;
      const double more = scale == 1 ? share : static_cast<double>(scale) / (scale - 1);
      for (std::size_t v = 0; v < by_.size(); ++v) by_[v] = free_[v] ? by_[v] * more : given_[v] * share;
      aim(share);
      relax(rounds);
    }
  }
  void start_from(std::span<const Double3> surface) {
    for (std::size_t v = 0; v < by_.size(); ++v)
      if (free_[v]) by_[v] = surface[v] - base_[v];
    aim(1.0);
  }
  void relax(int rounds) {
    for (int round = 0; round < rounds; ++round) {
      project();
      relax_edges();
      relax_heights();
    }
  }
  /// Every prism in turn takes the shortest way to its volume.
  void project() {
    for (std::size_t j = 0; j < faces_.size(); ++j) {
      const auto& f = faces_[j];
      const Prism p = prism(base_, by_, j);
      const Triple g = p.gradient();
      double square = 0.0;
      for (std::size_t k = 0; k < 3; ++k)
        if (free_[f[k]]) square += dot(g[k], g[k]);
      if (!(square > 0.0)) continue;
      double step = (volume_[j] - p.volume()) / square;
      const double way = std::fabs(step) * std::sqrt(square), most = kMostStep * (norm(p.e) + norm(p.f));
      if (way > most) step *= most / way;
      for (std::size_t k = 0; k < 3; ++k)
        if (free_[f[k]]) by_[f[k]] = by_[f[k]] + g[k] * step;
    }
  }

  /// Where the layer's volumes shall be those at rest, heights scaled.
  void aim(double share) {
    std::fill(pull_.begin(), pull_.end(), Double3{});
    std::fill(weight_.begin(), weight_.end(), 0.0);
    for (std::size_t j = 0; j < faces_.size(); ++j) {
      const auto& f = faces_[j];
      Triple at;
      for (std::size_t k = 0; k < 3; ++k) at[k] = rest_base_[f[k]] + at_rest_[f[k]] * share;
      volume_[j] = Prism(rest_base_[f[1]] - rest_base_[f[0]], rest_base_[f[2]] - rest_base_[f[0]],
                         at_rest_[f[0]] * share, at_rest_[f[1]] * share, at_rest_[f[2]] * share)
                       .volume() +
                   gained_[j] * share;
      const double area = norm(cross(at[1] - at[0], at[2] - at[0]));
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t a = (k + 1) % 3, b = (k + 2) % 3;
        // Cotangents at rest; an obtuse corner pulls nothing.
        const double cotangent = area > 0.0 ? dot(at[a] - at[k], at[b] - at[k]) / area : 0.0;
        const double w = std::clamp(cotangent, 0.0, kMostWeight);
        edge_[3 * j + k] = w;
        const Double3 e = (at[b] - at[a]) * w;
        pull_[f[a]] = pull_[f[a]] + e;
        pull_[f[b]] = pull_[f[b]] - e;
        weight_[f[a]] += w;
        weight_[f[b]] += w;
      }
    }
    for (std::size_t v = 0; v < pull_.size(); ++v) pull_[v] = turned(turn_[v], pull_[v]);
  }

  /// Sum of what is off, and of all, as shares of what is aimed at.
  void measure(double& off, double& whole) const {
    double sum = 0.0, wrong = 0.0, now = 0.0;
    for (std::size_t j = 0; j < faces_.size(); ++j) {
      const double missing = prism(base_, by_, j).volume() - volume_[j];
      sum += std::fabs(volume_[j]);
      wrong += std::fabs(missing);
      now += missing;
    }
    off = sum > 0.0 ? wrong / sum : 0.0;
    whole = sum > 0.0 ? 1.0 + now / sum : 1.0;
  }

  std::vector<Double3> surface() const {
    std::vector<Double3> out(by_.size());
    for (std::size_t v = 0; v < out.size(); ++v) out[v] = base_[v] + by_[v];
    return out;
  }

 private:
  Prism prism(std::span<const Double3> base, std::span<const Double3> by, std::size_t j) const {
    const auto& f = faces_[j];
    return {base[f[1]] - base[f[0]], base[f[2]] - base[f[0]], by[f[0]], by[f[1]], by[f[2]]};
  }

  /// Towards the edges at rest, turned as the base turns.
  void relax_edges() {
    std::fill(sum_.begin(), sum_.end(), Double3{});
    for (std::size_t j = 0; j < faces_.size(); ++j) {
      const auto& f = faces_[j];
      Triple at;
      for (std::size_t k = 0; k < 3; ++k) at[k] = base_[f[k]] + by_[f[k]];
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t a = (k + 1) % 3, b = (k + 2) % 3;
        const Double3 e = (at[b] - at[a]) * edge_[3 * j + k];
        sum_[f[a]] = sum_[f[a]] + e;
        sum_[f[b]] = sum_[f[b]] - e;
      }
    }
    for (std::size_t v = 0; v < by_.size(); ++v)
      if (free_[v] && weight_[v] > 0.0) by_[v] = by_[v] + (sum_[v] - pull_[v]) * (kRelax / weight_[v]);
  }

  /// Heights as shares of those at rest become smooth (thesis 5.4.2): what volumes leave open.
  void relax_heights() {
    const double least = kLeast * longest_;
    ratio_.assign(by_.size(), 0.0);
    ratio_sum_.assign(by_.size(), 0.0);
    ratio_weight_.assign(by_.size(), 0.0);
    for (std::size_t v = 0; v < by_.size(); ++v)
      if (height_[v] > least) ratio_[v] = norm(by_[v]) / height_[v];
    for (std::size_t j = 0; j < faces_.size(); ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = faces_[j][(k + 1) % 3], b = faces_[j][(k + 2) % 3];
        if (!(ratio_[a] > 0.0) || !(ratio_[b] > 0.0)) continue;
        const double w = edge_[3 * j + k];
        ratio_sum_[a] += w * ratio_[b];
        ratio_sum_[b] += w * ratio_[a];
        ratio_weight_[a] += w;
        ratio_weight_[b] += w;
      }
    for (std::size_t v = 0; v < by_.size(); ++v)
      if (free_[v] && ratio_weight_[v] > 0.0 && ratio_[v] > 0.0)
        by_[v] = by_[v] * std::clamp(1.0 + kFilter * (ratio_sum_[v] / (ratio_weight_[v] * ratio_[v]) - 1.0),
                                     1.0 - kFilter, 1.0 + kFilter);
  }

  std::span<const Double3> rest_base_, base_;
  std::span<const std::uint8_t> free_;
  std::vector<Double3> at_rest_, given_, by_;  ///< displacements: at rest, where vectors lead, now
  std::vector<Turn> turn_;
  std::vector<double> height_;
  std::vector<Double3> pull_, sum_;  ///< weighted sums of edges: at rest and turned, now
  std::vector<double> weight_, ratio_, ratio_sum_, ratio_weight_;
  std::vector<std::array<std::uint32_t, 3>> faces_;
  std::vector<double> volume_, gained_, edge_;  ///< per face; per face; per corner: cotangent
  double longest_ = 0.0;
};

/// One of the surfaces that the layer is solved for, finest first, with what it needs to be.
struct Level {
  CoarseLayer from;  ///< how it comes from the finer one; empty for the surface itself
  std::vector<Double3> rest_base, rest, base, vectors, widening;
};

Level coarser(const Level& fine, PrismFaces faces, std::span<const std::uint8_t> free, std::size_t wanted) {
  Level out;
  out.from = coarse_layer(fine.rest, faces, free, wanted);
  const CoarseLayer& c = out.from;
  out.rest_base = c.at(fine.rest_base);
  out.rest = c.at(fine.rest);
  out.base = c.at(fine.base);
  out.vectors = c.at(fine.vectors);
  if (!fine.widening.empty()) out.widening = c.at(fine.widening);
  return out;
}

/// A finer surface moves as the coarse one that it is encoded over.
std::vector<Double3> carried(const Level& coarse, std::span<const Double3> to, const Level& fine,
                             std::span<const std::uint8_t> free) {
  const BaseState before(coarse.rest, coarse.from.faces), after(to, coarse.from.faces);
  const DisplacementEncoder encoder(before);
  double far = 0.0;
  for (const Double3& p : coarse.rest) far = std::max(far, norm(p - coarse.rest.front()));
  std::vector<Double3> out = fine.vectors;
  for (std::size_t v = 0; v < out.size(); ++v) {
    if (!free[v]) continue;
    TangentRest rest;
    const NormalDisplacement d = encoder.encode(fine.rest[v], far, rest);
    const TangentRest* beside = (d.face & kHasTangent) != 0 ? &rest : nullptr;
    out[v] = fine.rest[v] + (after.decode(d, beside) - before.decode(d, beside));
  }
  return out;
}

}  // namespace

double prism_volume(const std::array<Double3, 3>& base, const std::array<Double3, 3>& top) {
  return Prism(base[1] - base[0], base[2] - base[0], top[0] - base[0], top[1] - base[1], top[2] - base[2])
      .volume();
}

std::vector<Double3> displacement_volumes(const Layer& rest, const Layer& posed, PrismFaces faces,
                                          std::span<const std::uint8_t> free,
                                          std::span<const Double3> widening,
                                          const DisplacementVolumeOptions& options,
                                          DisplacementVolumeReport& report) {
  const auto listed = [](std::span<const Double3> p) { return std::vector<Double3>(p.begin(), p.end()); };
  std::vector<Level> levels(1);
  levels[0] = {{},
               listed(rest.base),
               listed(rest.surface),
               listed(posed.base),
               listed(posed.surface),
               listed(widening)};
  const auto faces_of = [&](std::size_t k) { return k == 0 ? faces : PrismFaces(levels[k].from.faces); };
  const auto free_of = [&](std::size_t k) {
    return k == 0 ? free : std::span<const std::uint8_t>(levels[k].from.free);
  };
  std::vector<std::size_t> wanted;
  for (std::size_t w = options.coarse_faces; w > 0 && (wanted.empty() || kLevelRatio * w < faces.size());
       w *= kLevelStep)
    wanted.push_back(w);
  for (; !wanted.empty(); wanted.pop_back()) {
    const std::size_t k = levels.size() - 1;
    Level next = coarser(levels[k], faces_of(k), free_of(k), wanted.back());
    if (next.from.faces.empty()) break;
    levels.push_back(std::move(next));
  }

  std::vector<Double3> found;
  for (std::size_t k = levels.size(); k-- > 0;) {
    const Level& l = levels[k];
    Relaxation layer({l.rest_base, l.rest}, {l.base, l.vectors}, faces_of(k), free_of(k), l.widening);
    if (k == 0) {
      report.prisms = layer.prisms();
      layer.aim(1.0);
      layer.measure(report.off_before, report.volume_before);
    }
    if (k + 1 == levels.size()) {
      layer.grow(options.scales, options.coarse_rounds);
    } else {
      layer.start_from(carried(levels[k + 1], found, l, free_of(k)));
    }
    if (k + 1 < levels.size() || k == 0) layer.relax(options.rounds);
    if (k == 0) {
      for (int sweep = 0; sweep < options.last_sweeps; ++sweep) layer.project();
      layer.measure(report.off_after, report.volume_after);
    }
    found = layer.surface();
  }
  report.levels = levels.size();
  return found;
}

}  // namespace tessera
