/// \file visibility.h
/// What the surfels of a whole job see along straight lines: each other, or nothing. The scanner stood in free
/// space, so the front of a surface is the side with the longer sight; and of two surfels with nothing between
/// them both show their fronts, or both their backs. Sources: Takayama, Jacobson, Kavan, Sorkine-Hornung, "A
/// Simple Method for Correcting Facet Orientations in Polygon Meshes Based on Ray Casting", 2014 (rays from both
/// sides, the freer side is the front).
#pragma once
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "kernels/points/sign_solver.h"
#include "kernels/points/surfel_scene.h"

namespace tessera {

/// How a scene was scanned. What surfels see tells the three apart; scenes seen from above: top_surface.h.
enum class SceneKind : std::uint8_t {
  kObject,  ///< from around it: its front is the side that sees more of the open
  kLand,    ///< from amid it: how far a side sees, and how much of the open
  kRoom,  ///< from inside it: some cannot be seen from outside the job, or what shuts the view out stands around the
          ///< scanner (far more points near than far, or fronts that see each other): how far a side sees
};

/// Votes of looks from surfels to both sides, in directions that hang on their place alone.
struct VisibilityVotes {
  std::vector<PatchVote> pairs;  ///< between groups that see each other, merged; of objects and land
  std::vector<PatchVote> sides;  ///< of groups, ascending, for the side that they show; `b` does not matter
  double enclosed = 0.0;         ///< share of the surfels that cannot be seen from outside the job
  double shells = 0.0;           ///< share of them with one side that sees next to nothing of the open
  double density_spread = 0.0;   ///< 1: points lie evenly; far more where a scanner stood amid its scene
  double facing = 0.0;  ///< share of the looks from the freer side of every surfel that end on something
  double sight = 0.0;   ///< mean length of the looks that end on something, cells
  SceneKind scene = SceneKind::kLand;
};

/// What does not change the votes. \param bytes  for disks of parts, and as many again while they are made
struct SightRun {
  std::uint64_t bytes = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t lookers = 1u << 12;  ///< that look at once: 64 rays each
  ForEach for_each;                  ///< every look goes through it
};

/// Bytes that the votes take at most. \param surfels, bricks  of all parts
std::uint64_t sight_bytes(const SightRun& run, std::uint64_t surfels, std::uint64_t largest_part,
                          std::uint64_t bricks);

/// \param up  unit
/// \param scale  weight of one fine surfel's votes while all its looks agree
/// \param known  what the user says of the scene
/// \cost some millions of rays, whatever the job's size and whatever it shows
[[nodiscard]] VisibilityVotes vote_by_visibility(const SurfelParts& parts, const Float3& up, double scale,
                                                 std::optional<SceneKind> known, const SightRun& run);

/// What the surfels of one group see: the two sides against each other.
struct GroupView {
  std::uint32_t group = 0;
  double lean = 0.0;  ///< 1: the side that it shows sees all, -1: the other
};

/// Looks of some groups of a room alone, so that every one of them has its share.
/// \param asked  whether a group is one of them \param sight  VisibilityVotes::sight of all groups
/// \returns ascending; groups of which no surfel can look are left out
/// \pre  no group has surfels in two parts
/// \cost as vote_by_visibility, or 128 looks a group where that is more; what is held does not grow with them
[[nodiscard]] std::vector<GroupView> look_from_groups(const SurfelParts& parts, const Float3& up,
                                                      const std::function<bool(std::uint32_t)>& asked,
                                                      double sight, const SightRun& run);

/// Votes of sensors that nothing hides, for points that do not say which one saw them: the nearest of these
/// says most, and less the more it looks along the surface.
/// \param sensors  cells from the lattice origin, anywhere
/// \param take  gets those of every part, ascending: as VisibilityVotes::sides
/// \cost as vote_by_visibility
void vote_by_sensors(const SurfelParts& parts, std::span<const Float3> sensors, double scale,
                     const SightRun& run,
                     const std::function<void(std::size_t part, std::vector<PatchVote> sides)>& take);

}  // namespace tessera
