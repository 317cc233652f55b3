/// \file uncross_holes_stage.h
/// Pass "uncross-holes": fillings of holes are made one by one, each held against the mesh; of those that cross one another, or
/// the border that another one moved, the later one goes. What comes first is told by the numbers of vertices alone.
#pragma once
#include <memory>
#include <vector>

#include "stream/files/json.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// The passes that find holes, fill them, and take back what crosses.
std::vector<StageEntry> hole_stages();

std::unique_ptr<Stage> make_uncross_holes_stage(const JobState& state);
StageForecast forecast_uncross_holes(const PlannedScan& scan);

/// Of a report: what the pass "holes" told, less the fillings that went. Null without holes.
Json holes_of(const Json& report);

}  // namespace tessera
