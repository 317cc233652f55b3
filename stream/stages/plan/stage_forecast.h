/// \file stage_forecast.h
/// What one stage of a reconstruction is expected to need. Each stage tells its own beside its factory, by the functions by
/// which it reserves its memory.
#pragma once
#include <cstdint>
#include <string>

namespace tessera {

struct StageForecast {
  std::string stage = {};
  std::uint64_t tasks = 0;
  std::uint64_t task_bytes = 0;    ///< memory of its largest task
  std::uint64_t finish_bytes = 0;  ///< memory of its end
  std::uint64_t sure_bytes = 0;    ///< of the larger of both, what it takes whatever the estimates
  std::uint64_t disk_bytes = 0;    ///< what it writes into the work directory
  std::uint64_t files = 0;
  double seconds = 0.0;       ///< on all threads of the job, disk included
  double processor_us = 0.0;  ///< microseconds of one core
  double moved_bytes = 0.0;   ///< read and written

  static void fields(auto& self, auto&& field) {
    field("stage", self.stage);
    field("tasks", self.tasks);
    field("task_bytes", self.task_bytes);
    field("finish_bytes", self.finish_bytes);
    field("sure_bytes", self.sure_bytes);
    field("disk_bytes", self.disk_bytes);
    field("files", self.files);
    field("seconds", self.seconds);
  }

  bool is_idle() const { return tasks == 0 && files == 0; }
  std::uint64_t memory_bytes() const { return task_bytes > finish_bytes ? task_bytes : finish_bytes; }
};

/// Memory that hangs on no estimate.
inline StageForecast all_sure(StageForecast forecast) {
  forecast.sure_bytes = forecast.memory_bytes();
  return forecast;
}

/// Of a stage that has nothing to do: what its end reserves, at most.
inline StageForecast idle_forecast() {
  StageForecast forecast;
  forecast.finish_bytes = std::uint64_t{20} << 20;
  return forecast;
}

}  // namespace tessera
