/// \file forecast_stage.h
/// Stage "forecast", right after the survey: composes the forecast of the job and refuses what cap or disk cannot carry.
#pragma once
#include <memory>

#include "stream/runtime/stage.h"

namespace tessera {

/// Leaves Forecast::kFile; its entry in the report has peak_disk_bytes and output_bytes.
/// \throws ResourceError from finish as require_resources
std::unique_ptr<Stage> make_forecast_stage(const JobState& state);

}  // namespace tessera
