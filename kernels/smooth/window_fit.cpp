#include "kernels/smooth/window_fit.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr std::size_t kTerms = 6;
/// Half width of a confidence interval in standard deviations: first window, second, all others. What a narrow one says
/// weighs little, and an outlier there would end the choice.
constexpr double kConfidence[] = {2.5, 2.0, 1.5};
/// A plane must agree with the windows so far more closely, and leave hardly more than the quadric.
constexpr double kPlaneConfidence = 0.75;
constexpr double kPlaneResidual = 1.1;
/// Below this share of the diagonal a pivot means that the samples do not determine the fit.
constexpr double kMinPivot = 1e-10;

/// Of numbers or of lanes.
template <typename Number>
Number window_weight(Number s, Number t, double per_square, Number weight) {
  const Number u = 1.0 - (s * s + t * t) * per_square;
  const Number inside = u > 0.0 ? u : u * 0.0;
  return inside * inside * weight;
}

std::array<double, kTerms> basis(double s, double t, double per_radius) {
  const double x = s * per_radius, y = t * per_radius;
  return {1.0, x, y, x * x, x * y, y * y};
}

struct Moments {
  SmallMatrix<kTerms> a = SmallMatrix<kTerms>::zero();  ///< the lower triangle
  std::array<double, kTerms> b = {};
  double count = 0.0, weight = 0.0, weight_square = 0.0, height_square = 0.0;
};

Moments sum_moments(const WindowSamples& samples, double radius) {
  const double per_radius = 1.0 / radius, per_square = per_radius * per_radius;
  Double4 a[21] = {}, b[kTerms] = {}, count = {}, square = {}, zz = {};
  const std::size_t packs = samples.pack_count();
  for (std::size_t q = 0; q < packs; ++q) {
    const WindowSamples::Pack& pack = samples.packs()[q];
    const Double4 x = pack.s * per_radius, y = pack.t * per_radius, z = pack.z;
    const Double4 w = window_weight(pack.s, pack.t, per_square, pack.weight);
    const Double4 p[kTerms] = {Double4{} + 1.0, x, y, x * x, x * y, y * y};
    std::size_t at = 0;
    for (std::size_t r = 0; r < kTerms; ++r) {
      const Double4 wp = w * p[r];
      b[r] += wp * z;
      for (std::size_t c = 0; c <= r; ++c) a[at++] += wp * p[c];
    }
    count += w > 0.0 ? Double4{} + 1.0 : Double4{};
    square += w * w;
    zz += w * z * z;
  }
  Moments m;
  std::size_t at = 0;
  for (std::size_t r = 0; r < kTerms; ++r) {
    m.b[r] = lane_sum(b[r]);
    for (std::size_t c = 0; c <= r; ++c) m.a(r, c) = lane_sum(a[at++]);
  }
  m.count = lane_sum(count);
  m.weight = m.a(0, 0);
  m.weight_square = lane_sum(square);
  m.height_square = lane_sum(zz);
  return m;
}

/// How much every sample adds to c0, squared and summed.
double middle_variance(const WindowSamples& samples, double radius, const WindowFit& fit) {
  const double per_radius = 1.0 / radius, per_square = per_radius * per_radius;
  const std::array<double, kTerms>& v = fit.inverse;
  Double4 sum = {};
  const std::size_t packs = samples.pack_count();
  for (std::size_t q = 0; q < packs; ++q) {
    const WindowSamples::Pack& pack = samples.packs()[q];
    const Double4 x = pack.s * per_radius, y = pack.t * per_radius;
    const Double4 w = window_weight(pack.s, pack.t, per_square, pack.weight);
    const Double4 l = w * (v[0] + v[1] * x + v[2] * y + v[3] * (x * x) + v[4] * (x * y) + v[5] * (y * y));
    sum += l * l;
  }
  return lane_sum(sum);
}

}  // namespace

