/// \file unpack_stage.h
/// Pass "unpack": inputs that are dear to read, packed ones, are read once, the other passes read what it leaves. Tasks
/// are those of the inputs; one without packed points has nothing to do.
#pragma once
#include <memory>

#include "stream/points/point_inputs.h"
#include "stream/runtime/stage.h"

namespace tessera {

std::unique_ptr<Stage> make_unpack_stage(const JobState& job, std::shared_ptr<const PointInputs> inputs);
/// Over the job's inputs.
std::unique_ptr<Stage> make_unpack_stage(const JobState& job);

}  // namespace tessera
