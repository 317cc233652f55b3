/// \file bake_job.h
/// The job of `tessera bake`: import, points, charts, textures, output.
#pragma once
#include "stream/runtime/job.h"
#include "stream/stages/bake/bake_options.h"

namespace tessera {

/// Stages of the job with these options. JobState::inputs is the mesh, then scans or one finer mesh.
JobDescription bake_job(const BakeOptions& options);

}  // namespace tessera