void WindowSamples::add(double s, double t, double z, double weight) {
  const std::size_t pack = size_ / kDoubleLanes, lane = size_ % kDoubleLanes;
  if (pack >= packs_.size()) packs_.emplace_back();
  if (lane == 0) packs_[pack] = Pack{};
  packs_[pack].s[lane] = s;
  packs_[pack].t[lane] = t;
  packs_[pack].z[lane] = z;
  packs_[pack].weight[lane] = weight;
  ++size_;
}

std::optional<WindowFit> fit_window(const WindowSamples& samples, double radius, int terms) {
  const Moments m = sum_moments(samples, radius);
  if (m.count < terms + 2) return std::nullopt;
  SmallMatrix<kTerms> factor = m.a;
  if (!cholesky_factor(factor, 0.0, kMinPivot, terms)) return std::nullopt;
  WindowFit fit;
  std::array<double, kTerms> c = m.b;
  for (auto i = static_cast<std::size_t>(terms); i < kTerms; ++i) c[i] = 0.0;
  cholesky_solve(factor, c, terms);
  fit.inverse = {1.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  cholesky_solve(factor, fit.inverse, terms);
  fit.variance = middle_variance(samples, radius, fit);
  double left = m.height_square;
  for (std::size_t i = 0; i < kTerms; ++i) left -= c[i] * m.b[i];
  const double freedom = m.weight - terms * m.weight_square / m.weight;
  fit.residual_square = left > 0.0 && freedom > 0.0 ? left / freedom : 0.0;
  const double per_radius = 1.0 / radius, per_square = per_radius * per_radius;
  fit.c = {
      c[0], c[1] * per_radius, c[2] * per_radius, c[3] * per_square, c[4] * per_square, c[5] * per_square};
  return fit;
}

double noise_square_between(const WindowSamples& samples, double narrow, double wide) {
  const std::optional<WindowFit> a = fit_window(samples, narrow, 6), b = fit_window(samples, wide, 6);
  if (!a || !b) return -1.0;
  double variance = 0.0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const WindowSamples::Pack& pack = samples.packs()[k / kDoubleLanes];
    const double s = pack.s[k % kDoubleLanes], t = pack.t[k % kDoubleLanes],
                 weight = pack.weight[k % kDoubleLanes];
    double change = 0.0;
    for (const bool second : {false, true}) {
      const double radius = second ? wide : narrow;
      const auto p = basis(s, t, 1.0 / radius);
      const std::array<double, kTerms>& v = second ? b->inverse : a->inverse;
      double sum = 0.0;
      for (std::size_t i = 0; i < kTerms; ++i) sum += v[i] * p[i];
      const double l = sum * window_weight(s, t, 1.0 / (radius * radius), weight);
      change += second ? l : -l;
    }
    variance += change * change;
  }
  const double apart = b->c[0] - a->c[0];
  return variance > 0.0 ? apart * apart / variance : -1.0;
}

bool WindowChoice::offer(const WindowSamples& samples, double radius) {
  offered_ = radius;
  const std::optional<WindowFit> fit = fit_window(samples, radius, 6);
  if (!fit) return true;
  const std::size_t step = std::min(offers_++, std::size(kConfidence) - 1);
  const double half = kConfidence[step] * noise_ * std::sqrt(fit->variance);
  const double low = fit->c[0] - half, high = fit->c[0] + half;
  if (best_) {
    if (std::max(low_, low) > std::min(high_, high)) return false;
    low_ = std::max(low_, low);
    high_ = std::min(high_, high);
    // A lopsided window can be wider and yet tell less.
    if (fit->variance >= best_->variance) return true;
  } else {
    low_ = low;
    high_ = high;
  }
  best_ = fit;
  radius_ = radius;
  return true;
}

std::optional<WindowFit> WindowChoice::result(const WindowSamples& samples) const {
  if (!best_) return fit_window(samples, offered_, 3);
  const std::optional<WindowFit> plane = fit_window(samples, radius_, 3);
  if (!plane || plane->residual_square > kPlaneResidual * best_->residual_square) return best_;
  const double half = kPlaneConfidence * noise_ * std::sqrt(plane->variance);
  return plane->c[0] - half <= high_ && plane->c[0] + half >= low_ ? plane : best_;
}

}  // namespace tessera
