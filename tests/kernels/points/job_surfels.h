/// \file job_surfels.h
/// Surfels of simple scenes.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "kernels/points/visibility.h"
#include "tests/kernels/points/in_order.h"

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

/// All of them as one part.
inline SurfelParts one_part(const std::vector<JobSurfel>& surfels) {
  SurfelParts parts;
  parts.parts = {{surfels.size(), 0}};
  parts.load = [surfels](std::size_t) { return surfels; };
  return parts;
}

/// Cubes of this edge as parts. \pre one group in all
inline SurfelParts cut(const std::vector<JobSurfel>& surfels, float edge) {
  std::map<std::array<int, 3>, std::vector<JobSurfel>> cubes;
  for (const JobSurfel& s : surfels) {
    std::array<int, 3> at{};
    for (std::size_t a = 0; a < 3; ++a) at[a] = static_cast<int>(s.position[a] / edge);
    cubes[at].push_back(s);
  }
  SurfelParts parts;
  std::vector<std::vector<JobSurfel>> of;
  for (const auto& [at, inside] : cubes) {
    const auto group = static_cast<std::uint32_t>(of.size());
    of.push_back(inside);
    for (JobSurfel& s : of.back()) s.patch = group;
    parts.parts.push_back({inside.size(), group});
  }
  parts.load = [of](std::size_t p) { return of[p]; };
  return parts;
}

/// Votes of surfels that are all in memory.
inline VisibilityVotes vote_by_visibility(const std::vector<JobSurfel>& surfels, double scale) {
  SightRun run;
  run.for_each = in_order;
  return vote_by_visibility(one_part(surfels), {0, 0, 1}, scale, std::nullopt, run);
}

inline std::vector<PatchVote> vote_by_sensors(const std::vector<JobSurfel>& surfels,
                                              const std::vector<Float3>& sensors, double scale) {
  SightRun run;
  run.for_each = in_order;
  std::vector<PatchVote> votes;
  vote_by_sensors(one_part(surfels), sensors, scale, run,
                  [&](std::size_t, std::vector<PatchVote> sides) { votes = std::move(sides); });
  return votes;
}

}  // namespace tessera
