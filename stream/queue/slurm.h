/// \file slurm.h
/// Slurm as it stands: scripts that its `sbatch` takes, and its commands. No daemon, no port, no password of ours.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "stream/queue/queue_steps.h"

namespace tessera {

/// What all scripts of a job share.
struct SlurmJob {
  std::filesystem::path program;  ///< tessera, on every node
  std::filesystem::path work;     ///< work directory, on a file system of all nodes
  std::filesystem::path folder;   ///< where the job's own command was given
  std::string token;              ///< of the work directory's mark
  std::vector<std::string>
      command;  ///< the job's own command line, which ends it: report, page, work directory
  int threads = 1;
};

/// The script of a step.
/// \param number  from 1 \param last  the job's own command follows its lines
std::string slurm_script(const SlurmJob& job, const QueueStep& step, const QueueOptions& options, int number,
                         bool last);

/// \param after  number of the job that must be done first; empty = none \returns the number of the new job
/// \throws UsageError when Slurm is not installed here, ResourceError with its own words when it refuses
std::string slurm_submit(const std::filesystem::path& script, const std::string& after);

/// Takes jobs out of the queue and ends those that run; unknown ones count as ended. \throws as slurm_submit
void slurm_cancel(const std::vector<std::string>& jobs);

/// Those of the jobs that wait or run. \throws as slurm_submit
std::vector<std::string> slurm_active(const std::vector<std::string>& jobs);

}  // namespace tessera
