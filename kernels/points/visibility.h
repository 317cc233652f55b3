/// \file visibility.h
/// What the surfels of a whole job see along straight lines: each other, or nothing. The scanner stood in free
/// space, so the front of a surface is the side with the longer sight; and of two surfels with nothing between
/// them both show their fronts, or both their backs. Sources: Takayama, Jacobson, Kavan, Sorkine-Hornung, "A
/// Simple Method for Correcting Facet Orientations in Polygon Meshes Based on Ray Casting", 2014 (rays from both
/// sides, the freer side is the front).
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "kernels/points/sign_solver.h"
#include "kernels/points/surfel_scene.h"

namespace tessera {

/// Runs a body for every index of [0, count), in any order, several at once if it likes.
using ForEach = std::function<void(std::size_t count, const std::function<void(std::size_t)>& body)>;

/// How a scene was scanned. What surfels see tells the three apart; scenes seen from above: top_surface.h.
enum class SceneKind : std::uint8_t {
  kObject,  ///< from around it: its front is the side that sees more of the open
  kLand,    ///< from amid it: how far a side sees, and how much of the open
  kRoom,  ///< from inside it, some cannot be seen from outside the job, or far more points lie near than far
          ///< on what shuts the view out: how far a side sees
};

/// Votes of looks from surfels to both sides, in directions that hang on their place alone.
struct VisibilityVotes {
  std::vector<PatchVote> pairs;  ///< between groups that see each other, merged; of objects and land
  std::vector<PatchVote> sides;  ///< of groups, for the side that they show; `b` is the number of groups
  double enclosed = 0.0;         ///< share of the surfels that cannot be seen from outside the job
  double shells = 0.0;           ///< share of them with one side that sees next to nothing of the open
  double density_spread = 0.0;   ///< 1: points lie evenly; far more where a scanner stood amid its scene
  SceneKind scene = SceneKind::kLand;
};

/// \param surfels  with the signs that they have inside their group, which is their `patch`
/// \param up  unit
/// \param scale  weight of one fine surfel's votes while all its looks agree
/// \param known  what the user says of the scene
/// \param for_each  every look goes through it; the result does not hang on how
/// \cost some millions of rays, whatever the job's size and whatever it shows
VisibilityVotes vote_by_visibility(std::span<const JobSurfel> surfels, std::size_t groups, const Float3& up,
                                   double scale, std::optional<SceneKind> known, const ForEach& for_each);

/// Votes of sensors that nothing hides, for points that do not say which one saw them: the nearest of these
/// says most, and less the more it looks along the surface.
/// \param sensors  cells from the lattice origin, anywhere
/// \returns as VisibilityVotes::sides
/// \cost as vote_by_visibility
std::vector<PatchVote> vote_by_sensors(std::span<const JobSurfel> surfels, std::size_t groups,
                                       std::span<const Float3> sensors, double scale);

}  // namespace tessera
