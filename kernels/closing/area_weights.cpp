#include "kernels/closing/area_weights.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "octree/vector.h"

namespace tessera {
namespace {

/// Least length of the mean normal that is trusted: beyond it the normals of a voxel contradict each other.
constexpr double kMinMeanNormal = 0.3;
/// Most that one point stands for, cells^2: a stray one must not make a blob of its own, whose winding number right
/// behind it passes one half (from 4 pi kDipoleCore^2 / 2 on).
constexpr double kMaxArea = 1.5;

struct Polygon {
  std::array<Double3, 16> corner;
  std::size_t size = 0;
};

/// Keeps the part with sign * coordinate <= limit.
void clip(Polygon& polygon, std::size_t axis, double sign, double limit) {
  Polygon out;
  for (std::size_t i = 0; i < polygon.size; ++i) {
    const Double3& a = polygon.corner[i];
    const Double3& b = polygon.corner[i + 1 == polygon.size ? 0 : i + 1];
    const double da = sign * a[axis] - limit, db = sign * b[axis] - limit;
    if (da <= 0.0) out.corner[out.size++] = a;
    if ((da <= 0.0) == (db <= 0.0)) continue;
    const double t = da / (da - db);
    Double3 cut;
    for (std::size_t c = 0; c < 3; ++c) cut[c] = a[c] + t * (b[c] - a[c]);
    out.corner[out.size++] = cut;
  }
  polygon = out;
}

/// One side of the surface in one voxel.
struct Side {
  Double3 position = {0, 0, 0};
  Double3 normal = {0, 0, 0};
  double points = 0.0;

  void add(const Double3& p, const Double3& n) {
    points += 1.0;
    for (std::size_t c = 0; c < 3; ++c) position[c] += p[c], normal[c] += n[c];
  }
  /// Area per point.
  float weight() const {
    const double size = norm(normal);
    if (!(size > 0.0)) return 0.0f;
    Double3 n, p;
    for (std::size_t c = 0; c < 3; ++c) n[c] = normal[c] / size, p[c] = position[c] / points;
    const double area = plane_area_in_cube(p, n, kAreaVoxelCells) / std::max(size, kMinMeanNormal * points);
    return static_cast<float>(std::min(area, kMaxArea));
  }
};

}  // namespace

double plane_area_in_cube(const Double3& point, const Double3& normal, double edge) {
  std::size_t minimum = 0;
  for (std::size_t c = 1; c < 3; ++c)
    if (std::fabs(normal[c]) < std::fabs(normal[minimum])) minimum = c;
  Double3 axis = {0, 0, 0};
  axis[minimum] = 1.0;
  Double3 u = cross(normal, axis);
  const double size = norm(u);
  for (double& c : u) c /= size;
  const Double3 v = cross(normal, u);
  Polygon polygon;
  const double extent = 4.0 * edge;  // more than the diagonal, whatever point of the cube it is
  for (const auto& [s, t] : {std::pair{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) {
    Double3& corner = polygon.corner[polygon.size++];
    for (std::size_t c = 0; c < 3; ++c) corner[c] = point[c] + extent * (s * u[c] + t * v[c]);
  }
  for (std::size_t c = 0; c < 3; ++c) {
    clip(polygon, c, -1.0, 0.0);
    clip(polygon, c, 1.0, edge);
  }
  Double3 sum = {0, 0, 0};
  for (std::size_t i = 2; i < polygon.size; ++i) {
    Double3 a, b;
    for (std::size_t c = 0; c < 3; ++c) {
      a[c] = polygon.corner[i - 1][c] - polygon.corner[0][c];
      b[c] = polygon.corner[i][c] - polygon.corner[0][c];
    }
    const Double3 n = cross(a, b);
    for (std::size_t c = 0; c < 3; ++c) sum[c] += n[c];
  }
  return 0.5 * norm(sum);
}

std::vector<float> area_weights(const PointBlock& points) {
  std::vector<float> weights(points.size(), 0.0f);
  const auto voxel_of = [&](std::size_t i) {
    constexpr float kScale = 1.0f / kAreaVoxelCells;
    return Int3{static_cast<std::int32_t>(std::floor(points.x[i] * kScale)),
                static_cast<std::int32_t>(std::floor(points.y[i] * kScale)),
                static_cast<std::int32_t>(std::floor(points.z[i] * kScale))};
  };
  for (std::size_t begin = 0, end = 0; begin < points.size(); begin = end) {
    const Int3 voxel = voxel_of(begin);
    for (end = begin + 1; end < points.size() && voxel_of(end) == voxel;) ++end;
    const auto known = [&](std::size_t i) {
      return points.nx[i] != 0.0f || points.ny[i] != 0.0f || points.nz[i] != 0.0f;
    };
    std::size_t reference = begin;
    while (reference < end && !known(reference)) ++reference;
    if (reference == end) continue;
    const auto side_of = [&](std::size_t i) {
      return points.nx[i] * points.nx[reference] + points.ny[i] * points.ny[reference] +
                         points.nz[i] * points.nz[reference] <
                     0.0f
                 ? std::size_t{1}
                 : std::size_t{0};
    };
    std::array<Side, 2> side;
    for (std::size_t i = reference; i < end; ++i) {
      if (!known(i)) continue;
      const auto local = [&](float v, std::size_t a) { return double{v} - kAreaVoxelCells * voxel[a]; };
      side[side_of(i)].add({local(points.x[i], 0), local(points.y[i], 1), local(points.z[i], 2)},
                           {double{points.nx[i]}, double{points.ny[i]}, double{points.nz[i]}});
    }
    const std::array<float, 2> weight = {side[0].weight(), side[1].weight()};
    for (std::size_t i = reference; i < end; ++i)
      if (known(i)) weights[i] = weight[side_of(i)];
  }
  return weights;
}

std::vector<Dipole> make_dipoles(const PointBlock& points) {
  const std::vector<float> area = area_weights(points);
  std::vector<Dipole> dipoles;
  dipoles.reserve(points.size());
  const auto quanta = [](std::int32_t origin, float v) {
    return origin * kQuantaPerCell + static_cast<std::int32_t>(v * static_cast<float>(kQuantaPerCell));
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!(area[i] > 0.0f)) continue;
    dipoles.push_back({{quanta(points.origin[0], points.x[i]), quanta(points.origin[1], points.y[i]),
                        quanta(points.origin[2], points.z[i])},
                       {area[i] * points.nx[i], area[i] * points.ny[i], area[i] * points.nz[i]}});
  }
  return dipoles;
}

}  // namespace tessera
