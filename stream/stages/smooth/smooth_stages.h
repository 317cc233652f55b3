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
#include <memory>

#include "stream/runtime/stage.h"
#include "stream/stages/smooth/smooth_plan.h"

namespace tessera {

std::unique_ptr<Stage> make_range_stage(const JobState& state, const SmoothPlan& plan);
std::unique_ptr<Stage> make_coarse_sums_stage(const JobState& state, const SmoothPlan& plan,
                                              std::size_t round);
std::unique_ptr<Stage> make_coarse_stage(const JobState& state, const SmoothPlan& plan, std::size_t round);
std::unique_ptr<Stage> make_smooth_stage(const JobState& state, const SmoothPlan& plan, std::size_t round);

}  // namespace tessera
