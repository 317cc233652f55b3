#include "kernels/smooth/denoise.h"

#include <algorithm>
#include <cmath>

#include "kernels/smooth/star_sides.h"
#include "kernels/smooth/surface_noise.h"
#include "kernels/smooth/surface_window.h"
#include "octree/portable_math.h"
#include "octree/small_matrix.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Rounds in which faces that lie reversed are spread out.
constexpr int kUntangleRounds = 8;
constexpr double kUntangleStep = 0.7;
/// Rings over which the length of edges is averaged.
constexpr int kEdgeRings = 3;

/// The noise is measured at one vertex in four.
constexpr std::uint64_t kNoiseShare = 4;
constexpr int kPoolRings = 6;  ///< of the median
constexpr int kFillRings = 4;  ///< from the vertices in between to those measured

/// From this window on its quadric tells the normals to expect.
constexpr int kTrustedWindow = 2;
/// A vertex farther from the intersection of its sides, in standard deviations of the noise, does not belong there.
constexpr double kFarthest = 4.0;
/// The least deviation that this is measured in, in edges: clean meshes have creases too.
constexpr double kLeastNoise = 0.02;
constexpr int kNewtonSteps = 4;
/// Keeps sides that are nearly parallel from throwing the vertex far away.
constexpr double kParallel = 1e-3;

/// One side as a quadric over a plane.
struct FittedSide {
  WindowFrame frame;
  std::array<double, 6> c = {};

  /// Distance of a point to it, to first order. \param gradient  unit, of the distance
  double distance(const Double3& p, Double3& gradient) const {
    const Double3 d = p - frame.origin;
    const double s = dot(d, frame.a), t = dot(d, frame.b);
    const double height = c[0] + c[1] * s + c[2] * t + c[3] * s * s + c[4] * s * t + c[5] * t * t;
    const double slope_s = c[1] + 2.0 * c[3] * s + c[4] * t, slope_t = c[2] + c[4] * s + 2.0 * c[5] * t;
    const Double3 g = frame.n - frame.a * slope_s - frame.b * slope_t;
    const double steepness = norm(g);
    gradient = g * (1.0 / steepness);
    return (dot(d, frame.n) - height) / steepness;
  }
};

/// The nearest point to `p` on all sides at once, no farther than `reach` a step.
Double3 meet(const std::vector<FittedSide>& sides, Double3 p, double reach) {
  const std::size_t k = sides.size();
  for (int step = 0; step < kNewtonSteps; ++step) {
    std::array<Double3, StarSides::kMost> g;
    SmallMatrix<StarSides::kMost> m;
    std::array<double, StarSides::kMost> share{};
    for (std::size_t i = 0; i < k; ++i) share[i] = -sides[i].distance(p, g[i]);
    for (std::size_t i = 0; i < k; ++i)
      for (std::size_t j = 0; j < k; ++j) m.coeffRef(i, j) = dot(g[i], g[j]) + (i == j ? kParallel : 0.0);
    eliminate(m, share, static_cast<Eigen::Index>(k));
    Double3 move{};
    for (std::size_t i = k; i-- > 0;) move = move + g[i] * share[i];
    const double length = norm(move);
    p = p + move * (length > reach ? reach / length : 1.0);
  }
  return p;
}

/// Middle value; the upper one of two. Reorders.
double median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

class Denoiser {
 public:
  Denoiser(const MeshBlock& block, const FaceCorners& corners, const DenoiseOptions& options,
           std::span<const std::uint8_t> wanted)
      : block_(block),
        corners_(corners),
        options_(options),
        wanted_(wanted),
        normals_(filter_normals(block, corners, options.normals)),
        position_(block.position) {}

  std::vector<Double3> run() {
    untangle();
    measure_edges();
    SurfaceWindow window(block_, corners_, normals_, block_.position, position_);
    measure_noise(window);
    std::vector<Double3> out = block_.position;
    for (std::uint32_t v = 0; v < out.size(); ++v)
      if (wanted_[v] != 0 && !corners_.at(v).empty()) out[v] = moved(window, v);
    return out;
  }

 private:
  std::size_t size() const { return block_.position.size(); }

  /// Sums f(u) over the other vertices of the faces at v, as often as they are named.
  template <typename Value, typename F>
  std::pair<Value, std::size_t> sum_around(std::uint32_t v, F&& f) const {
    Value sum{};
    std::size_t count = 0;
    for (const std::uint32_t corner : corners_.at(v))
      for (const std::uint32_t u : block_.faces[corner >> 2])
        if (u != v) {
          sum = sum + f(u);
          ++count;
        }
    return {sum, count};
  }

