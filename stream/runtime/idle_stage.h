/// \file idle_stage.h
/// What stands for a stage in a round that is not needed: no tasks, an empty entry in the report.
#pragma once
#include <memory>
#include <string>

#include "stream/runtime/stage.h"

namespace tessera {

std::unique_ptr<Stage> make_idle_stage(std::string name);

}  // namespace tessera
