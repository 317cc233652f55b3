/// \file smooth_job.h
/// The job of `smooth`, and the stages of its rounds (smooth_stages.h) for other jobs.
#pragma once
#include <vector>

#include "kernels/smooth/smooth.h"
#include "stream/runtime/job.h"
#include "stream/runtime/option_table.h"
#include "stream/stages/smooth/smooth_plan.h"

namespace tessera {

OptionTable option_table(SmoothOptions& options);

/// The whole job: import, rounds, output. One input. The report's `mesh` has {vertices, faces, largest_move, rms_move,
/// ...}.
JobDescription smooth_job(const SmoothOptions& options);

/// reach, and all stages of these rounds. \param rounds  the most that the plan may have; those it has not are idle
std::vector<StageEntry> smooth_stages(const std::vector<SmoothRound>& rounds, const SmoothPlanner& plan);

}  // namespace tessera
