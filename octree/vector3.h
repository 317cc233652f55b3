/// \file vector3.h
/// Arithmetic of Double3: only + - * / sqrt, the same bits on every machine.
#pragma once
#include <cmath>

#include "octree/lattice.h"

namespace tessera {

inline Double3 operator+(const Double3& a, const Double3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
inline Double3 operator-(const Double3& a, const Double3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Double3 operator*(const Double3& a, double s) {
  return {a[0] * s, a[1] * s, a[2] * s};
}
inline double dot(const Double3& a, const Double3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Double3 cross(const Double3& a, const Double3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double norm(const Double3& a) {
  return std::sqrt(dot(a, a));
}
/// Zero stays zero.
inline Double3 unit_or_zero(const Double3& a) {
  const double length = norm(a);
  return length > 0.0 ? a * (1.0 / length) : Double3{};
}

inline Double3 wide(const Float3& a) {
  return {static_cast<double>(a[0]), static_cast<double>(a[1]), static_cast<double>(a[2])};
}
inline Float3 narrow(const Double3& a) {
  return {static_cast<float>(a[0]), static_cast<float>(a[1]), static_cast<float>(a[2])};
}

}  // namespace tessera
