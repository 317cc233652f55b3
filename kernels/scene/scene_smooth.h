/// \file scene_smooth.h
/// Smooth scenes with a parametrisation, and what other scenes borrow from the terrain.
#pragma once
#include <memory>

#include "kernels/scene/fractal_noise.h"
#include "kernels/scene/scene.h"

namespace tessera::synth {

inline constexpr double kTerrainSize = 1000.0;  ///< edge of the terrain, scene units

/// Relief with that many octaves, or (0) as many as samples of that spacing resolve.
[[nodiscard]] FractalOptions terrain_relief(int octaves, double spacing);
[[nodiscard]] std::uint32_t terrain_colour(const SurfacePoint& p, double amplitude);

[[nodiscard]] std::unique_ptr<Scene> make_sphere();  ///< radius 1, centre at the origin
[[nodiscard]] std::unique_ptr<Scene> make_torus();   ///< radii 1 and 0.4, axis z
[[nodiscard]] std::unique_ptr<Scene> make_terrain(const FractalOptions& relief);

/// First crossing of a ray with a surface z = height(x, y) from above or below: steps in proportion to the
/// height difference, then bisection, so that a hit lies on the surface to 1e-12 of the scene; slopes steeper
/// than 2.5 may be stepped over where they are thinner than a step.
/// \param field  (p, height, normal) -> whether (p.x, p.y) belongs to the field
template <class Field>
bool intersect_heightfield(const Field& field, const Box3& box, const Ray& ray, double limit, double slope,
                           RayHit& hit) {
  // Clip to the box: nothing is outside.
  double t0 = 0.0, t1 = limit;
  const double o[3] = {ray.origin[0], ray.origin[1], ray.origin[2]};
  const double d[3] = {ray.direction[0], ray.direction[1], ray.direction[2]};
  const double lo[3] = {box.lo[0], box.lo[1], box.lo[2]}, hi[3] = {box.hi[0], box.hi[1], box.hi[2]};
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == 0.0) {
      if (o[axis] < lo[axis] || o[axis] > hi[axis]) return false;
      continue;
    }
    const double a = (lo[axis] - o[axis]) / d[axis], b = (hi[axis] - o[axis]) / d[axis];
    t0 = t0 > (a < b ? a : b) ? t0 : (a < b ? a : b);
    t1 = t1 < (a < b ? b : a) ? t1 : (a < b ? b : a);
  }
  if (!(t0 < t1)) return false;
  const double closing = std::fabs(d[2]) + slope * std::sqrt(d[0] * d[0] + d[1] * d[1]);
  const double minimum = 1e-5 * (box.hi[0] - box.lo[0]);
  double before = 0.0, t_before = t0, t = t0;
  bool have_before = false;
  for (int step = 0; step < 4000 && t <= t1; ++step) {
    const Double3 p = ray.origin + ray.direction * t;
    double height = 0.0;
    Double3 normal{};
    if (!field(p, height, normal)) {
      have_before = false;
      t += minimum * 10.0;
      continue;
    }
    const double height_above = p[2] - height;
    if (have_before && (height_above < 0.0) != (before < 0.0)) {
      double a = t_before, b = t;
      for (int k = 0; k < 60; ++k) {
        const double m = 0.5 * (a + b);
        const Double3 q = ray.origin + ray.direction * m;
        if (!field(q, height, normal)) return false;
        ((q[2] - height < 0.0) == (before < 0.0) ? a : b) = m;
      }
      const Double3 q = ray.origin + ray.direction * b;
      if (!field(q, height, normal)) return false;
      hit = {b, {{q[0], q[1], height}, normal}};
      return b > 0.0;
    }
    before = height_above;
    t_before = t;
    have_before = true;
    const double stride = std::fabs(height_above) / closing;
    t += stride > minimum ? stride : minimum;
  }
  return false;
}

}  // namespace tessera::synth
