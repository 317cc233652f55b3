#include "stream/api/arrays_call.h"

#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "octree/error.h"
#include "stream/files/scratch_folder.h"

namespace tessera {
namespace {

template <class Options>
JobRequest arrays_request(const Options& options, JobDescription (*describe)(const Options&)) {
  options.validate();
  JobRequest made;
  made.state.inputs = {""};  // its name is given by the call
  made.state.settings = to_settings(options);
  made.job = describe(options);
  return made;
}

template <class Options>
JobRequest arrays_request_by_keys(const Json& keys) {
  Options options;
  option_table(options).from_json(keys);
  return request_on_arrays(options);
}

struct NamedArraysRequest {
  const char* name;
  JobRequest (*make)(const Json& keys);
};
constexpr NamedArraysRequest kArraysRequests[] = {
    // one line per job, alphabetical
    {"decimate", arrays_request_by_keys<SimplifyOptions>},
    {"remesh", arrays_request_by_keys<RemeshJobOptions>},
    {"resample", arrays_request_by_keys<ResampleOptions>},
    {"smooth", arrays_request_by_keys<SmoothOptions>},
};

}  // namespace

ArraysResult call_on_arrays(const MeshArrays& mesh, JobRequest request, const ProgressCall& progress) {
  RunOptions& how = request.state.run;
  if (how.processes) throw UsageError("processes: other processes do not see arrays: run the job on files");
  const std::filesystem::path temp =
      std::filesystem::absolute(how.temp.empty() ? std::filesystem::temp_directory_path() : how.temp);
  const ScratchFolder scratch(temp.lexically_normal(), "arrays");
  how.temp = scratch.path();
  how.page = false;
  request.state.inputs.at(0) = scratch.path() / "given";
  request.state.output = scratch.path() / "made.ply";  // what is made is as a PLY would hold it
  ArraysResult result;
  const auto job = std::make_shared<JobContext>();
  job->given.emplace(request.state.inputs[0], &mesh);
  job->made.emplace(request.state.output, &result.mesh);
  result.report = call_job(request, progress, job);
  return result;
}

JobRequest request_on_arrays(const SimplifyOptions& options) {
  if (options.has_texture()) throw UsageError("texture: arrays have none: run the job on files");
  JobRequest made = arrays_request<SimplifyOptions>(options, decimate_job);
  if (options.reference != "surface") made.state.inputs.emplace_back(options.reference);
  return made;
}

JobRequest request_on_arrays(const RemeshJobOptions& options) {
  return arrays_request<RemeshJobOptions>(options, remesh_job);
}

JobRequest request_on_arrays(const SmoothOptions& options) {
  return arrays_request<SmoothOptions>(options, smooth_job);
}

JobRequest request_on_arrays(const ResampleOptions& options) {
  return arrays_request<ResampleOptions>(options, resample_job);
}

JobRequest request_on_arrays(const std::string& command, const Json& options) {
  std::string known;
  for (const NamedArraysRequest& job : kArraysRequests) {
    if (command == job.name) return job.make(options);
    known += std::string(known.empty() ? "" : ", ") + job.name;
  }
  throw UsageError("no job on arrays is named '" + command + "', there are " + known);
}

}  // namespace tessera
