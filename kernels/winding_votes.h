/// \file winding_votes.h
/// Which side of groups of patches that hang together loosely or not at all is outside: the side that gives
/// the whole job one winding number in front of its surfaces and one behind. Sources: ALGORITHMS section 2,
/// step 5; Takayama, Jacobson, Kavan, Sorkine-Hornung, "A Simple Method for Correcting Facet Orientations in
/// Polygon Meshes Based on Ray Casting", 2014 (patches against their surroundings).
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/outside.h"
#include "kernels/sign_solver.h"

namespace tessera {

/// Votes of the winding number for the signs that groups have. The largest group keeps its sign; what its
/// surfels see on average is what all others should see too: 1/2 on closed surfaces that show outwards, 0 on
/// open ones. Groups follow by falling size, each in the field of those before it; behind the first few each
/// alone in theirs. \param surfels  with the signs that they have inside their group \param group    per
/// surfel \param ties     votes between groups, merged: they count when a group takes its sign, and are not
/// in the result \param scale    weight of one fine surfel of a closed group in the empty space of another
/// \cost two dozen fields at all surfels
std::vector<SideVotes> vote_by_winding(std::span<const JobSurfel> surfels,
                                       std::span<const std::uint32_t> group, std::size_t groups,
                                       std::span<const PatchVote> ties, double scale);

}  // namespace tessera
