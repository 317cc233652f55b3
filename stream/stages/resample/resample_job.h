/// \file resample_job.h
/// The job of `tessera resample`: import, search, blends, proof, output.
#pragma once
#include "stream/runtime/job.h"
#include "stream/stages/resample/resample_options.h"

namespace tessera {

JobDescription resample_job(const ResampleOptions& options);

}  // namespace tessera
