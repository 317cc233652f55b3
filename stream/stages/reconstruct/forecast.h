/// \file forecast.h
/// What a reconstruction will need, told from its plan before the work starts: tasks, memory, disk, files, time.
///
/// Memory comes from the functions by which the stages reserve it. For the passes over points and for the surface of an
/// open job the plan knows their arguments: what is told is what will be reserved, or a little more where equal points
/// merge or hot bricks are thinned. What goes by patches, faces or orientation is the same function of estimated
/// counts; closing cells, known to their own pass alone, are left out. Disk of the passes over points is exact or an
/// upper bound; faces and seconds are estimates. What closing takes depends on its holes: 7 to 55 s of processor time
/// per million faces that it adds, which are not told. With a tolerance the output is told as if nothing could be
/// decimated. Stages that have nothing to do are told with nothing but what their end reserves.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/points/plan.h"
#include "stream/points/point_inputs.h"
#include "stream/runtime/stage.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/plan/stage_forecast.h"

namespace tessera {

struct Forecast {
  std::vector<StageForecast> stages;  ///< all that follow the forecast, in the order of the run
  std::uint64_t peak_disk_bytes = 0;  ///< largest sum of what lies in the work directory at one time
  std::uint64_t output_bytes = 0;     ///< of the mesh file, about

  static void fields(auto& self, auto&& field) {
    field("forecast", self.stages);
    field("peak_disk_bytes", self.peak_disk_bytes);
    field("output_bytes", self.output_bytes);
  }
  /// What the forecast stage has left. \throws InputError when it is missing or damaged
  static Forecast of_work(const std::filesystem::path& work);
  static constexpr const char* kFile = "forecast.json";
};

/// Before anything is read, by the headers: of their points three in four at least are taken for wanted.
/// \throws ResourceError when the disk cannot hold these while they are sorted
void require_points_disk(const PointInputs& inputs, const JobState& job);

/// Each stage tells its own part (StageEntry::forecast).
Forecast forecast_job(const Plan& plan, const std::vector<PlanBrick>& bricks, const InputTasks& inputs,
                      const JobState& job);

/// \param base   of the process, resident beside the tasks
/// \param under  the forecast under another cap, buckets cut for it
/// \throws ResourceError when the cap cannot hold what some stage takes for sure, naming the stage and the smallest cap
///         under which all stages fit, estimates included; when the disk cannot hold the peak
void require_resources(const Forecast& forecast, const JobState& job, std::uint64_t base,
                       const std::function<Forecast(std::uint64_t cap)>& under);

}  // namespace tessera
