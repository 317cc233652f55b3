/// \file outside.h
/// Which side of a job's patches is outside, from the thinned surfels of the whole job.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// A coarse surfel in the frame of the job.
struct JobSurfel {
  Float3 position{};  ///< cells from the lattice origin
  Float3 area{};      ///< summed normal times area of its patch's side, cells^2
  std::uint32_t patch = 0;
  std::uint32_t surfels = 0;
};

/// Votes for the side that a patch's normals show.
struct SideVotes {
  std::int64_t seen = 0;
  std::int64_t hidden = 0;
};

/// Looks at the surfels from far away in 26 directions. Those that nothing hides vote for the side that faces
/// the viewer, with their area and cosine; looks from above count twice, so that a sheet that is seen from
/// everywhere shows upwards. A surfel counts `scale` times its fine surfels at most, over all directions.
/// \cost 13 sorts of the surfels
std::vector<SideVotes> look_from_outside(std::span<const JobSurfel> surfels, std::size_t patches,
                                         double scale);

}  // namespace tessera
