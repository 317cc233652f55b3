/// \file surface_noise.h
/// How noisy a surface is along its normal: from what quadrics in small windows leave (noise from one vertex to the next)
/// and from how far they move in the middle when the window grows (noise over a few edges, as extraction leaves it).
/// Both are squares whose median over many places tells the variance: creases and thin parts, where quadrics fail, are few.
#pragma once
#include <cstdint>
#include <map>
#include <span>

#include "kernels/mesh/face_corners.h"
#include "kernels/mesh/mesh_block.h"
#include "kernels/smooth/star_sides.h"
#include "kernels/smooth/surface_window.h"
#include "kernels/smooth/window_fit.h"

namespace tessera {

/// Measured at one vertex, squared scan units; negative where no quadric fits.
struct NoiseSquares {
  double residual = -1.0;  ///< mean square of what a quadric leaves
  double between = -1.0;   ///< noise_square_between() of two windows
};

/// Of the wider one, in edges: the fourth of denoise.h; the narrower one is the first.
inline constexpr double kNoiseWindow = window_radius(3);

/// At a vertex with one smooth side. \param edge  mean length around it
NoiseSquares noise_squares(SurfaceWindow& window, std::uint32_t vertex, const StarSides& sides, double edge);

/// The variance that medians of the two squares tell; either may be negative: there is none.
double noise_variance(double median_residual, double median_between);

/// Squares by class, eight to a factor of two: integers, so those of many blocks add up in any order to the same.
struct NoiseCounts {
  std::map<int, std::uint64_t> residual, between;
  std::uint64_t vertices = 0;

  void add(const NoiseSquares& squares);
  void add(const NoiseCounts& more);
  /// Standard deviation along the normal, scan units, right to the width of a class (5 %); 0 where nothing was measured.
  double noise() const;
  /// Whether three quarters of both squares tell less noise than this: then so does the median of a sample far larger.
  [[nodiscard]] bool surely_below(double noise) const;
};

/// Counts the wanted vertices that have one smooth side and lie on no border.
/// \param corners  the block's own
/// \param wanted   n flags, 1 or 0; right where kNoiseEdges edges of surface lie around
/// \pre the block is canonical, fewer than 2^30 faces, positions finite
/// \cost normals of all faces of the block (denoise_bytes() is enough), 15 us a wanted vertex
[[nodiscard]] NoiseCounts count_noise(const MeshBlock& block, const FaceCorners& corners,
                                      std::span<const std::uint8_t> wanted);
/// How far a measured vertex looks, in edges.
inline constexpr double kNoiseEdges = 10.0;

}  // namespace tessera
