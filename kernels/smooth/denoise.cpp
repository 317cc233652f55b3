#include "kernels/smooth/denoise.h"

#include <algorithm>
#include <cmath>

#include "kernels/smooth/star_sides.h"
#include "kernels/smooth/surface_noise.h"
#include "kernels/smooth/surface_rows.h"
#include "kernels/smooth/surface_window.h"
#include "octree/portable_math.h"
#include "octree/small_matrix.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Rounds in which faces that lie reversed are spread out, before the fits and after them.
constexpr int kUntangleRounds = 6;
constexpr int kGuardRounds = 3;
constexpr double kUntangleStep = 0.7;
/// Rings over which the length of edges is averaged.
constexpr int kEdgeRings = 3;

/// Centres: vertices more than kApart edges from each other whose fits serve those around them. Chosen in rounds, the
/// lowest random number of a neighbourhood first.
constexpr int kApart = 2;
constexpr int kChoiceRounds = 2;
/// Rings that tell whether a vertex is a centre.
constexpr int kChoiceRings = 2 * kApart * kChoiceRounds;

/// Rings of the median of the noise, and from the vertices in between to the centres.
constexpr int kPoolRings = 8;
constexpr int kFillRings = 6;

/// A fit serves vertices within this share of its window's radius, where the window is one of the wider ones: narrow fits
/// are cheap, and detail is why they are narrow. The more fits a vertex averages, the less noise they leave; where noise is
/// low, those from farther away disagree.
constexpr double kServedShare = 0.75;
constexpr double kMinServed = 3.9;  ///< radius, edges
constexpr int kServedRings = 8;
/// Least sum of weights of the fits that place a vertex.
constexpr float kEnough = 0.5F;
/// Fits that put a vertex so far apart, in standard deviations of the noise, do not belong to one surface.
constexpr double kAgreement = 0.7;

/// From this window on its quadric tells the normals to expect.
constexpr int kTrustedWindow = 2;
/// A vertex farther from the intersection of its sides, in standard deviations of the noise, does not belong there.
constexpr double kFarthest = 4.0;
/// The least deviation that this is measured in, in edges: clean meshes have creases too.
constexpr double kMinNoise = 0.02;
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

/// The nearest point to `p` on all sides at once, no farther than `max_move` a step.
Double3 meet(const std::vector<FittedSide>& sides, Double3 p, double max_move) {
  const std::size_t k = sides.size();
  for (int step = 0; step < kNewtonSteps; ++step) {
    std::array<Double3, StarSides::kMax> g;
    SmallMatrix<StarSides::kMax> m;
    std::array<double, StarSides::kMax> share{};
    for (std::size_t i = 0; i < k; ++i) share[i] = -sides[i].distance(p, g[i]);
    for (std::size_t i = 0; i < k; ++i)
      for (std::size_t j = 0; j < k; ++j) m(i, j) = dot(g[i], g[j]) + (i == j ? kParallel : 0.0);
    eliminate(m, share, k);
    Double3 move{};
    for (std::size_t i = k; i-- > 0;) move = move + g[i] * share[i];
    const double length = norm(move);
    p = p + move * (length > max_move ? max_move / length : 1.0);
  }
  return p;
}

/// Middle value; the upper one of two. Reorders.
double median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

/// What fits say of a vertex that they serve, weighted.
struct Served {
  float weight = 0.0F;
  Float3 move = {0, 0, 0};
  float distance = 0.0F, square = 0.0F;
};

class Denoiser {
 public:
  Denoiser(const MeshBlock& block, const FaceCorners& corners, const DenoiseOptions& options,
           std::span<const std::uint8_t> whole, std::span<const std::uint8_t> wanted)
      : block_(block),
        corners_(corners),
        options_(options),
        known_(whole.begin(), whole.end()),
        wanted_(wanted),
        normals_(filter_normals(block, corners, options.normals)),
        position_(block.position) {
    erode(block, corners, std::max(normal_rings(options.normals) + kUntangleRounds - 1, kChoiceRings),
          known_);
  }

