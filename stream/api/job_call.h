/// \file job_call.h
/// Jobs as calls of a program that links Tessera: typed options in, the report out, failures as exceptions (octree/error.h).
///
///     DecimateJob job{{"mesh.ply"}, "small.ply", {.tolerance = 0.001}};
///     const Json report = job.run([](const JobProgress& p) { return !cancelled; });
///
/// A call does what the command of its name does, with the same bytes and the same work directory: what one began, the other
/// goes on with. Jobs of several threads run side by side, and stop one by one. What is of the process, not of a job: memory, which
/// each counts whole under its cap; the number of threads, of which the smallest asked for counts; and the allocator, which
/// configure_allocator() (runtime/memory_budget.h) sets, first thing in main(), for caps to hold as they do in the program. No signal
/// is caught and nothing is printed. A factorisation in memory that
/// was cancelled ends in the background (runtime/long_call.h).
#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stream/api/check_call.h"
#include "stream/files/job_scope.h"
#include "stream/files/json.h"
#include "stream/runtime/job.h"
#include "stream/runtime/option_table.h"
#include "stream/runtime/options.h"
#include "stream/runtime/progress.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/merge/merge_job.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "stream/stages/remesh/remesh_job.h"
#include "stream/stages/resample/resample_job.h"
#include "stream/stages/smooth/smooth_job.h"
#include "stream/stages/solid/field_job.h"
#include "stream/stages/solid/resurface_job.h"

namespace tessera {

/// Called from a thread of the job, twenty times a second and at the end of every stage; false asks the job to stop, which it does
/// within half a second, resumable. What it throws is thrown by run(), once the job has stopped.
using ProgressCall = std::function<bool(const JobProgress&)>;

/// A job before it runs, for call_job().
struct JobRequest {
  JobState state;  ///< its output, and how it runs, are the caller's to set
  JobDescription job;
  bool writes_mesh = true;
};

/// Runs a job to its end and returns its report.
/// \throws StoppedError when `progress` said so; what run_job() throws
[[nodiscard]] Json call_job(const JobRequest& request, const ProgressCall& progress = {});
/// The same within a scope that has more to tell. \param job  of this call alone
[[nodiscard]] Json call_job(const JobRequest& request, const ProgressCall& progress,
                            const std::shared_ptr<JobContext>& job);

/// The request of each command with these options. \throws UsageError for options that make no sense
[[nodiscard]] JobRequest request_job(const ReconstructOptions& options,
                                     const std::vector<std::string>& inputs);
[[nodiscard]] JobRequest request_job(const SimplifyOptions& options, const std::vector<std::string>& inputs);
[[nodiscard]] JobRequest request_job(const RemeshJobOptions& options, const std::vector<std::string>& inputs);
[[nodiscard]] JobRequest request_job(const SmoothOptions& options, const std::vector<std::string>& inputs);
[[nodiscard]] JobRequest request_job(const ResampleOptions& options, const std::vector<std::string>& inputs);
[[nodiscard]] JobRequest request_job(const ResurfaceOptions& options, const std::vector<std::string>& inputs);
[[nodiscard]] JobRequest request_job(const FieldJobOptions& options, const std::vector<std::string>& inputs);
[[nodiscard]] JobRequest request_job(const MergeOptions& options, const std::vector<std::string>& inputs);
/// By the name of a command and options by their keys, as a job file has them.
[[nodiscard]] JobRequest request_job(const std::string& command, const Json& options,
                                     const std::vector<std::string>& inputs);

template <class Options>
struct JobCall {
  std::vector<std::string> inputs;  ///< files, folders, globs or @lists
  std::filesystem::path output;
  Options options = {};
  RunOptions how = {};

  /// \returns the report (schema 1) \throws what call_job() and request_job() throw
  [[nodiscard]] Json run(const ProgressCall& progress = {}) const {
    JobRequest request = request_job(options, inputs);
    request.state.output = output;
    request.state.run = how;
    return call_job(request, progress);
  }
};

using ReconstructJob = JobCall<ReconstructOptions>;
using DecimateJob = JobCall<SimplifyOptions>;
using RemeshJob = JobCall<RemeshJobOptions>;
using SmoothJob = JobCall<SmoothOptions>;
using ResampleJob = JobCall<ResampleOptions>;
using ResurfaceJob = JobCall<ResurfaceOptions>;
using FieldJob = JobCall<FieldJobOptions>;
using MergeJob = JobCall<MergeOptions>;

}  // namespace tessera
