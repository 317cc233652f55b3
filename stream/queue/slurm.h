/// \file slurm.h
/// Slurm as it stands: scripts that its `sbatch` takes, and its commands. No daemon, no port, no password of ours.
#pragma once
#include <cstdint>
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
  /// The job's own command line, which ends it: report, page, work directory.
  std::vector<std::string> command;
  int threads = 1;
};

/// The script of a step.
/// \param number  from 1 \param last  the job's own command follows its lines
std::string slurm_script(const SlurmJob& job, const QueueStep& step, const QueueOptions& options, int number,
                         bool last);

/// Nodes of a kind that a partition has.
struct SlurmNode {
  std::uint64_t memory_bytes = 0;
  int cpus = 0;
  bool operator==(const SlurmNode&) const = default;
};
struct SlurmPartition {
  std::string name;
  std::vector<SlurmNode> nodes;  ///< those that are up, each kind once, the least memory first
};

/// What `sinfo` tells of the partition that a job without --partition, or with this one, would go to. Empty where it
/// tells nothing: Slurm is not installed here or does not answer, or there is no such partition.
SlurmPartition slurm_partition(const std::string& partition);

/// Memory cap of an element of `threads` that any of the nodes can hold beside others: the share of a node that belongs to
/// its CPUs, but `minimum` at least, less what a job needs beside its cap, and 0.8 of the smallest node at most.
/// \pre nodes is not empty
std::uint64_t element_memory(const SlurmPartition& partition, int threads, std::uint64_t minimum);

/// \throws UsageError when no node has so many CPUs and so much memory for an element, naming the options
void require_fits(const SlurmPartition& partition, int threads, std::uint64_t memory_bytes);

/// What to do about words of `sbatch`, one clause that names an option; empty for unknown ones.
std::string slurm_advice(const std::string& words);

/// \param after  number of the job that must be done first; empty = none \returns the number of the new job
/// \throws UsageError when Slurm is not installed here, ResourceError with its own words and slurm_advice() when it refuses
std::string slurm_submit(const std::filesystem::path& script, const std::string& after);

/// Takes jobs out of the queue and ends those that run; unknown ones count as ended. \throws as slurm_submit
void slurm_cancel(const std::vector<std::string>& jobs);

/// Those of the jobs that wait or run. \throws as slurm_submit
std::vector<std::string> slurm_active(const std::vector<std::string>& jobs);

}  // namespace tessera
