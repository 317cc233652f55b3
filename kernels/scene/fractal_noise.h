/// \file fractal_noise.h
/// Band-limited fractal noise with exact derivatives: sums of gradient noise (Perlin 2002, quintic fade) on
/// integer lattices with hashed gradients. Same bits on every machine, no tables.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "octree/portable_math.h"

namespace tessera::synth {

struct FractalOptions {
  int octaves = 6;
  double wavelength = 256.0;  ///< of the first octave; halves with each
  double amplitude = 70.0;    ///< factor of the first octave, whose noise lies in about [-0.7, 0.7]
  double gain = 0.45;         ///< amplitude ratio of successive octaves
  std::uint32_t seed = 1;
};

/// Height and both slopes at n points. All spans have the same size, outputs do not overlap inputs.
/// \pre |x|, |y| / smallest wavelength < 2^30
void fractal_heights(const FractalOptions& options, std::span<const double> x, std::span<const double> y,
                     std::span<double> height, std::span<double> slope_x, std::span<double> slope_y);

/// Bounds over the whole plane, certified: |height| and |slope| never exceed them.
double fractal_height_bound(const FractalOptions& options);
double fractal_slope_bound(const FractalOptions& options);

/// Three-dimensional variant: value at p; `gradient` receives the exact gradient.
double fractal_volume(const FractalOptions& options, const Double3& p, Double3& gradient);
double fractal_volume_slope_bound(const FractalOptions& options);

}  // namespace tessera::synth
