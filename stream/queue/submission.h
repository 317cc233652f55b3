/// \file submission.h
/// A job in a batch queue: its steps are handed over one after the other, and its work directory bears a mark with their
/// numbers as long as the queue has it, so that nobody runs it beside the queue by mistake.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "stream/queue/slurm.h"

namespace tessera {

/// Numbers of the jobs by which a queue has the job of this work directory, living or not; none without a mark.
std::vector<std::string> queued_jobs(const std::filesystem::path& work);

/// Takes the mark of a submission away whose jobs have all ended. \throws UsageError while one of them waits or runs
void forget_ended_submission(const std::filesystem::path& work);

/// "%s" of a new submission: unlike that of any other.
std::string submission_token();

/// Scripts of all steps, in order. \pre job.work need not exist
std::vector<std::string> submission_scripts(const SlurmJob& job, const std::vector<QueueStep>& steps,
                                            const QueueOptions& options);

/// Hands them over; each begins when the one before is done. When one is refused, those before it are taken back.
/// \returns the numbers of the jobs \throws as slurm_submit
std::vector<std::string> submit(const SlurmJob& job, const std::vector<QueueStep>& steps,
                                const QueueOptions& options);

/// Takes the job of this work directory out of the queue; what is committed stays.
/// \returns how many of its jobs still waited or ran \throws UsageError when no queue has it
std::size_t cancel_submission(const std::filesystem::path& work);

}  // namespace tessera
