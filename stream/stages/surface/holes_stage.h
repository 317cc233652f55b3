/// \file holes_stage.h
/// Pass "holes": fills the loops that the pass before has found, one task per batch of loops.
#pragma once
#include <memory>

#include "stream/runtime/stage.h"

namespace tessera {

std::unique_ptr<Stage> make_holes_stage(const JobState& state);
StageForecast forecast_holes(const PlannedScan& scan);

}  // namespace tessera
