/// \file decimate_job.h
/// The job of `tessera decimate`: import, passes, proof, output.
#pragma once

#include "stream/files/json.h"
#include "stream/runtime/job.h"
#include "stream/stages/decimate/simplify_stage.h"

namespace tessera {

/// What the last certificate of such a job says, from the report's "stages"; with the number of rounds that were
/// repeated, if any.
Json certificate_of(const Json& report);

/// What colours kept in the passes of such a job: the largest tolerance that was held and how many vertices only it keeps; null
/// where there was none.
Json kept_colours_of(const Json& report);

/// Smoothing if it is asked for, passes, proof, more rounds of both where it fails, output.
/// \param made_by  for the comment in the output
std::vector<StageEntry> simplify_stages(const SimplifyOptions& options, SimplifyStores stores,
                                        const std::string& made_by);

/// All passes over an imported mesh, against that mesh.
SimplifyStores imported_stores(const std::string& folder);

/// Stages of the job with these options. JobState::inputs are the mesh and, unless the reference is the mesh
/// itself, the reference.
JobDescription decimate_job(const SimplifyOptions& options);

}  // namespace tessera
