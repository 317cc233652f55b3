/// \file tiles_job.h
/// The job of `tessera tiles`: import, level by level decimation, proof and tiles, then the tileset.
#pragma once
#include <filesystem>

#include "stream/runtime/job.h"
#include "stream/stages/tiles/tiles_options.h"

namespace tessera {

/// Stages of the job with these options. JobState::inputs is the mesh, JobState::output the tileset.json of the folder.
JobDescription tiles_job(const TilesOptions& options);

}  // namespace tessera
