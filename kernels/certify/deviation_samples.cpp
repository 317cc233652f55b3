#include "kernels/certify/deviation_samples.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <vector>

#include "octree/vector.h"

namespace tessera {
namespace {

constexpr int kMaxParts = 2048;  // per side: a face over a whole picture is not drawn finer
/// A face so many times as long as it is high, or as an edge of the sampling, is cut along its length: a grid would have as
/// many rows as columns.
constexpr double kSlim = 4.0;
/// Of an edge of the sampling: what is thinner is seen nowhere, and is measured in its middle alone. Fans of hundreds of
/// such lie over each other in what CAD programs write, and every distance there looks at all of them.
constexpr double kThin = 1.0 / 32.0;
constexpr std::uint32_t kOne = 1u << 24;  ///< steps of a side in which places on a needle are told
constexpr float kUnknown = -std::numeric_limits<float>::infinity();

using Sink = std::function<void(const DeviationTriangle&)>;

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

/// A needle, cut by halving its longest side until none is longer than asked for. Sides that faces share are halved alike.
class NeedleCutter {
 public:
  NeedleCutter(Sampler& sampler, const Box3& core) : sampler_(sampler), core_(core) {}

  /// \param corner  of the face \param value  what is known at them, and will be \param maximum  length of a side
  /// \param out  with the normal of the face
  void cut(const std::array<Double3, 3>& corner, const std::array<float*, 3>& value, double maximum,
           DeviationTriangle& out, const Sink& sink) {
    corner_ = &corner;
    value_.clear();
    const std::array<Barycentric, 3> whole = {Barycentric{0, 0}, Barycentric{kOne, 0}, Barycentric{0, kOne}};
    stack_.assign(1, whole);
    while (!stack_.empty()) {
      const std::array<Barycentric, 3> piece = stack_.back();
      stack_.pop_back();
      const std::array<Double3, 3> p = {at(piece[0]), at(piece[1]), at(piece[2])};
      if (!meets_core(p)) continue;
      std::size_t side = 0;
      double longest_side = 0.0;
      for (std::size_t k = 0; k < 3; ++k)
        if (const double length = squared_distance(p[k], p[(k + 1) % 3]); length > longest_side)
          longest_side = length, side = k;
      if (longest_side > maximum * maximum) {
        const Barycentric &a = piece[side], &b = piece[(side + 1) % 3], &c = piece[(side + 2) % 3];
        const Barycentric middle = {(a.i + b.i) / 2, (a.j + b.j) / 2};
        stack_.push_back({middle, b, c});
        stack_.push_back({a, middle, c});
        continue;
      }
      if (!in_core(p)) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        float& known = piece[k] == whole[0]   ? *value[0]
                       : piece[k] == whole[1] ? *value[1]
                       : piece[k] == whole[2] ? *value[2]
                                              : known_at(piece[k]);
        if (known == kUnknown) known = sampler_.measure(p[k]);
        out.corner[k] = p[k];
        out.deviation[k] = known;
      }
      sink(out);
    }
  }

 private:
  struct Barycentric {
    std::uint32_t i, j;  ///< parts of kOne along the first and the last side
    bool operator==(const Barycentric&) const = default;
  };

  Double3 at(const Barycentric& bary) const {
    const Double3 &a = (*corner_)[0], &b = (*corner_)[1], &c = (*corner_)[2];
    Double3 p;
    for (std::size_t k = 0; k < 3; ++k)
      p[k] = a[k] + (b[k] - a[k]) * (static_cast<double>(bary.i) / kOne) +
             (c[k] - a[k]) * (static_cast<double>(bary.j) / kOne);
    return p;
  }
  float& known_at(const Barycentric& bary) {
    return value_.try_emplace(std::uint64_t{bary.i} << 32 | bary.j, kUnknown).first->second;
  }
  bool meets_core(const std::array<Double3, 3>& p) const {
    bool meets = true;
    for (std::size_t k = 0; k < 3; ++k)
      meets = meets && std::min({p[0][k], p[1][k], p[2][k]}) < core_.high[k] &&
              std::max({p[0][k], p[1][k], p[2][k]}) >= core_.low[k];
    return meets;
  }
  bool in_core(const std::array<Double3, 3>& p) const {
    bool in = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const double middle = (p[0][k] + p[1][k] + p[2][k]) / 3.0;
      in = in && middle >= core_.low[k] && middle < core_.high[k];
    }
    return in;
  }

  Sampler& sampler_;
  const Box3& core_;
  const std::array<Double3, 3>* corner_ = nullptr;
  std::unordered_map<std::uint64_t, float> value_;  ///< at places inside the face and on its sides
  std::vector<std::array<Barycentric, 3>> stack_;
};

}  // namespace

void sample_deviation(const SurfaceFaces& surface, const Box3& core, const ClosestFaces& reference,
                      const DeviationSampling& options, const Sink& sink) {
  Sampler sampler(reference, options);
  NeedleCutter needles(sampler, core);
  const auto inside = [&](const Double3& p) {
    bool in = true;
    for (std::size_t k = 0; k < 3; ++k) in = in && p[k] >= core.low[k] && p[k] < core.high[k];
    return in;
  };
  // A corner is measured when the first triangle at it lies in the core: vertices once for all their faces.
  std::vector<float> vertex(surface.position.size(), kUnknown), row, next;
  for (const auto& face : surface.faces) {
    const Double3 &a = surface.position[face[0]], &b = surface.position[face[1]],
                  &c = surface.position[face[2]];
    const Double3 u = b - a, v = c - a, w = c - b;
    const double longest = std::sqrt(std::max({dot(u, u), dot(v, v), dot(w, w)}));
    const int n = static_cast<int>(std::clamp(std::ceil(longest / options.edge), 1.0, 1.0 * kMaxParts));
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
    const double height = longest > 0.0 ? size / longest : 0.0;
    if (longest > kSlim * std::max(height, options.edge)) {
      if (height < kThin * options.edge) {
        const Double3 middle = (a + b + c) * (1.0 / 3.0);
        if (!inside(middle)) continue;
        out.corner = {a, b, c};
        out.deviation.fill(sampler.measure(middle));
        sink(out);
        continue;
      }
      const double maximum = std::max(options.edge, longest / kMaxParts);
      needles.cut({a, b, c}, {&vertex[face[0]], &vertex[face[1]], &vertex[face[2]]}, maximum, out, sink);
      continue;
    }
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
