/// \file remesh_job.h
/// The job of `tessera remesh`: import, sizing, passes, proof, output.
#pragma once
#include "stream/runtime/job.h"
#include "stream/stages/remesh/remesh_options.h"

namespace tessera {

/// Stages of the job with these options. JobState::inputs is the mesh.
JobDescription remesh_job(const RemeshJobOptions& options);

}  // namespace tessera
