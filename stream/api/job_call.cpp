#include "stream/api/job_call.h"

#include <atomic>
#include <csignal>
#include <exception>
#include <memory>
#include <utility>

#include "octree/error.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/points/point_source.h"
#include "stream/stages/merge/merge_stages.h"

namespace tessera {
namespace {

/// Hands progress on, and turns a no into the wish that this job stops.
class ProgressRelay {
 public:
  ProgressRelay(const ProgressCall& call, JobContext& job) : call_(call), job_(job) {}

  void note(const JobProgress& progress) {
    if (asked_) return;
    try {
      if (call_(progress)) return;
    } catch (...) {
      thrown_ = std::current_exception();
    }
    asked_ = true;
    job_.stop = SIGINT;
  }
  void rethrow() const {
    if (thrown_) std::rethrow_exception(thrown_);
  }

 private:
  const ProgressCall& call_;
  JobContext& job_;
  std::atomic<bool> asked_{false};
  std::exception_ptr thrown_;
};

std::vector<std::filesystem::path> files_of(const std::vector<std::string>& inputs) {
  if (inputs.empty()) throw UsageError("no input given: name files, folders, globs or @list");
  return expand_inputs(inputs);
}

std::vector<std::filesystem::path> one_file_of(const std::vector<std::string>& inputs) {
  std::vector<std::filesystem::path> files = files_of(inputs);
  if (files.size() > 1)
    throw UsageError("meshes are worked on one at a time, but there are " + std::to_string(files.size()) +
                     " inputs: give one");
  return files;
}

template <class Options>
JobRequest request(Options options, std::vector<std::filesystem::path> inputs,
                   JobDescription (*describe)(const Options&)) {
  options.validate();
  JobRequest made;
  made.state.inputs = std::move(inputs);
  made.state.settings = to_settings(options);
  made.job = describe(options);
  return made;
}

template <class Options>
JobRequest request_by_keys(const Json& keys, const std::vector<std::string>& inputs) {
  Options options;
  option_table(options).from_json(keys);
  return request_job(options, inputs);
}

struct NamedRequest {
  const char* name;
  JobRequest (*make)(const Json& keys, const std::vector<std::string>& inputs);
};
constexpr NamedRequest kRequests[] = {
    // one line per job, alphabetical
    {"decimate", request_by_keys<SimplifyOptions>},   {"field", request_by_keys<FieldJobOptions>},
    {"merge", request_by_keys<MergeOptions>},         {"reconstruct", request_by_keys<ReconstructOptions>},
    {"remesh", request_by_keys<RemeshJobOptions>},    {"resample", request_by_keys<ResampleOptions>},
    {"resurface", request_by_keys<ResurfaceOptions>}, {"smooth", request_by_keys<SmoothOptions>},
};

}  // namespace

Json call_job(const JobRequest& request, const ProgressCall& progress) {
  return call_job(request, progress, std::make_shared<JobContext>());
}

Json call_job(const JobRequest& request, const ProgressCall& progress,
              const std::shared_ptr<JobContext>& job) {
  if (request.state.output.empty()) throw UsageError("no output given");
  if (request.writes_mesh) require_mesh_extension(request.state.output);
  const JobScope of_job(job);
  ProgressRelay relay(progress, *job);
  ProgressSink sink;
  if (progress) sink.write = ProgressNotes{[&relay](const JobProgress& at) { relay.note(at); }};
  try {
    return run_job(request.state, request.job, sink);
  } catch (const StoppedError&) {
    relay.rethrow();
    throw;
  }
}

JobRequest request_job(const ReconstructOptions& options, const std::vector<std::string>& inputs) {
  return request<ReconstructOptions>(options, files_of(inputs),
                                     [](const ReconstructOptions& o) { return reconstruct_job(o); });
}

JobRequest request_job(const SimplifyOptions& options, const std::vector<std::string>& inputs) {
  JobRequest made = request<SimplifyOptions>(options, one_file_of(inputs), decimate_job);
  if (options.reference != "surface") made.state.inputs.emplace_back(options.reference);
  return made;
}

JobRequest request_job(const RemeshJobOptions& options, const std::vector<std::string>& inputs) {
  return request<RemeshJobOptions>(options, one_file_of(inputs), remesh_job);
}

JobRequest request_job(const SmoothOptions& options, const std::vector<std::string>& inputs) {
  return request<SmoothOptions>(options, one_file_of(inputs), smooth_job);
}

JobRequest request_job(const ResampleOptions& options, const std::vector<std::string>& inputs) {
  return request<ResampleOptions>(options, one_file_of(inputs), resample_job);
}

JobRequest request_job(const ResurfaceOptions& options, const std::vector<std::string>& inputs) {
  ResurfaceOptions counted = options;
  const auto files = files_of(inputs);
  counted.meshes = files.size();
  return request<ResurfaceOptions>(counted, files, resurface_job);
}

JobRequest request_job(const FieldJobOptions& options, const std::vector<std::string>& inputs) {
  FieldJobOptions counted = options;
  const auto files = files_of(inputs);
  counted.meshes = files.size();
  JobRequest made = request<FieldJobOptions>(counted, files, field_job);
  made.writes_mesh = false;
  return made;
}

JobRequest request_job(const MergeOptions& options, const std::vector<std::string>& inputs) {
  const auto files = files_of(inputs);
  if (files.size() < 2) throw UsageError("merge takes two meshes or more, and got one");
  if (files.size() > kMaxMerged)
    throw UsageError("merge takes " + std::to_string(kMaxMerged) +
                     " meshes at most: merge some of them first");
  read_priority(options.priority, files);
  MergeOptions counted = options;
  counted.meshes = files.size();
  return request<MergeOptions>(counted, files, merge_job);
}

JobRequest request_job(const std::string& command, const Json& options,
                       const std::vector<std::string>& inputs) {
  std::string known;
  for (const NamedRequest& job : kRequests) {
    if (command == job.name) return job.make(options, inputs);
    known += std::string(known.empty() ? "" : ", ") + job.name;
  }
  throw UsageError("no job that can be called is named '" + command + "', there are " + known);
}

}  // namespace tessera
