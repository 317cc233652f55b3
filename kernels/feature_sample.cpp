#include "kernels/feature_sample.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

/// A singular value below this fraction of the largest says nothing about the feature.
constexpr double kRelativeCut = 0.1;
/// How far a sample may leave its cell.
constexpr float kCellMargin = 0.25f;
constexpr int kHalvings = 4;
/// Smallest height of a triangle: coordinates in a brick are floats below 64, exact to 2^-18.
constexpr float kMinHeight = 1.0f / 2048;

/// Taylor series about 0; |x| <= pi/2 gives an error below 1e-15.
double cosine(double x) {
  const double y = x * x;
  double term = 1.0;
  double sum = 1.0;
  for (int n = 1; n <= 12; ++n) {
    term *= -y / ((2 * n - 1) * (2 * n));
    sum += term;
  }
  return sum;
}

double cos_degrees(double degrees) {
  constexpr double kRadian = 3.14159265358979323846 / 180.0;
  return degrees > 90.0 ? -cosine((180.0 - degrees) * kRadian) : cosine(degrees * kRadian);
}

using Matrix3 = std::array<Double3, 3>;

/// Eigenvalues and vectors (columns) of a symmetric matrix by cyclic Jacobi rotations.
void eigen_symmetric(Matrix3 a, Double3& value, Matrix3& vector) {
  vector = {Double3{1, 0, 0}, Double3{0, 1, 0}, Double3{0, 0, 1}};
  const double scale = a[0][0] + a[1][1] + a[2][2];
  // Quadratic convergence: six sweeps reach rounding for any 3x3 matrix, most end after three or four.
  for (int sweep = 0; sweep < 8; ++sweep) {
    const double off = a[0][1] * a[0][1] + a[0][2] * a[0][2] + a[1][2] * a[1][2];
    if (off <= 1e-28 * scale * scale) break;
    for (std::size_t p = 0; p < 2; ++p) {
      for (std::size_t q = p + 1; q < 3; ++q) {
        if (a[p][q] == 0.0) continue;
        const double theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
        const double t = (theta < 0.0 ? -1.0 : 1.0) / (std::fabs(theta) + std::sqrt(theta * theta + 1.0));
        const double c = 1.0 / std::sqrt(t * t + 1.0);
        const double s = t * c;
        for (std::size_t k = 0; k < 3; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = c * kp - s * kq;
          a[k][q] = s * kp + c * kq;
        }
        for (std::size_t k = 0; k < 3; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = c * pk - s * qk;
          a[q][k] = s * pk + c * qk;
        }
        for (std::size_t k = 0; k < 3; ++k) {
          const double kp = vector[k][p], kq = vector[k][q];
          vector[k][p] = c * kp - s * kq;
          vector[k][q] = s * kp + c * kq;
        }
      }
    }
  }
  value = {a[0][0], a[1][1], a[2][2]};
}

/// Point nearest to the mass point among the least-squares intersections of the tangent planes.
/// `rank` comes in as the wanted rank and goes out as the one that the planes carry.
Double3 intersect_planes(const LoopSamples& loop, const Double3& mass, int& rank) {
  Matrix3 a{};
  Double3 b{};
  for (std::size_t i = 0; i < static_cast<std::size_t>(loop.size); ++i) {
    Double3 n;
    double d = static_cast<double>(loop.offset[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      n[k] = static_cast<double>(loop.normal[i][k]);
      d += n[k] * (static_cast<double>(loop.point[i][k]) - mass[k]);
    }
    for (std::size_t r = 0; r < 3; ++r) {
      b[r] += n[r] * d;
      for (std::size_t c = 0; c < 3; ++c) a[r][c] += n[r] * n[c];
    }
  }
  Double3 value;
  Matrix3 vector;
  eigen_symmetric(a, value, vector);
  std::array<std::size_t, 3> order = {0, 1, 2};
  if (value[order[0]] < value[order[1]]) std::swap(order[0], order[1]);
  if (value[order[1]] < value[order[2]]) std::swap(order[1], order[2]);
  if (value[order[0]] < value[order[1]]) std::swap(order[0], order[1]);
  const double cut = kRelativeCut * kRelativeCut * value[order[0]];
  Double3 x = mass;
  int used = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(rank); ++k) {
    const std::size_t column = order[k];
    if (!(value[column] > cut)) break;
    const double s =
        (vector[0][column] * b[0] + vector[1][column] * b[1] + vector[2][column] * b[2]) / value[column];
    for (std::size_t r = 0; r < 3; ++r) x[r] += s * vector[r][column];
    ++used;
  }
  rank = used;
  return x;
}

