/// \file orient_viewers.h
/// Who saw a scan, and what patches bring along of their sides: votes of sensors, of `up`, of given normals.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "kernels/points/orientation.h"
#include "kernels/points/patch_groups.h"
#include "stream/points/plan.h"
#include "stream/stages/scan/normals_mode.h"

namespace tessera {

/// What a report calls scenes of which level surfaces show up.
inline constexpr const char* kAirborne = "airborne";
inline constexpr const char* kSeenFromAbove = "from above";
/// And those where the normals that most points came with decide.
inline constexpr const char* kGivenSides = "given normals";

/// Patches join to groups while so many whole links speak for it, and three quarters of all that speak.
inline constexpr ContractionLimits kGroupLimits = {24.0 * kVoteScale, 0.8};
/// Share of a group's votes, or of its given normals, that is clear.
inline constexpr double kClearMajority = 0.75;
/// Weight of what the highest surface tells, of one surfel, against the votes of its links.
inline constexpr double kSkyScale = 0.25 * kVoteScale;
/// `up` is taken to that part of its word: ceilings and the undersides of trees show downwards.
inline constexpr std::int64_t kAboveShare = 8;

/// Who says which side of a patch is outside; if neither, what surfels see of each other, and `up` in PatchStats.
struct Viewers {
  bool own = false;             ///< points know from where they were seen, which has voted in PatchStats
  std::string scene;            ///< what the report calls it then; else what the user says of it: --from
  std::vector<Float3> sensors;  ///< of points that do not know their own; cells from the lattice origin
  Float3 up = {0, 0, 1};        ///< unit; where the sky is
  bool given = false;           ///< where most given normals of a group agree on its side, they decide it

  /// Nobody is known to have seen anything: the scene has to tell.
  bool unknown() const { return !own && sensors.empty(); }
};

/// \param from  the option
Viewers viewers_of(const NormalsMode& mode, const Plan& plan, const std::string& from);

/// Votes of sensors or `up`. \returns of patches, `b` is their number
std::vector<PatchVote> votes_of(std::span<const PatchStats> stats);

/// Votes of normals that came with the points, for groups of patches of which most agree on a side: they outweigh what is
/// told of the scene. \returns of groups, `b` is their number
std::vector<PatchVote> votes_of_given(std::span<const PatchStats> stats, const PatchGroups& groups);

}  // namespace tessera
