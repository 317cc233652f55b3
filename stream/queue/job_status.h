/// \file job_status.h
/// How far a job is, told by its journal and the notes beside it alone: wherever its work directory can be read, with or
/// without a batch queue. No stage is made and no file of its data is looked at.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "stream/runtime/job.h"

namespace tessera {

struct StageStatus {
  std::string name;
  bool complete = false;
  std::optional<std::uint64_t> tasks;  ///< known once the stage has begun
  std::uint64_t done = 0;
  std::uint64_t running = 0;
  std::uint64_t lost = 0;    ///< begun by a process that has been silent for kSilentSeconds
  std::uint64_t failed = 0;  ///< and not done since
  std::uint64_t bytes_read = 0;
  std::uint64_t bytes_written = 0;
  double task_seconds = 0.0;      ///< of all tasks done, one after the other
  double forecast_seconds = 0.0;  ///< by the plan; 0 = none told
};

struct JobStatus {
  static constexpr double kSilentSeconds = 60.0;

  std::string command;
  std::filesystem::path output;
  std::vector<StageStatus> stages;
  std::vector<std::string> failures;  ///< a sentence each, of tasks that failed and are not done since
  std::vector<std::string> queued;    ///< numbers of the jobs of the batch queue, while it has this one
  /// Seconds until the job is done, of the stage at work alone where no plan tells more; none while nothing runs
  std::optional<double> left_s;
  bool left_is_of_stage = false;
};

/// \throws InputError when it is no work directory
JobStatus job_status(const std::filesystem::path& work, const JobFinder& find_job);

}  // namespace tessera
