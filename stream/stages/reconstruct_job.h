/// \file reconstruct_job.h
/// The main job: a scan becomes a mesh.
#pragma once
#include <vector>

#include "stream/job.h"
#include "stream/stage.h"

namespace tessera {

/// Its stages, in order.
std::vector<StageEntry> reconstruct_stages(double tolerance = 0.0);

/// The stages with what the report says of the whole: `points` read and `mesh` {vertices, faces, ...}.
/// \param tolerance  ReconstructOptions::tolerance: above 0 the mesh is decimated before it is written
JobDescription reconstruct_job(double tolerance = 0.0);
/// The same job up to its plan.json; reconstruct_job() goes on from there.
JobDescription plan_job();

}  // namespace tessera
