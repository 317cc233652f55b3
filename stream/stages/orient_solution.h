/// \file orient_solution.h
/// The global part of orientation: from the votes of all bricks to one sign per patch, and who decided it.
#pragma once
#include <cstdint>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "kernels/sign_solver.h"
#include "stream/point_overlay.h"
#include "stream/stage.h"

namespace tessera {

/// Bytes that solve_orientation holds at most. \param boundary_votes  as given to it
std::uint64_t orient_solution_bytes(const PointOverlay& overlay, std::uint64_t boundary_votes);

/// Fills decisions.patch. Entry gets: patches, components, points by who decided (`decided`),
/// uncertain_points and _fraction, frustrated_fraction, and where given normals were kept aside, `agreement`
/// with them. \param boundary_votes  between patches of different bricks, numbered over all bricks; any order
/// \param seen_known  sensors or `up` have voted; else the outermost surfels vote
void solve_orientation(const PointOverlay& overlay, std::vector<PatchVote> boundary_votes, bool seen_known,
                       const TaskContext& context, OverlayDecisions& decisions, nlohmann::json& entry);

}  // namespace tessera