  /// Vertices of faces whose projection along their filtered normal is reversed go towards the mean of their
  /// neighbours, along their sides: a crease vertex stays on its crease, a corner stays.
  void untangle() {
    std::vector<Double3> next = position_;
    std::vector<std::uint8_t> reversed(size());
    for (int round = 0; round < kUntangleRounds; ++round) {
      std::fill(reversed.begin(), reversed.end(), std::uint8_t{0});
      for (std::size_t f = 0; f < block_.faces.size(); ++f) {
        const auto& face = block_.faces[f];
        const Double3 area =
            cross(position_[face[1]] - position_[face[0]], position_[face[2]] - position_[face[0]]);
        if (dot(area, wide(normals_[f])) > 0.0) continue;
        for (const std::uint32_t v : face) reversed[v] = 1;
      }
      for (std::uint32_t v = 0; v < size(); ++v)
        if (reversed[v] != 0) next[v] = position_[v] + step_along(v);
      for (std::uint32_t v = 0; v < size(); ++v)
        if (reversed[v] != 0) position_[v] = next[v];
    }
  }

  Double3 step_along(std::uint32_t v) {
    sides_.find(block_, corners_.at(v), normals_, position_);
    const auto [sum, count] =
        sum_around<Double3>(v, [&](std::uint32_t u) { return position_[u] - position_[v]; });
    if (count == 0 || sides_.count() == StarSides::kMost) return {};
    const Double3 step = sum * (kUntangleStep / static_cast<double>(count));
    const Double3& n = sides_.normal(0);
    if (sides_.count() == 1) return step - n * dot(n, step);
    const Double3 line = unit_or_zero(cross(n, sides_.normal(1)));
    return line * dot(line, step);
  }

  void measure_edges() {
    edge_.assign(size(), 0.0F);
    std::vector<float> next(size());
    for (int ring = 0; ring < kEdgeRings; ++ring) {
      for (std::uint32_t v = 0; v < size(); ++v) {
        const auto [sum, count] = sum_around<double>(v, [&](std::uint32_t u) {
          return ring == 0 ? norm(position_[u] - position_[v]) : static_cast<double>(edge_[u]);
        });
        next[v] = count > 0 ? static_cast<float>(sum / static_cast<double>(count)) : 0.0F;
      }
      edge_.swap(next);
    }
  }

  /// Flags the vertices within so many rings of the wanted ones.
  std::vector<std::uint8_t> around_wanted(int rings) const {
    std::vector<std::uint8_t> near(wanted_.begin(), wanted_.end()), next;
    for (int ring = 0; ring < rings; ++ring) {
      next = near;
      for (const auto& face : block_.faces)
        if ((near[face[0]] | near[face[1]] | near[face[2]]) != 0)
          for (const std::uint32_t v : face) next[v] = 1;
      near.swap(next);
    }
    return near;
  }

  void measure_noise(SurfaceWindow& window) {
    noise_.assign(size(), static_cast<float>(options_.noise));
    if (options_.noise > 0.0) return;
    const std::vector<std::uint8_t> near = around_wanted(kPoolRings + kFillRings);
    // Squares: what a quadric leaves, and what explains how two windows differ; negative where not measured.
    std::vector<float> residual(size(), -1.0F), between(size(), -1.0F);
    for (std::uint32_t v = 0; v < size(); ++v) {
      if (near[v] == 0 || !measured(v) || corners_.at(v).empty()) continue;
      sides_.find(block_, corners_.at(v), normals_, position_);
      if (sides_.count() != 1) continue;
      const NoiseSquares squares = noise_squares(window, v, sides_, static_cast<double>(edge_[v]));
      residual[v] = static_cast<float>(squares.residual);
      between[v] = static_cast<float>(squares.between);
    }
    pool(residual, between);
    fill_between();
  }

  bool measured(std::uint32_t v) const { return mix(block_.key[v]) % kNoiseShare == 0; }

  /// At the measured vertices the larger of both medians over the rings around; elsewhere -1.
  void pool(const std::vector<float>& residual, const std::vector<float>& between) {
    std::vector<std::uint32_t> stamp(size(), 0), near;
    std::vector<float> values;
    for (std::uint32_t v = 0; v < size(); ++v) {
      noise_[v] = -1.0F;
      if (residual[v] < 0.0F && between[v] < 0.0F) continue;
      near.assign(1, v);
      stamp[v] = v + 1;
      for (std::size_t ring = 0, begin = 0; ring < static_cast<std::size_t>(kPoolRings); ++ring) {
        const std::size_t end = near.size();
        for (; begin < end; ++begin)
          for (const std::uint32_t corner : corners_.at(near[begin]))
            for (const std::uint32_t u : block_.faces[corner >> 2])
              if (stamp[u] != v + 1) {
                stamp[u] = v + 1;
                near.push_back(u);
              }
      }
      const auto median_of = [&](const std::vector<float>& squares) {
        values.clear();
        for (const std::uint32_t u : near)
          if (squares[u] >= 0.0F) values.push_back(squares[u]);
        return values.empty() ? -1.0 : median(values);
      };
      noise_[v] = static_cast<float>(std::sqrt(noise_variance(median_of(residual), median_of(between))));
    }
  }

