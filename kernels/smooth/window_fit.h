/// \file window_fit.h
/// Quadrics fitted to a window of a surface, as wide as its noise asks for and its shape allows.
///
/// A wider window has less variance and more bias. The widest one is taken whose height in the middle agrees
/// with those of all narrower ones within their standard deviations: intersection of confidence intervals
/// (Goldenshluger and Nemirovski 1997; Katkovnik 1999), here with the quadrics of moving least squares.
#pragma once
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "octree/lanes.h"

namespace tessera {

/// Heights z over the points (s, t) of a plane. The window's middle is (0, 0); one length unit for all.
class WindowSamples {
 public:
  void clear() { size_ = 0; }
  /// \param weight  >= 0, of this sample in every window
  void add(double s, double t, double z, double weight);
  [[nodiscard]] std::size_t size() const { return size_; }

  struct Pack {
    Double4 s = {}, t = {}, z = {}, weight = {};
  };
  /// Packs of four; the last is filled up with samples of weight zero.
  [[nodiscard]] const std::vector<Pack>& packs() const { return packs_; }
  [[nodiscard]] std::size_t pack_count() const { return (size_ + kDoubleLanes - 1) / kDoubleLanes; }

 private:
  std::vector<Pack> packs_;
  std::size_t size_ = 0;
};

/// z = c0 + c1 s + c2 t + c3 s^2 + c4 s t + c5 t^2
struct WindowFit {
  std::array<double, 6> c = {};
  double variance = 0.0;         ///< of c0, for samples whose heights have variance 1 and are independent
  double residual_square = 0.0;  ///< mean square of what the fit leaves, over its degrees of freedom
  std::array<double, 6> inverse = {};  ///< first row of the normal equations' inverse, scaled by the radius
};

/// Weighted least squares with the weights times (1 - (s^2 + t^2) / radius^2)^2, zero beyond the radius.
/// \param terms  6: a quadric; 3: a plane
/// \return nothing with fewer than terms + 2 samples in the window or where they do not determine the fit
[[nodiscard]] std::optional<WindowFit> fit_window(const WindowSamples& samples, double radius, int terms);

/// Square of the noise that explains how far the quadrics of two windows differ in the middle: its median
/// over many places, over the median 0.455 of chi-square, is the variance of independent noise, and what
/// correlated noise of this wavelength amounts to.
/// \return negative where there is no fit
double noise_square_between(const WindowSamples& samples, double narrow, double wide);

/// Radii of the windows, smallest first: kSmallestWindow * kWindowGrowth^i, in mean edges.
constexpr double kSmallestWindow = 2.2;
constexpr double kWindowGrowth = 1.35;
[[nodiscard]] constexpr double window_radius(int number) {
  double radius = kSmallestWindow;
  for (int i = 0; i < number; ++i) radius *= kWindowGrowth;
  return radius;
}
constexpr int kWindows = 6;        ///< to 9.9 edges
constexpr int kCreaseWindows = 8;  ///< to 18 edges: half a window tells less, and a crease runs on

/// Chooses the window while it grows.
class WindowChoice {
 public:
  explicit WindowChoice(double noise) : noise_(noise) {}

  /// Windows in ascending order. \return false when no wider one can be taken
  bool offer(const WindowSamples& samples, double radius);
  /// The best so far, if any.
  [[nodiscard]] const std::optional<WindowFit>& best() const { return best_; }
  /// Its window; 0 when there is none.
  double radius() const { return radius_; }
  /// A plane in the chosen window replaces the quadric where it agrees as well: it has less variance still. Where
  /// no quadric could be fitted, a plane in the last window offered, if there is one.
  [[nodiscard]] std::optional<WindowFit> result(const WindowSamples& samples) const;

 private:
  double noise_;
  std::size_t offers_ = 0;
  double low_ = 0.0, high_ = 0.0, radius_ = 0.0, offered_ = 0.0;
  std::optional<WindowFit> best_;
};

}  // namespace tessera