  DenoisedBlock run() {
    untangle(position_, kUntangleRounds);
    measure_edges();
    choose_centres();
    SurfaceWindow window(block_, corners_, normals_, block_.position, position_, known_);
    measure_noise(window);
    fit_centres(window);
    DenoisedBlock out{block_.position, fits_known_};
    const std::vector<std::uint8_t> near = around_wanted(kGuardRounds);
    for (std::uint32_t v = 0; v < size(); ++v) {
      if (near[v] == 0 || corners_.at(v).empty()) continue;
      out.position[v] = moved(window, v);
      if (!window_right_) out.right[v] = 0;
    }
    untangle(out.position, kGuardRounds);
    erode(block_, corners_, kGuardRounds, out.right);
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
  void untangle(std::vector<Double3>& position, int rounds) {
    std::vector<std::uint8_t> marked(size(), 0);
    std::vector<std::uint32_t> reversed;
    std::vector<Double3> next;
    for (int round = 0; round < rounds; ++round) {
      reversed.clear();
      for (std::size_t f = 0; f < block_.faces.size(); ++f) {
        const auto& face = block_.faces[f];
        const Double3 area = triangle_normal(position[face[0]], position[face[1]], position[face[2]]);
        if (dot(area, wide(normals_[f])) > 0.0) continue;
        for (const std::uint32_t v : face)
          if (marked[v] == 0) {
            marked[v] = 1;
            reversed.push_back(v);
          }
      }
      if (reversed.empty()) return;
      next.clear();
      for (const std::uint32_t v : reversed) next.push_back(position[v] + step_along(v, position));
      for (std::size_t i = 0; i < reversed.size(); ++i) {
        position[reversed[i]] = next[i];
        marked[reversed[i]] = 0;
      }
    }
  }

  Double3 step_along(std::uint32_t v, const std::vector<Double3>& position) {
    sides_.find(block_, corners_.at(v), normals_, position);
    const auto [sum, count] =
        sum_around<Double3>(v, [&](std::uint32_t u) { return position[u] - position[v]; });
    if (count == 0 || sides_.count() == StarSides::kMax) return {};
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
    std::vector<std::uint8_t> far(size());
    for (std::size_t v = 0; v < far.size(); ++v) far[v] = wanted_[v] == 0;
    erode(block_, corners_, rings, far);
    for (std::uint8_t& flag : far) flag = flag == 0;
    return far;
  }

  /// A set of which no two are within kApart rings of each other: in every round those that come before all others
  /// around them that are still free.
  void choose_centres() {
    constexpr std::uint64_t kNever = ~std::uint64_t{0};
    const auto spread = [&](std::vector<std::uint64_t>& minimum) {
      std::vector<std::uint64_t> next = minimum;
      for (const auto& face : block_.faces) {
        const std::uint64_t m = std::min({minimum[face[0]], minimum[face[1]], minimum[face[2]]});
        for (const std::uint32_t v : face) next[v] = std::min(next[v], m);
      }
      minimum.swap(next);
    };
    std::vector<std::uint64_t> own(size()), minimum;
    for (std::uint32_t v = 0; v < size(); ++v)
      own[v] = corners_.at(v).empty() ? kNever : mix(block_.key[v]) >> 1;
    centre_.assign(size(), 0);
    for (int round = 0; round < kChoiceRounds; ++round) {
      minimum = own;
      for (int ring = 0; ring < kApart; ++ring) spread(minimum);
      for (std::uint32_t v = 0; v < size(); ++v)
        if (own[v] != kNever && own[v] == minimum[v]) centre_[v] = 1;
      if (round + 1 == kChoiceRounds) return;
      for (std::uint32_t v = 0; v < size(); ++v) minimum[v] = centre_[v] != 0 ? 0 : kNever;
      for (int ring = 0; ring < kApart; ++ring) spread(minimum);
      for (std::uint32_t v = 0; v < size(); ++v)
        if (minimum[v] == 0) own[v] = kNever;
    }
  }

  void measure_noise(SurfaceWindow& window) {
    noise_.assign(size(), static_cast<float>(options_.noise));
    noise_known_ = known_;
    if (options_.noise > 0.0) return;
    constexpr int kHaloRings = kGuardRounds + kServedRings + kFillRings;
    std::vector<std::uint8_t> near = around_wanted(kHaloRings + kPoolRings);
    // Squares: what a quadric leaves, and what explains how two windows differ; negative where not measured.
    std::vector<float> residual(size(), -1.0F), between(size(), -1.0F);
    for (std::uint32_t v = 0; v < size(); ++v) {
      if (near[v] == 0 || centre_[v] == 0) continue;
      sides_.find(block_, corners_.at(v), normals_, position_);
      if (sides_.count() != 1) continue;
      const NoiseSquares squares = noise_squares(window, v, sides_, static_cast<double>(edge_[v]));
      if (!window.right()) noise_known_[v] = 0;
      residual[v] = static_cast<float>(squares.residual);
      between[v] = static_cast<float>(squares.between);
    }
    near = around_wanted(kHaloRings);
    pool(near, residual, between);
    fill_between();
  }

  /// At the measured centres the larger of both medians over the rings around; elsewhere -1.
  void pool(std::span<const std::uint8_t> near_wanted, const std::vector<float>& residual,
            const std::vector<float>& between) {
    std::vector<std::uint32_t> stamp(size(), 0), near;
    std::vector<std::uint8_t> right = noise_known_;
    std::vector<float> values;
    for (std::uint32_t v = 0; v < size(); ++v) {
      noise_[v] = -1.0F;
      if (near_wanted[v] == 0 || (residual[v] < 0.0F && between[v] < 0.0F)) continue;
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
      for (const std::uint32_t u : near) right[v] &= noise_known_[u];
      const auto median_of = [&](const std::vector<float>& squares) {
        values.clear();
        for (const std::uint32_t u : near)
          if (squares[u] >= 0.0F) values.push_back(squares[u]);
        return values.empty() ? -1.0 : median(values);
      };
      noise_[v] = static_cast<float>(std::sqrt(noise_variance(median_of(residual), median_of(between))));
    }
    noise_known_.swap(right);
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
    erode(block_, corners_, kFillRings, noise_known_);
  }

  /// Centres with one side tell the vertices around them where to go.
  void fit_centres(SurfaceWindow& window) {
    served_.assign(size(), {});
    fits_known_ = noise_known_;
    const std::vector<std::uint8_t> near = around_wanted(kGuardRounds + kServedRings);
    for (std::uint32_t c = 0; c < size(); ++c) {
      if (near[c] == 0 || centre_[c] == 0) continue;
      sides_.find(block_, corners_.at(c), normals_, position_);
      if (sides_.count() != 1) continue;
      fitted_.clear();
      const double radius = fit_side(window, c, sides_.normal(0), sides_.faces(0));
      if (!window.right()) fits_known_[c] = 0;
      if (!fitted_.empty() && radius >= kMinServed * static_cast<double>(edge_[c])) serve(window, radius);
    }
    erode(block_, corners_, kServedRings, fits_known_);
  }

  void serve(const SurfaceWindow& window, double radius) {
    const double per_square = 1.0 / (kServedShare * kServedShare * radius * radius);
    for (const SurfaceWindow::Taken& taken : window.taken()) {
      if (taken.ring > kServedRings) continue;
      const Double3& p = position_[taken.vertex];
      const double inside = 1.0 - squared_distance(p, fitted_[0].frame.origin) * per_square;
      if (!(inside > 0.0)) continue;
      Double3 gradient;
      const double distance = fitted_[0].distance(p, gradient);
      const float w = taken.likeness * static_cast<float>(inside * inside), d = static_cast<float>(distance);
      Served& there = served_[taken.vertex];
      there.weight += w;
      there.move = there.move + narrow(gradient) * (-w * d);
      there.distance += w * d;
      there.square += w * d * d;
    }
  }

  Double3 moved(SurfaceWindow& window, std::uint32_t v) {
    window_right_ = true;
    sides_.find(block_, corners_.at(v), normals_, position_);
    fitted_.clear();
    const Double3& here = position_[v];
    const double edge = static_cast<double>(edge_[v]),
                 noise = std::max(static_cast<double>(noise_[v]), kMinNoise * edge);
    if (sides_.count() == 1) {
      const Served& s = served_[v];
      if (s.weight >= kEnough) {
        const double mean = static_cast<double>(s.distance / s.weight),
                     variance = static_cast<double>(s.square / s.weight) - mean * mean;
        if (variance <= kAgreement * kAgreement * noise * noise)
          return here + wide(s.move * (1.0F / s.weight));
      }
    }
    for (std::size_t k = 0; k < sides_.count(); ++k) fit_side(window, v, sides_.normal(k), sides_.faces(k));
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

  /// \return radius of the window; 0 where no quadric fits
  double fit_side(SurfaceWindow& window, std::uint32_t v, const Double3& normal,
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
    window_right_ &= window.right();
    if (const auto fit = choice.result(window.samples())) fitted_.push_back({window.frame(), fit->c});
    return choice.radius();
  }

  const MeshBlock& block_;
  const FaceCorners& corners_;
  const DenoiseOptions& options_;
  std::vector<std::uint8_t> known_;  ///< n, of normals around, untangled position and centres
  std::span<const std::uint8_t> wanted_;
  std::vector<Float3> normals_;    ///< m
  std::vector<Double3> position_;  ///< n, untangled
  std::vector<float> edge_;        ///< n, mean length around
  std::vector<std::uint8_t> centre_;
  std::vector<float> noise_;  ///< n, standard deviation; -1 where unknown
  std::vector<std::uint8_t> noise_known_, fits_known_;
  std::vector<Served> served_;
  bool window_right_ = true;  ///< of all windows at the vertex at hand
  StarSides sides_;
  std::vector<FittedSide> fitted_;
  std::vector<std::uint32_t> all_;
};

}  // namespace

int denoise_rings(const DenoiseOptions& options) {
  const int noise = SurfaceWindow::kRings + kPoolRings + kFillRings;
  return std::max(normal_rings(options.normals) + kUntangleRounds, kChoiceRings + 1) +
         (options.noise > 0.0 ? SurfaceWindow::kRings : noise) + kServedRings + kGuardRounds + 1;
}

double denoise_edges(const DenoiseOptions& options) {
  const double widest = window_radius(kWindows - 1), noise = kNoiseWindow + kPoolRings + kFillRings;
  const int before = std::max(normal_rings(options.normals) + kUntangleRounds, kChoiceRings + 1);
  return before + (options.noise > 0.0 ? widest : std::max(widest, noise)) + kServedRings + kGuardRounds;
}

DenoisedBlock denoise(const MeshBlock& block, const FaceCorners& corners, const DenoiseOptions& options,
                      std::span<const std::uint8_t> whole, std::span<const std::uint8_t> wanted) {
  return Denoiser(block, corners, options, whole, wanted).run();
}

std::uint64_t denoise_bytes(std::uint64_t vertices, std::uint64_t faces) {
  const std::uint64_t filter = normal_bytes(faces) + vertices;
  // Normals, untangled positions, edges, noise; flags; what fits say.
  const std::uint64_t stay = 12 * faces + (24 + 8 + 4 + 24) * vertices;
  // To untangle, marks and the reversed; to choose, three numbers; to measure, the window, two squares, stamps and a second
  // set of noise; at last a second set of positions.
  const std::uint64_t measure = SurfaceWindow::bytes(vertices, faces) + 24 * vertices;
  return std::max({filter, stay + 34 * vertices, stay + measure,
                   stay + SurfaceWindow::bytes(vertices, faces) + 54 * vertices}) +
         (1U << 20);
}

}  // namespace tessera