bool fan_is_sound(const LoopSamples& loop, const Float3& centre) {
  for (float c : centre)
    if (!(c >= -kCellMargin && c <= 1.0f + kCellMargin)) return false;
  const auto size = static_cast<std::size_t>(loop.size);
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t j = i + 1 == size ? 0 : i + 1;
    const Float3 up = triangle_normal(loop.point[i], loop.point[j], centre);
    if (!(dot(up, loop.normal[i]) + dot(up, loop.normal[j]) > 0.0f)) return false;
    if (is_sliver(loop.point[i], loop.point[j], centre)) return false;
  }
  return true;
}

}  // namespace

bool is_sliver(const Float3& a, const Float3& b, const Float3& c) {
  const auto squared = [](const Float3& p, const Float3& q) {
    const Float3 d = {p[0] - q[0], p[1] - q[1], p[2] - q[2]};
    return dot(d, d);
  };
  const Float3 up = triangle_normal(a, b, c);
  const float longest = std::max({squared(a, b), squared(b, c), squared(c, a)});
  return !(dot(up, up) > kMinHeight * kMinHeight * longest);
}

FeatureThresholds feature_thresholds(double feature_angle_deg, double corner_angle_deg) {
  FeatureThresholds t;
  t.cone_cos = static_cast<float>(cos_degrees(feature_angle_deg));
  // Two normals within half the angle of a third are within the angle of each other; the margin covers
  // rounding.
  t.quick_dot = static_cast<float>(cos_degrees(0.5 * feature_angle_deg)) + 1e-5f;
  t.corner_sin = static_cast<float>(cos_degrees(90.0 - corner_angle_deg));
  return t;
}

FeatureSample sample_feature(const LoopSamples& loop, const FeatureThresholds& thresholds) {
  FeatureSample sample;
  const auto size = static_cast<std::size_t>(loop.size);
  bool close = true;
  for (std::size_t i = 1; i < size; ++i) close &= dot(loop.normal[0], loop.normal[i]) > thresholds.quick_dot;
  if (close) return sample;

  float least = 2.0f;
  std::size_t first = 0, second = 0;
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = i + 1; j < size; ++j) {
      const float d = dot(loop.normal[i], loop.normal[j]);
      if (d < least) {
        least = d;
        first = i;
        second = j;
      }
    }
  }
  if (!(least < thresholds.cone_cos)) return sample;

  const Float3 zero = {0, 0, 0};
  const Float3 crease = triangle_normal(zero, loop.normal[first], loop.normal[second]);
  const float length = std::sqrt(dot(crease, crease));
  float deviation = 0.0f;
  for (std::size_t i = 0; i < size; ++i)
    deviation = std::max(deviation, std::fabs(dot(crease, loop.normal[i])));
  const bool corner = deviation > thresholds.corner_sin * length;

  Double3 mass = {0, 0, 0};
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t k = 0; k < 3; ++k) mass[k] += static_cast<double>(loop.point[i][k]);
  for (double& m : mass) m /= static_cast<double>(size);

  int rank = corner ? 3 : 2;
  const Double3 x = intersect_planes(loop, mass, rank);
  sample.kind = FeatureKind::kRejected;
  double weight = 1.0;
  for (int halving = 0; halving <= kHalvings; ++halving, weight *= 0.5) {
    for (std::size_t k = 0; k < 3; ++k)
      sample.position[k] = static_cast<float>(mass[k] + weight * (x[k] - mass[k]));
    if (!fan_is_sound(loop, sample.position)) continue;
    sample.kind = corner ? FeatureKind::kCorner : FeatureKind::kCrease;
    sample.on_feature = halving == 0 && rank == (corner ? 3 : 2);
    return sample;
  }
  return sample;
}

}  // namespace tessera
