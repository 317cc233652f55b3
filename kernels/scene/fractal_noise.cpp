#include "kernels/scene/fractal_noise.h"

namespace tessera::synth {
namespace {

// Two rounds of multiply and shift: enough for gradients that no eye and no reconstruction can tell from
// random.
inline std::uint32_t hash2(std::uint32_t i, std::uint32_t j, std::uint32_t seed) {
  std::uint32_t h = i * 0x8da6b343u ^ j * 0xd8163841u ^ seed;
  h = (h ^ h >> 15) * 0x2c1b3c6du;
  h = (h ^ h >> 12) * 0x297a2d39u;
  return h ^ h >> 15;
}

// Gradient components in [-1, 1) from the halves of a hash.
inline double low_half(std::uint32_t h) {
  return static_cast<double>(static_cast<std::int32_t>(h << 16) >> 16) * 0x1p-15;
}
inline double high_half(std::uint32_t h) {
  return static_cast<double>(static_cast<std::int32_t>(h) >> 16) * 0x1p-15;
}

inline double fade(double t) {
  return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}
inline double fade_slope(double t) {
  return 30.0 * t * t * (t * (t - 2.0) + 1.0);
}

// Largest |value| of one octave: weights sum to 1 and the weighted offsets are at most 1/2 per axis. Largest
// partial derivative: 1 from the gradients, 15/8 (the steepest fade) times at most 2 from their differences.
constexpr double kValueBound = 1.0;
constexpr double kPartialBound = 1.0 + 1.875 * 2.0;
constexpr double kVolumePartialBound = 1.0 + 1.875 * 3.0;

std::uint32_t octave_seed(const FractalOptions& options, int octave) {
  return static_cast<std::uint32_t>(
      random_bits(options.seed, 0x6e6f697365, static_cast<std::uint64_t>(octave)));
}

// Adds one octave. Written without branches over plain arrays so that the compiler turns it into vectors;
// every item has its own chain of operations, so the width of the vectors does not change a bit.
void add_octave(std::size_t n, const double* __restrict x, const double* __restrict y, double frequency,
                double amplitude, double shift, std::uint32_t seed, double* __restrict height,
                double* __restrict slope_x, double* __restrict slope_y) {
  const double slope_scale = amplitude * frequency;
  for (std::size_t i = 0; i < n; ++i) {
    const double px = x[i] * frequency + shift;
    const double py = y[i] * frequency - shift;
    const double fx = std::floor(px), fy = std::floor(py);
    const double tx = px - fx, ty = py - fy;
    const std::uint32_t ix = static_cast<std::uint32_t>(static_cast<std::int32_t>(fx));
    const std::uint32_t iy = static_cast<std::uint32_t>(static_cast<std::int32_t>(fy));
    const std::uint32_t h00 = hash2(ix, iy, seed), h10 = hash2(ix + 1, iy, seed);
    const std::uint32_t h01 = hash2(ix, iy + 1, seed), h11 = hash2(ix + 1, iy + 1, seed);
    const double ax = low_half(h00), ay = high_half(h00), bx = low_half(h10), by = high_half(h10);
    const double cx = low_half(h01), cy = high_half(h01), dx = low_half(h11), dy = high_half(h11);
    const double a = ax * tx + ay * ty;
    const double b = bx * (tx - 1.0) + by * ty;
    const double c = cx * tx + cy * (ty - 1.0);
    const double d = dx * (tx - 1.0) + dy * (ty - 1.0);
    const double u = fade(tx), v = fade(ty);
    const double mixed = (a - b) + (d - c);
    const double uv = u * v;
    height[i] += amplitude * (a + u * (b - a) + v * (c - a) + uv * mixed);
    slope_x[i] += slope_scale * (ax + u * (bx - ax) + v * (cx - ax) + uv * ((ax - bx) + (dx - cx)) +
                                 fade_slope(tx) * ((b - a) + v * mixed));
    slope_y[i] += slope_scale * (ay + u * (by - ay) + v * (cy - ay) + uv * ((ay - by) + (dy - cy)) +
                                 fade_slope(ty) * ((c - a) + u * mixed));
  }
}

template <class Term>
double sum_octaves(const FractalOptions& options, const Term& term) {
  double sum = 0.0, amplitude = options.amplitude, frequency = 1.0 / options.wavelength;
  for (int k = 0; k < options.octaves; ++k) {
    sum += term(amplitude, frequency);
    amplitude *= options.gain;
    frequency *= 2.0;
  }
  return sum;
}

}  // namespace

void fractal_heights(const FractalOptions& options, std::span<const double> x, std::span<const double> y,
                     std::span<double> height, std::span<double> slope_x, std::span<double> slope_y) {
  const std::size_t n = x.size();
  for (std::size_t i = 0; i < n; ++i) height[i] = slope_x[i] = slope_y[i] = 0.0;
  double amplitude = options.amplitude, frequency = 1.0 / options.wavelength;
  for (int k = 0; k < options.octaves; ++k) {
    // Lattices of the octaves are shifted against each other, or their zeros would coincide at nodes.
    add_octave(n, x.data(), y.data(), frequency, amplitude, 0.37 * (k + 1), octave_seed(options, k),
               height.data(), slope_x.data(), slope_y.data());
    amplitude *= options.gain;
    frequency *= 2.0;
  }
}

double fractal_height_bound(const FractalOptions& options) {
  return sum_octaves(options, [](double amplitude, double) { return kValueBound * std::fabs(amplitude); });
}

double fractal_slope_bound(const FractalOptions& options) {
  return sum_octaves(options, [](double amplitude, double frequency) {
    return kPartialBound * 1.41421356237309504880 * std::fabs(amplitude) * frequency;
  });
}

double fractal_volume(const FractalOptions& options, const Double3& p, Double3& gradient) {
  double value = 0.0, amplitude = options.amplitude, frequency = 1.0 / options.wavelength;
  gradient = {};
  for (int k = 0; k < options.octaves; ++k) {
    const std::uint32_t seed = octave_seed(options, k);
    const double shift = 0.37 * (k + 1);
    const Double3 q{p[0] * frequency + shift, p[1] * frequency - shift, p[2] * frequency + 0.61 * shift};
    const Double3 f{std::floor(q[0]), std::floor(q[1]), std::floor(q[2])};
    const Double3 t = q - f;
    const Double3 w{fade(t[0]), fade(t[1]), fade(t[2])};
    const Double3 s{fade_slope(t[0]), fade_slope(t[1]), fade_slope(t[2])};
    double sum = 0.0;
    Double3 slope{};
    for (int corner = 0; corner < 8; ++corner) {
      const int i = corner & 1, j = corner >> 1 & 1, l = corner >> 2;
      const std::uint32_t kx = static_cast<std::uint32_t>(static_cast<std::int32_t>(f[0]) + i);
      const std::uint32_t ky = static_cast<std::uint32_t>(static_cast<std::int32_t>(f[1]) + j);
      const std::uint32_t kz = static_cast<std::uint32_t>(static_cast<std::int32_t>(f[2]) + l);
      const std::uint32_t h = hash2(kx, ky, seed ^ kz * 0xcb1ab31fu);
      const Double3 g{low_half(h), high_half(h), low_half(h * 0x297a2d39u >> 11)};
      const double value_here = g[0] * (t[0] - i) + g[1] * (t[1] - j) + g[2] * (t[2] - l);
      const double wx = i ? w[0] : 1.0 - w[0], wy = j ? w[1] : 1.0 - w[1], wz = l ? w[2] : 1.0 - w[2];
      sum += wx * wy * wz * value_here;
      slope =
          slope + g * (wx * wy * wz) +
          Double3{(i ? s[0] : -s[0]) * wy * wz, (j ? s[1] : -s[1]) * wx * wz, (l ? s[2] : -s[2]) * wx * wy} *
              value_here;
    }
    value += amplitude * sum;
    gradient = gradient + slope * (amplitude * frequency);
    amplitude *= options.gain;
    frequency *= 2.0;
  }
  return value;
}

double fractal_volume_slope_bound(const FractalOptions& options) {
  return sum_octaves(options, [](double amplitude, double frequency) {
    return kVolumePartialBound * 1.73205080756887729353 * std::fabs(amplitude) * frequency;
  });
}

}  // namespace tessera::synth
