/// \file thin_stage.h
/// Pass "thin" (--thin): of the points of a cube the one nearest to its middle stays; of several as near, the one whose
/// coordinates and attributes come first, so that neither order nor number of the inputs matters. One bucket a task.
#pragma once
#include <memory>

#include "stream/points/point_inputs.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// \param inputs  as they were when they were unpacked
std::unique_ptr<Stage> make_thin_stage(const JobState& job, std::shared_ptr<const PointInputs> inputs);
/// Over the job's inputs.
std::unique_ptr<Stage> make_thin_stage(const JobState& job);

}  // namespace tessera
