/// \file serial_stage.h
/// Stages without tasks: all that they do is their end.
#pragma once
#include <memory>
#include <string>

#include "stream/runtime/stage.h"

namespace tessera {

class SerialStage : public Stage {
 public:
  std::size_t task_count() const final { return 0; }
  std::uint64_t task_bytes(std::size_t) const final { return 0; }
  Json run(std::size_t, TaskContext&) const final;
};

/// What stands for a stage in a round that is not needed: an empty entry in the report.
std::unique_ptr<Stage> make_idle_stage(std::string name);

}  // namespace tessera
