/// \file job_scope.h
/// What is of one job, not of the process, beside its JobState: the wish that it stops, and files that it has in memory. Jobs of one
/// process that are called (api/job_call.h) have one each; a job of the program needs none, since the process is its own.
///
/// Whoever runs the job says so by a JobScope on its thread; threads that work for it inherit that (parallel.h).
#pragma once
#include <atomic>
#include <filesystem>
#include <map>
#include <memory>

namespace tessera {

class MeshArrays;  // formats/meshes/mesh_arrays.h
struct MadeMesh;

struct JobContext {
  /// As if the job alone had received this signal (stop.h). Any thread; 0: none.
  std::atomic<int> stop{0};
  /// Names among the inputs and outputs that are no files.
  std::map<std::filesystem::path, const MeshArrays*> given;
  std::map<std::filesystem::path, MadeMesh*> made;
};

/// While it lives, what this thread does is of that job; of none where it is null.
class JobScope {
 public:
  explicit JobScope(std::shared_ptr<const JobContext> job);
  ~JobScope();
  JobScope(const JobScope&) = delete;
  JobScope& operator=(const JobScope&) = delete;

 private:
  std::shared_ptr<const JobContext> before_;
};

/// Of this thread; null without one.
[[nodiscard]] std::shared_ptr<const JobContext> current_job();

/// Whether this name stands for arrays of the caller.
[[nodiscard]] bool is_given(const std::filesystem::path& input);

}  // namespace tessera
