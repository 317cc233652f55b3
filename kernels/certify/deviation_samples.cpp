#include "kernels/certify/deviation_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "octree/vector.h"

namespace tessera {
namespace {

constexpr int kMostParts = 2048;  // per side: a face over a whole picture is not drawn finer

class Sampler {
 public:
  Sampler(const ClosestFaces& reference, const DeviationSampling& options)
      : reference_(reference), options_(options) {}

  float measure(const Double3& world) {
    const Double3 p = world - reference_.origin();
    const ClosestFaces::Hit hit = reference_.closest(p, options_.limit * options_.limit, hint_);
    if (hit.slot == ClosestFaces::kNone) return std::numeric_limits<float>::infinity();
    hint_ = hit.slot;
    const auto distance = static_cast<float>(std::sqrt(hit.square));
    if (!options_.with_sign) return distance;
    const std::array<Double3, 3> t = reference_.corners(hit.slot);
    const double side = dot(cross(t[1] - t[0], t[2] - t[0]), p - t[0]);
    return side < 0.0 ? -distance : distance;
  }

 private:
  const ClosestFaces& reference_;
  const DeviationSampling& options_;
  std::uint32_t hint_ = ClosestFaces::kNone;
};

}  // namespace

void sample_deviation(const SurfaceFaces& surface, const Box3& core, const ClosestFaces& reference,
                      const DeviationSampling& options,
                      const std::function<void(const DeviationTriangle&)>& sink) {
  Sampler sampler(reference, options);
  const auto inside = [&](const Double3& p) {
    bool in = true;
    for (std::size_t k = 0; k < 3; ++k) in = in && p[k] >= core.low[k] && p[k] < core.high[k];
    return in;
  };
  constexpr float kUnknown = -std::numeric_limits<float>::infinity();
  // A corner is measured when the first triangle at it lies in the core: vertices once for all their faces.
  std::vector<float> vertex(surface.position.size(), kUnknown), row, next;
  for (const auto& face : surface.faces) {
    const Double3 &a = surface.position[face[0]], &b = surface.position[face[1]],
                  &c = surface.position[face[2]];
    const Double3 u = b - a, v = c - a, w = c - b;
    const double longest = std::sqrt(std::max({dot(u, u), dot(v, v), dot(w, w)}));
    const int n = static_cast<int>(std::clamp(std::ceil(longest / options.edge), 1.0, 1.0 * kMostParts));
    const auto at = [&](double i, double j) {
      Double3 p;
      for (std::size_t k = 0; k < 3; ++k) p[k] = a[k] + u[k] * (i / n) + v[k] * (j / n);
      return p;
    };
    DeviationTriangle out;
    const Double3 normal = cross(u, v);
    const double size = std::sqrt(dot(normal, normal));
    for (std::size_t k = 0; k < 3; ++k)
      out.normal[k] = size > 0.0 ? static_cast<float>(normal[k] / size) : 0.0f;
    row.assign(static_cast<std::size_t>(n) + 1, kUnknown);
    for (int j = 0; j < n; ++j) {
      next.assign(static_cast<std::size_t>(n) + 1, kUnknown);
      const auto known = [&](int i, int jj) -> float& {
        if (i + jj == 0) return vertex[face[0]];
        if (i == n) return vertex[face[1]];
        if (jj == n) return vertex[face[2]];
        return (jj == j ? row : next)[static_cast<std::size_t>(i)];
      };
      const auto emit = [&](std::array<std::array<int, 2>, 3> corners) {
        double i_sum = 0.0, j_sum = 0.0;
        for (const auto& [i, jj] : corners) i_sum += i, j_sum += jj;
        if (!inside(at(i_sum / 3.0, j_sum / 3.0))) return;
        for (std::size_t k = 0; k < 3; ++k) {
          const auto& [i, jj] = corners[k];
          float& value = known(i, jj);
          out.corner[k] = at(i, jj);
          if (value == kUnknown) value = sampler.measure(out.corner[k]);
          out.deviation[k] = value;
        }
        sink(out);
      };
      for (int i = 0; i + j < n; ++i) {
        emit({{{i, j}, {i + 1, j}, {i, j + 1}}});
        if (i + j + 1 < n) emit({{{i + 1, j}, {i + 1, j + 1}, {i, j + 1}}});
      }
      row.swap(next);
    }
  }
}

}  // namespace tessera