  /// Vertices in between take the mean of their neighbours that have a value.
  void fill_between() {
    std::vector<float> next(size());
    for (int ring = 0; ring < kFillRings; ++ring) {
      next = noise_;
      for (std::uint32_t v = 0; v < size(); ++v) {
        if (noise_[v] >= 0.0F) continue;
        double sum = 0.0;
        std::size_t count = 0;
        for (const std::uint32_t corner : corners_.at(v))
          for (const std::uint32_t u : block_.faces[corner >> 2])
            if (noise_[u] >= 0.0F) {
              sum += static_cast<double>(noise_[u]);
              ++count;
            }
        if (count > 0) next[v] = static_cast<float>(sum / static_cast<double>(count));
      }
      noise_.swap(next);
    }
  }

  Double3 moved(SurfaceWindow& window, std::uint32_t v) {
    sides_.find(block_, corners_.at(v), normals_, position_);
    fitted_.clear();
    for (std::size_t k = 0; k < sides_.count(); ++k) fit_side(window, v, sides_.normal(k), sides_.faces(k));
    const Double3& here = position_[v];
    const double edge = static_cast<double>(edge_[v]),
                 noise = std::max(static_cast<double>(noise_[v]), kLeastNoise * edge);
    if (sides_.count() > 1) {
      const Double3 there = meet(fitted_, here, edge);
      if (norm(there - here) <= kFarthest * noise) return there;
      // No noise brought it from there: the edge is rounded.
      Double3 sum{};
      all_.clear();
      for (std::size_t k = 0; k < sides_.count(); ++k) {
        sum = sum + sides_.normal(k);
        all_.insert(all_.end(), sides_.faces(k).begin(), sides_.faces(k).end());
      }
      fitted_.clear();
      fit_side(window, v, unit_or_zero(sum), all_);
    }
    return fitted_.empty() ? block_.position[v] : meet(fitted_, here, edge);
  }

  void fit_side(SurfaceWindow& window, std::uint32_t v, const Double3& normal,
                std::span<const std::uint32_t> faces) {
    window.begin(v, normal, faces);
    WindowChoice choice(noise_[v] > 0.0F ? static_cast<double>(noise_[v]) : 0.0);
    double radius = kSmallestWindow * static_cast<double>(edge_[v]);
    const int windows = faces.size() < corners_.at(v).size() ? kCreaseWindows : kWindows;
    for (int i = 0; i < windows; ++i, radius *= kWindowGrowth) {
      window.grow(radius);
      if (!choice.offer(window.samples(), radius)) break;
      if (i >= kTrustedWindow && choice.best()) window.expect(choice.best()->c);
    }
    if (const auto fit = choice.result(window.samples())) fitted_.push_back({window.frame(), fit->c});
  }

  const MeshBlock& block_;
  const FaceCorners& corners_;
  const DenoiseOptions& options_;
  std::span<const std::uint8_t> wanted_;
  std::vector<Float3> normals_;    ///< m
  std::vector<Double3> position_;  ///< n, untangled
  std::vector<float> edge_;        ///< n, mean length around
  std::vector<float> noise_;       ///< n, standard deviation; -1 where unknown
  StarSides sides_;
  std::vector<FittedSide> fitted_;
  std::vector<std::uint32_t> all_;
};

}  // namespace

int denoise_rings(const DenoiseOptions& options) {
  const int noise = SurfaceWindow::kRings + kPoolRings + kFillRings;
  return normal_rings(options.normals) + kUntangleRounds + kEdgeRings +
         (options.noise > 0.0 ? SurfaceWindow::kRings : noise) + 1;
}

std::vector<Double3> denoise(const MeshBlock& block, const FaceCorners& corners,
                             const DenoiseOptions& options, std::span<const std::uint8_t> wanted) {
  return Denoiser(block, corners, options, wanted).run();
}

std::uint64_t denoise_bytes(std::uint64_t vertices, std::uint64_t faces) {
  // Normals remain; while they are filtered, frames and a second set are there.
  const std::uint64_t filter = 72 * faces;
  const std::uint64_t stay = 12 * faces + 24 * vertices + 8 * vertices;
  // To untangle, a second set of positions; to measure, the window, two squares, stamps and a second set of noise.
  const std::uint64_t measure = SurfaceWindow::bytes(vertices, faces) + 24 * vertices;
  return std::max({filter, stay + 25 * vertices, stay + measure}) + (1U << 20);
}

}  // namespace tessera
