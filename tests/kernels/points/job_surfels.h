/// \file job_surfels.h
/// Surfels of simple scenes.
#pragma once
#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/points/surfel_scene.h"

namespace tessera {

inline JobSurfel surfel(const Float3& at, const Float3& normal, std::uint32_t group, float points = 10.0f) {
  JobSurfel s;
  s.position = at;
  for (std::size_t a = 0; a < 3; ++a) s.area[a] = 64.0f * normal[a];
  s.patch = group, s.surfels = 16, s.points = points;
  return s;
}

/// A ball whose normals show outwards. \param dense  times as many points on its lowest part as elsewhere
inline std::vector<JobSurfel> ball(float dense = 1.0f) {
  std::vector<JobSurfel> surfels;
  constexpr int kCount = 4000;
  for (int i = 0; i < kCount; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / kCount, r = std::sqrt(1.0 - z * z), a = 2.399963229728653 * i;
    const Float3 n = {static_cast<float>(r * std::cos(a)), static_cast<float>(r * std::sin(a)),
                      static_cast<float>(z)};
    surfels.push_back(surfel({200.0f + 140.0f * n[0], 200.0f + 140.0f * n[1], 200.0f + 140.0f * n[2]}, n, 0,
                             z < -0.9 ? 10.0f * dense : 10.0f));
  }
  return surfels;
}

}  // namespace tessera
