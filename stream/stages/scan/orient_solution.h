/// \file orient_solution.h
/// The global part of orientation: from the votes of all bricks to one sign per patch, and who decided it.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "kernels/points/sign_solver.h"
#include "octree/lattice.h"
#include "stream/points/point_overlay.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Bytes that solve_orientation holds at most. \param patches, coarse  patches and coarse surfels of all bricks
/// \param votes  between patches, of one brick or of two
std::uint64_t orient_solution_bytes(std::uint64_t patches, std::uint64_t votes, std::uint64_t coarse);

/// What a report calls scenes of which level surfaces show up.
inline constexpr const char* kAirborne = "airborne";
inline constexpr const char* kSeenFromAbove = "from above";
/// And those where the normals that most points came with decide.
inline constexpr const char* kGivenSides = "given normals";

/// Who says which side of a patch is outside; if neither, what surfels see of each other, and `up` in PatchStats.
struct Viewers {
  bool own = false;             ///< points know from where they were seen, which has voted in PatchStats
  std::string scene;            ///< what the report calls it then; else what the user says of it: --from
  std::vector<Float3> sensors;  ///< of points that do not know their own; cells from the lattice origin
  Float3 up = {0, 0, 1};        ///< unit; where the sky is
  bool given = false;           ///< where most given normals of a group agree on its side, they decide it
};

/// Fills decisions.patch. Entry gets: patches, components, points by who decided (`decided`), uncertain_points and
/// _fraction, frustrated_fraction; scene, where nobody was known to see with what told it (covered_, roofed_, level_ and
/// enclosed_fraction: top_surface.h, visibility.h); and where given normals were kept aside, `agreement` with them
/// (`near_axis`: with those within 60 degrees of the plane's axis).
/// \param boundary_votes  between patches of different bricks, numbered over all bricks; any order
void solve_orientation(const PointOverlay& overlay, std::vector<PatchVote> boundary_votes,
                       const Viewers& viewers, const TaskContext& context, OverlayDecisions& decisions,
                       nlohmann::json& entry);

}  // namespace tessera
