/// \file smooth_stages.h
/// Smoothing out of core: every round of smooth.h is one pass over a store, tile by tile with a halo of whole
/// rings.
///
///   reach     longest edge of every patch: how far rings can reach
///   sums-K    of rounds with a coarse level: what every patch adds to its system
///   coarse-K  of these rounds: the system, solved in core
///   smooth-K  round K: store K - 1 -> store K; store 0 is the mesh as it is given. A plate's cycle leaves in bend-K
///             how its vertices bend
///   untangle  untangle_stages.h
///
/// They stand in the job of `smooth` and, between the mesh of full resolution and its decimation, in others
/// (smooth_before.h).
#pragma once
#include <cstdint>
#include <memory>

#include "stream/runtime/stage.h"
#include "stream/stages/smooth/smooth_plan.h"

namespace tessera {

std::unique_ptr<Stage> make_range_stage(const JobState& state, const SmoothPlan& plan);
std::unique_ptr<Stage> make_coarse_sums_stage(const JobState& state, const SmoothPlan& plan,
                                              std::size_t round);
std::unique_ptr<Stage> make_coarse_stage(const JobState& state, const SmoothPlan& plan, std::size_t round);
std::unique_ptr<Stage> make_smooth_stage(const JobState& state, const SmoothPlan& plan, std::size_t round);

/// What a tile of "sums-K" takes; \param patch_vertices  of the largest patch
std::uint64_t coarse_sums_bytes(const SmoothRound& rule, std::uint64_t vertices, std::uint64_t faces,
                                std::uint64_t patch_vertices);
/// What "coarse-K" takes without factors, which lie on disk where memory does not do. \param order  of the filter
/// \param loads  of all patches   \param patch_bytes  of the sums of the largest
std::uint64_t coarse_stage_bytes(int order, std::uint64_t unknowns, std::uint64_t entries,
                                 std::uint64_t loads, std::uint64_t patch_bytes);

}  // namespace tessera
