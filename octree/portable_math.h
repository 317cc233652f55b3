/// \file portable_math.h
/// Counter-based random numbers and elementary functions that give the same bits on every
/// machine: only + - * / sqrt floor and integer operations, never libm transcendentals.
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>

#include "octree/vector.h"

namespace tessera {

inline constexpr double kPi = 3.14159265358979323846;

/// exp(-t), nearly: within 0.013 of it, zero from t = 16.
[[nodiscard]] inline float bell(float t) {
  float u = 1.0F - t * 0.0625F;
  u = u > 0.0F ? u : 0.0F;
  u *= u;
  u *= u;
  u *= u;
  return u * u;
}

/// 64 well mixed bits of a counter (the finaliser of Steele, Lea, Flood 2014, "SplitMix").
[[nodiscard]] constexpr std::uint64_t mix(std::uint64_t v) {
  v += 0x9e3779b97f4a7c15ULL;
  v = (v ^ v >> 30) * 0xbf58476d1ce4e5b9ULL;
  v = (v ^ v >> 27) * 0x94d049bb133111ebULL;
  return v ^ v >> 31;
}
/// Random bits named by (seed, stream, index): no state, so any thread may draw any of them at any time.
[[nodiscard]] constexpr std::uint64_t random_bits(std::uint64_t seed, std::uint64_t stream,
                                                  std::uint64_t index) {
  return mix(mix(seed * 0xd1342543de82ef95ULL + stream) ^ mix(index));
}
/// [0, 1), 53 bits.
[[nodiscard]] constexpr double to_unit(std::uint64_t bits) {
  return static_cast<double>(bits >> 11) * 0x1p-53;
}

struct SinCos {
  double sin, cos;
};
/// Sine and cosine of an angle in radians, |angle| < 1e6; error below 1e-15 (+ 1e-16 |angle|).
[[nodiscard]] inline SinCos sin_cos(double angle) {
  const double quarter = std::floor(angle * (2.0 / kPi) + 0.5);
  // pi/2 in two parts: the first has few bits, so that its product with `quarter` is exact.
  const double r = (angle - quarter * 1.57079632673412561417) - quarter * 6.07710050650619224932e-11;
  const double q = r * r;
  const double s =
      r * (1.0 -
           q / 6.0 *
               (1.0 - q / 20.0 *
                          (1.0 - q / 42.0 *
                                     (1.0 - q / 72.0 *
                                                (1.0 - q / 110.0 * (1.0 - q / 156.0 * (1.0 - q / 210.0)))))));
  const double c =
      1.0 -
      q / 2.0 *
          (1.0 -
           q / 12.0 *
               (1.0 - q / 30.0 *
                          (1.0 - q / 56.0 *
                                     (1.0 - q / 90.0 *
                                                (1.0 - q / 132.0 * (1.0 - q / 182.0 * (1.0 - q / 240.0)))))));
  switch (static_cast<std::int64_t>(quarter) & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

[[nodiscard]] inline double cosine_of_degrees(double degrees) {
  return sin_cos(degrees * (kPi / 180.0)).cos;
}

/// Natural logarithm of a positive normal number; error below 1e-15 relative to max(1, |result|).
[[nodiscard]] inline double natural_log(double v) {
  std::uint64_t bits = std::bit_cast<std::uint64_t>(v);
  std::int64_t exponent = static_cast<std::int64_t>(bits >> 52) - 1023;
  bits = (bits & 0x000fffffffffffffULL) | 0x3ff0000000000000ULL;
  double m = std::bit_cast<double>(bits);
  if (m > 1.41421356237309504880) {
    m *= 0.5;
    ++exponent;
  }
  const double t = (m - 1.0) / (m + 1.0);  // ln m = 2 atanh t, |t| < 0.172
  const double q = t * t;
  double series = 1.0 / 21.0;
  for (int k = 19; k >= 1; k -= 2) series = series * q + 1.0 / k;
  return 2.0 * t * series + static_cast<double>(exponent) * 0.69314718055994530942;
}

/// Angle between two vectors in [0, pi], also accurate where they are nearly parallel; error below 1e-14.
/// \pre both are unit vectors
[[nodiscard]] inline double angle_between(const Double3& a, const Double3& b) {
  const double across = norm(a - b), along = norm(a + b);  // tan(angle / 2) = across / along
  const bool steep = across > along;
  double t = steep ? along / across : across / along;
  if (!(t > 0.0)) return steep ? kPi : 0.0;
  // Two halvings bring the tangent below 0.2, where eleven terms of the series suffice.
  for (int k = 0; k < 2; ++k) t = t / (1.0 + std::sqrt(1.0 + t * t));
  double series = 0.0;
  for (int k = 23; k >= 1; k -= 2) series = 1.0 / k - t * t * series;
  const double half = 4.0 * t * series;
  return 2.0 * (steep ? 0.5 * kPi - half : half);
}

/// Standard normal variate from 64 + 64 random bits (Box and Muller 1958), |result| < 8.6.
[[nodiscard]] inline double gaussian(std::uint64_t a, std::uint64_t b) {
  const double u = to_unit(a) + 0x1p-54;  // never 0
  return std::sqrt(-2.0 * natural_log(u)) * sin_cos(2.0 * kPi * to_unit(b)).cos;
}

}  // namespace tessera
