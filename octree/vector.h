/// \file vector.h
/// Vectors and their arithmetic: only + - * / sqrt, the same bits on every machine.
///
/// Vector3 is an std::array of a name of its own, in nothing else different, so that `a + b` is found by its arguments from any
/// namespace. The operators take plain arrays too, where this namespace is looked into.
#pragma once
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <type_traits>

namespace tessera {

using Int3 = std::array<std::int32_t, 3>;
using Double2 = std::array<double, 2>;
template <class T>
struct Vector3 : std::array<T, 3> {};
using Double3 = Vector3<double>;
using Float3 = Vector3<float>;

/// Whether a type holds several numbers that are worked on side by side (lanes.h).
template <class T>
inline constexpr bool kIsLanes = false;
template <class T>
concept Coordinate = std::floating_point<T> || kIsLanes<T>;

template <Coordinate T>
constexpr Vector3<T> operator+(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
template <Coordinate T>
constexpr Vector3<T> operator-(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
template <Coordinate T>
constexpr Vector3<T> operator-(const std::array<T, 3>& a) {
  return {-a[0], -a[1], -a[2]};
}
template <Coordinate T>
constexpr Vector3<T> operator*(const std::array<T, 3>& a, std::type_identity_t<T> s) {
  return {a[0] * s, a[1] * s, a[2] * s};
}
template <Coordinate T>
constexpr Vector3<T> operator/(const std::array<T, 3>& a, std::type_identity_t<T> s) {
  return {a[0] / s, a[1] / s, a[2] / s};
}
template <Coordinate T>
[[nodiscard]] constexpr T dot(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
template <Coordinate T>
[[nodiscard]] constexpr Vector3<T> cross(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
template <std::floating_point T>
[[nodiscard]] T norm(const std::array<T, 3>& a) {
  return std::sqrt(dot(a, a));
}
/// \pre a is not zero
template <std::floating_point T>
[[nodiscard]] Vector3<T> unit(const std::array<T, 3>& a) {
  return a * (T{1} / norm(a));
}
/// Zero stays zero.
template <std::floating_point T>
[[nodiscard]] Vector3<T> unit_or_zero(const std::array<T, 3>& a) {
  const T length = norm(a);
  return length > T{0} ? a * (T{1} / length) : Vector3<T>{};
}
template <std::floating_point T>
[[nodiscard]] T squared_distance(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  const Vector3<T> d = a - b;
  return dot(d, d);
}
/// Twice the area of the triangle (a, b, c), along its normal.
template <std::floating_point T>
[[nodiscard]] Vector3<T> triangle_normal(const std::array<T, 3>& a, const std::array<T, 3>& b,
                                         const std::array<T, 3>& c) {
  return cross(b - a, c - a);
}
/// Any unit vector at right angles to the unit vector `n`; continuous except where its smallest component changes.
[[nodiscard]] inline Double3 any_orthogonal(const Double3& n) {
  const double ax = std::fabs(n[0]), ay = std::fabs(n[1]), az = std::fabs(n[2]);
  const Double3 axis = ax <= ay && ax <= az ? Double3{1, 0, 0}
                       : ay <= az           ? Double3{0, 1, 0}
                                            : Double3{0, 0, 1};
  return unit(cross(n, axis));
}

[[nodiscard]] constexpr Double3 wide(const Float3& a) {
  return {static_cast<double>(a[0]), static_cast<double>(a[1]), static_cast<double>(a[2])};
}
[[nodiscard]] constexpr Float3 narrow(const Double3& a) {
  return {static_cast<float>(a[0]), static_cast<float>(a[1]), static_cast<float>(a[2])};
}

}  // namespace tessera

// auto [x, y, z] = vector;
template <class T>
struct std::tuple_size<tessera::Vector3<T>> : std::integral_constant<std::size_t, 3> {};
template <std::size_t I, class T>
struct std::tuple_element<I, tessera::Vector3<T>> {
  using type = T;
};
