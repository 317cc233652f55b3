/// \file reconstruct_job.h
/// The main job: a scan becomes a mesh.
#pragma once
#include <vector>

#include "stream/points/reconstruct_options.h"
#include "stream/runtime/job.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Its stages, in order.
std::vector<StageEntry> reconstruct_stages(const ReconstructOptions& options = {});

/// The stages with what the report says of the whole: `points` read and `mesh` {vertices, faces, ...}.
/// \param options  which stages there are depends on them
JobDescription reconstruct_job(const ReconstructOptions& options = {});
/// The same job up to its plan.json; reconstruct_job() goes on from there.
JobDescription plan_job();

}  // namespace tessera
