/// \file forecast.h
/// What a job will need, told from its plan before the work starts: tasks, memory, disk, files, time.
/// Memory and disk of the passes over points are exact or upper bounds; faces and seconds are estimates. What closing
/// takes depends on holes that only its own pass finds: 7 to 55 s of processor time per million faces that it adds,
/// which are not told. With a tolerance the output is told as if nothing could be decimated.
#pragma once
#include <cstdint>
#include <vector>

#include "stream/points/plan.h"
#include "stream/runtime/stage.h"

namespace tessera {

struct Forecast {
  std::vector<StageForecast> stages;  ///< from distribute on
  std::uint64_t faces = 0;            ///< of the mesh, about
  std::uint64_t peak_disk_bytes = 0;  ///< largest sum of what lies in the work directory at one time
  std::uint64_t output_bytes = 0;     ///< of the mesh file, about
  /// Memory that some later task cannot do without, whatever the tiles: the densest brick and its
  /// surroundings.
  std::uint64_t least_task_bytes = 0;
};

/// \param input_tasks  tasks that read the input once
Forecast forecast_job(const Plan& plan, const std::vector<PlanBrick>& bricks, const JobState& job,
                      std::size_t input_tasks);

/// \throws ResourceError when the cap cannot hold the least task or the disk the peak, naming the smallest
/// that would
void require_resources(const Forecast& forecast, const JobState& job);

}  // namespace tessera
