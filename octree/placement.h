/// \file placement.h
/// Affine maps of space: how solids are placed, and where handles of an edit go.
#pragma once
#include <array>

#include "octree/portable_math.h"
#include "octree/vector.h"

namespace tessera {

/// x -> M x + shift, rows of M first.
struct Placement {
  std::array<double, 9> matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  Double3 shift = {0, 0, 0};

  [[nodiscard]] Double3 apply(const Double3& p) const { return apply_linear(p) + shift; }
  /// M p, without the shift.
  [[nodiscard]] Double3 apply_linear(const Double3& p) const {
    const auto& m = matrix;
    return {m[0] * p[0] + m[1] * p[1] + m[2] * p[2], m[3] * p[0] + m[4] * p[1] + m[5] * p[2],
            m[6] * p[0] + m[7] * p[1] + m[8] * p[2]};
  }
  /// This after `first`.
  [[nodiscard]] Placement after(const Placement& first) const {
    Placement out;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        out.matrix[3 * i + j] = matrix[3 * i] * first.matrix[j] + matrix[3 * i + 1] * first.matrix[3 + j] +
                                matrix[3 * i + 2] * first.matrix[6 + j];
    out.shift = apply(first.shift);
    return out;
  }
  double determinant() const {
    const auto& m = matrix;
    return dot(Double3{m[0], m[1], m[2]}, cross(Double3{m[3], m[4], m[5]}, Double3{m[6], m[7], m[8]}));
  }
  /// \pre determinant() is not zero
  [[nodiscard]] Placement inverse() const {
    const auto& m = matrix;
    const Double3 a = {m[0], m[1], m[2]}, b = {m[3], m[4], m[5]}, c = {m[6], m[7], m[8]};
    const double d = determinant();
    const Double3 x = cross(b, c) / d, y = cross(c, a) / d, z = cross(a, b) / d;
    Placement out;
    out.matrix = {x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]};
    out.shift = -out.apply_linear(shift);
    return out;
  }
  /// The same map about `centre` instead of the origin.
  [[nodiscard]] Placement about(const Double3& centre) const {
    Placement out = *this;
    out.shift = shift + centre - apply_linear(centre);
    return out;
  }
  [[nodiscard]] bool is_identity() const { return *this == Placement{}; }
  bool operator==(const Placement&) const = default;
};

/// By `degrees` about an axis through the origin, as a right-handed screw. \pre unit axis
[[nodiscard]] inline Placement rotation(const Double3& axis, double degrees) {
  const SinCos t = sin_cos(degrees * (kPi / 180.0));
  Placement out;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const double mixed = i == j ? 0.0 : ((j + 3 - i) % 3 == 1 ? -axis[3 - i - j] : axis[3 - i - j]);
      out.matrix[3 * i + j] = (1.0 - t.cos) * axis[i] * axis[j] + (i == j ? t.cos : 0.0) + t.sin * mixed;
    }
  return out;
}

}  // namespace tessera
