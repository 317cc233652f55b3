#include "stream/stages/reconstruct/forecast.h"

#include <algorithm>
#include <filesystem>
#include <span>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json_fields.h"
#include "stream/runtime/disk_space.h"
#include "stream/runtime/memory_budget.h"
#include "stream/stages/plan/forecast_rates.h"

namespace tessera {

Forecast Forecast::of_work(const std::filesystem::path& work) {
  try {
    return fields_from_json<Forecast>(parse_json(read_text(work / kFile)));
  } catch (const JsonError& e) {
    throw InputError((work / kFile).string() + ": damaged (" + e.what() + "); run again with --force");
  }
}

void require_points_disk(const PointInputs& inputs, const JobState& job) {
  // Noise and withheld points are left out, and where h is coarse what is too much in a brick.
  constexpr double kSurelyWanted = 0.75;
  if (reconstruct_options(job).resolution > 0.0) return;
  const auto points = kSurelyWanted * static_cast<double>(inputs.expected_points());
  const std::uint64_t bytes = bytes_of(points, rates::kRunBytes + rates::kStoreBytes);
  const DiskNeed need = {job.work, bytes - std::min(bytes, bytes_below(job.work)),
                         "sorting the points in the work directory " + job.work.string()};
  require_disk(std::span(&need, 1), kLargerDisk);
}

void require_resources(const Forecast& forecast, const JobState& job, std::uint64_t base,
                       const std::function<Forecast(std::uint64_t cap)>& under) {
  // A process of its own holds the base once more.
  const std::uint64_t own_base = job.run.processes ? base : 0;
  const auto larger = [](const StageForecast& a, const StageForecast& b) {
    return a.sure_bytes < b.sure_bytes;
  };
  const auto first = std::max_element(forecast.stages.begin(), forecast.stages.end(), larger);
  const MemoryBudget budget(job.run.memory_bytes, base);
  if (first != forecast.stages.end() && first->sure_bytes + own_base > budget.capacity()) {
    const std::uint64_t cap =
        MemoryBudget::smallest_fitting_cap(job.run.memory_bytes, base, [&](std::uint64_t tried) {
          std::uint64_t need = own_base;
          for (const StageForecast& f : under(tried).stages)
            need = std::max({need, f.memory_bytes() + own_base, f.sure_bytes + own_base});
          return need;
        });
    budget.require(first->sure_bytes + own_base, "stage " + first->stage, cap);
  }
  const std::uint64_t there = bytes_below(job.work);  // the probe, what was unpacked
  const DiskNeed need = {job.work, forecast.peak_disk_bytes - std::min(there, forecast.peak_disk_bytes),
                         "the work directory " + job.work.string()};
  require_disk(std::span(&need, 1), kLargerDisk);
}

}  // namespace tessera
