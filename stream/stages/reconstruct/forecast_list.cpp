#include "stream/stages/reconstruct/forecast_list.h"

#include <algorithm>
#include <utility>

#include "stream/stages/reconstruct/forecast_rates.h"
#include "stream/stages/reconstruct/reconstruct_job.h"

namespace tessera {

void ForecastList::add(std::string stage, std::uint64_t tasks, const ForecastMemory& memory,
                       std::uint64_t disk, std::uint64_t files, double processor_us, double moved_bytes) {
  const double width = std::clamp(static_cast<double>(tasks), 1.0, std::max(1.0, 1.0 * threads_));
  stages_.push_back({std::move(stage), tasks, memory.task, memory.finish, memory.sure, disk, files,
                     processor_us * 1e-6 / width + moved_bytes / rates::kDiskBytesPerSecond});
}

std::vector<StageForecast> ForecastList::in_order_of_the_run(const ReconstructOptions& options) const {
  std::vector<StageForecast> forecasts;
  bool follows = false;
  for (const StageEntry& entry : reconstruct_stages(options)) {
    if (follows) {
      const auto at = std::find_if(stages_.begin(), stages_.end(),
                                   [&](const StageForecast& f) { return f.stage == entry.name; });
      forecasts.push_back(at != stages_.end() ? *at : StageForecast{entry.name, 0, 0, rates::kIdleBytes, 0});
    }
    follows |= entry.name == "forecast";
  }
  return forecasts;
}

}  // namespace tessera
