/// \file job.h
/// Runs the stages of a job, in order, tasks in parallel within the memory cap, resumable at every moment.
///
/// The work directory holds what is committed (journal.h, resume.h). The same command goes on where an
/// earlier run stopped; completed stages are kept even when cap, threads or tile size differ, a half-done
/// stage only when they do not. The output gets its name last; then report.json is written and the work
/// directory goes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/runtime/progress.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// A file that a job writes beside its output.
struct SidecarOutput {
  std::function<std::filesystem::path(const std::filesystem::path& output)> path;
  std::string option;      ///< what asks for it: "--keep-raw"
  bool is_result = false;  ///< the job is not done without it
  /// What it holds, from the report of a job that is done; nothing, no file. Where empty, a stage writes it.
  std::function<std::string(const Json& report)> text = {};
};

/// The report for people. It draws and measures while the report can still say what that took, and writes when the report
/// is final; refusals have one too.
struct JobPage {
  std::function<std::filesystem::path(const std::filesystem::path& report)> path;
  std::function<std::function<void(const Json& report)>(const JobState&, const Json& report)> make;
  std::function<bool(const std::filesystem::path&)> is_page;  ///< one of these, which may be replaced
};

/// What a job is beside its state.
struct JobDescription {
  std::string command;             ///< "reconstruct": part of the job's identity
  std::vector<StageEntry> stages;  ///< all of them, in order
  /// Stop once so many stages are committed and keep the work directory (`plan`); 0 = run all
  std::size_t only_stages = 0;
  /// Adds what the report says of the whole job, from its `stages`; may be empty
  std::function<void(Json&)> summarise;
  std::vector<SidecarOutput> sidecars = {};  ///< files that stages write beside the output
  JobPage page = {};                         ///< may be empty
  /// By what is known before the first stage, under the cap of the state. A cap below what stages that are still to come
  /// need for sure is refused at once; what they are likely to need decides which cap is named then.
  std::function<std::vector<StageNeed>(const JobState&)> needs = {};
};

/// Runs the job; returns the report (schema 1).
/// \param state  inputs, output and options as the user gave them; work, memory and threads are resolved here
/// \throws UsageError     the work directory or the output is another job's and `force` is off; unknown --until
/// \throws ResourceError  cap or disk cannot suffice; what is committed stays, the same command goes on
/// \throws StoppedError   a signal or --until
/// \throws what stages throw
Json run_job(JobState state, const JobDescription& job, const ProgressSink& sink);

/// Makes the work directory of a job that others will run, task by task (task_run.h), and refuses what run_job() refuses
/// before its first stage. \param[in,out] state  resolved as run_job() resolves it \param make  false: only refuse
/// \returns false: the output stands already
bool begin_job(JobState& state, const JobDescription& job, bool make = true);

/// For `submit`, which lets a job's own command read its line: the next run_job() hands its job over and throws JobTaken.
using JobTaker = std::function<void(const JobState&, const JobDescription&)>;
void take_jobs(JobTaker taker);
struct JobTaken {};

/// The job of this name with these options, as a work directory names them. \throws InputError if there is none
using JobFinder = std::function<JobDescription(const std::string& command, const std::string& settings)>;

}  // namespace tessera
