#include "kernels/edit/displacement_volumes.h"

#include <cmath>

namespace tessera {
namespace {

using Triple = std::array<Double3, 3>;

constexpr double kFilter = 0.3;    ///< of the way that a filter goes at a time
constexpr double kLeast = 1e-9;    ///< of the longest displacement: shorter ones have no direction
constexpr double kMostStep = 0.5;  ///< of the way from base to surface at rest: what one projection may move

/// Of a side with the corners a, b, c, d around it; six times it.
double side_volume(const Double3& a, const Double3& b, const Double3& c, const Double3& d) {
  return 0.25 * dot(cross(a - c, b - d), a + b + c + d);
}

/// Six times the gradient of side_volume by its corner c, and by d.
Double3 by_c(const Double3& a, const Double3& b, const Double3& c, const Double3& d) {
  return (cross(a - c, b - d) - cross(b - d, a + b + c + d)) * 0.25;
}
Double3 by_d(const Double3& a, const Double3& b, const Double3& c, const Double3& d) {
  // (a - c) x (b - d) . t by d: -( t x (a - c) ).
  return (cross(a - c, b - d) - cross(a + b + c + d, a - c)) * 0.25;
}

/// The volume, and its gradient by the corners of the top.
double prism(const Triple& m, const Triple& p, Triple& gradient) {
  const Double3 o = m[0];  // small numbers round less
  const Triple b = {m[0] - o, m[1] - o, m[2] - o}, t = {p[0] - o, p[1] - o, p[2] - o};
  double six = dot(t[0], cross(t[1], t[2])) - dot(b[0], cross(b[1], b[2]));
  gradient = {cross(t[1], t[2]), cross(t[2], t[0]), cross(t[0], t[1])};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    six += side_volume(b[i], b[j], t[j], t[i]);
    gradient[j] = gradient[j] + by_c(b[i], b[j], t[j], t[i]);
    gradient[i] = gradient[i] + by_d(b[i], b[j], t[j], t[i]);
  }
  for (Double3& g : gradient) g = g / 6.0;
  return six / 6.0;
}

Triple corners(std::span<const Double3> at, const std::array<std::uint32_t, 3>& f) {
  return {at[f[0]], at[f[1]], at[f[2]]};
}

class Relaxation {
 public:
  Relaxation(const Layer& rest, const Layer& posed, PrismFaces faces, std::span<const std::uint8_t> free)
      : rest_(rest), base_(posed.base), free_(free), at_(posed.surface.begin(), posed.surface.end()) {
    for (std::size_t v = 0; v < at_.size(); ++v)
      longest_ = std::max(longest_, norm(rest.surface[v] - rest.base[v]));
    for (const auto& f : faces) {
      if (!free[f[0]] && !free[f[1]] && !free[f[2]]) continue;
      Triple unused;
      faces_.push_back(f);
      volume_.push_back(prism(corners(rest.base, f), corners(rest.surface, f), unused));
      // Cotangents at rest; an obtuse corner pulls nothing.
      for (std::size_t k = 0; k < 3; ++k) {
        const Double3 a = rest.surface[f[(k + 1) % 3]] - rest.surface[f[k]],
                      b = rest.surface[f[(k + 2) % 3]] - rest.surface[f[k]];
        const double area = norm(cross(a, b));
        weight_.push_back(area > 0.0 ? std::max(0.0, dot(a, b) / area) : 0.0);
      }
    }
  }

  std::size_t prisms() const { return faces_.size(); }
  std::vector<Double3>& surface() { return at_; }

  /// Sum of what is off, and of all, as shares of the volume at rest.
  void measure(double& off, double& whole) const {
    double sum = 0.0, wrong = 0.0, now = 0.0;
    for (std::size_t j = 0; j < faces_.size(); ++j) {
      Triple unused;
      const double v = prism(corners(base_, faces_[j]), corners(at_, faces_[j]), unused);
      sum += std::fabs(volume_[j]);
      wrong += std::fabs(v - volume_[j]);
      now += v - volume_[j];
    }
    off = sum > 0.0 ? wrong / sum : 0.0;
    whole = sum > 0.0 ? 1.0 + now / sum : 1.0;
  }

  /// Every prism in turn takes the shortest way to its volume.
  void project() {
    for (std::size_t j = 0; j < faces_.size(); ++j) {
      const auto& f = faces_[j];
      Triple g;
      const double off = volume_[j] - prism(corners(base_, f), corners(at_, f), g);
      double square = 0.0;
      for (std::size_t k = 0; k < 3; ++k)
        if (free_[f[k]]) square += dot(g[k], g[k]);
      if (!(square > 0.0)) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        if (!free_[f[k]]) continue;
        const Double3 step = g[k] * (off / square);
        const double length = norm(step), most = kMostStep * (height(f[k]) + kLeast * longest_);
        at_[f[k]] = at_[f[k]] + (length > most ? step * (most / length) : step);
      }
    }
  }

  /// Heights as shares of those at rest become smooth (thesis 5.4.2): what volumes leave open.
  void relax_heights() {
    std::vector<double> ratio(at_.size(), 0.0), sum(at_.size(), 0.0), weight(at_.size(), 0.0);
    for (std::size_t v = 0; v < at_.size(); ++v)
      if (height(v) > kLeast * longest_) ratio[v] = norm(at_[v] - base_[v]) / height(v);
    for (std::size_t j = 0; j < faces_.size(); ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = faces_[j][(k + 1) % 3], b = faces_[j][(k + 2) % 3];
        if (!(ratio[a] > 0.0) || !(ratio[b] > 0.0)) continue;
        sum[a] += weight_[3 * j + k] * ratio[b];
        sum[b] += weight_[3 * j + k] * ratio[a];
        weight[a] += weight_[3 * j + k];
        weight[b] += weight_[3 * j + k];
      }
    for (std::size_t v = 0; v < at_.size(); ++v) {
      if (!free_[v] || !(weight[v] > 0.0) || !(ratio[v] > 0.0)) continue;
      const double wish = ratio[v] + kFilter * (sum[v] / weight[v] - ratio[v]);
      at_[v] = base_[v] + (at_[v] - base_[v]) * (wish / ratio[v]);
    }
  }

 private:
  double height(std::size_t v) const { return norm(rest_.surface[v] - rest_.base[v]); }

  Layer rest_;
  std::span<const Double3> base_;
  std::span<const std::uint8_t> free_;
  std::vector<Double3> at_;
  std::vector<std::array<std::uint32_t, 3>> faces_;
  std::vector<double> volume_, weight_;  ///< per face; per corner: cotangent
  double longest_ = 0.0;
};

}  // namespace

double prism_volume(const std::array<Double3, 3>& base, const std::array<Double3, 3>& top) {
  Triple unused;
  return prism(base, top, unused);
}

std::vector<Double3> displacement_volumes(const Layer& rest, const Layer& posed, PrismFaces faces,
                                          std::span<const std::uint8_t> free,
                                          const DisplacementVolumeOptions& options,
                                          DisplacementVolumeReport& report) {
  Relaxation layer(rest, posed, faces, free);
  report.prisms = layer.prisms();
  layer.measure(report.off_before, report.volume_before);
  for (int round = 0; round < options.rounds; ++round) {
    for (int sweep = 0; sweep < options.sweeps; ++sweep) layer.project();
    layer.relax_heights();
  }
  for (int sweep = 0; sweep < options.last_sweeps; ++sweep) layer.project();
  layer.measure(report.off_after, report.volume_after);
  return std::move(layer.surface());
}

}  // namespace tessera
