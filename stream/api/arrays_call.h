/// \file arrays_call.h
/// Jobs that make one mesh of another on arrays of the caller, without a file of a mesh: the same vertices, faces and order as the
/// command makes of the same mesh in a PLY.
///
///     const MeshArrays mesh(vertices, FaceSpan<std::uint32_t>(faces));
///     const auto [small, report] = run_on_arrays(mesh, SimplifyOptions{.tolerance = 0.001});
///
/// What the arrays given take counts under the cap, as all that the process holds; what is made does not. A job that was stopped
/// begins anew. Textures need a file.
#pragma once
#include <string>
#include <utility>

#include "stream/api/job_call.h"
#include "stream/formats/meshes/mesh_arrays.h"

namespace tessera {

struct ArraysResult {
  MadeMesh mesh;
  Json report;  ///< (schema 1) its output is null
};

/// \param request  of request_on_arrays(), with `how` it runs in its state
/// \throws what call_job() throws
[[nodiscard]] ArraysResult call_on_arrays(const MeshArrays& mesh, JobRequest request,
                                          const ProgressCall& progress = {});

/// The request of each such command. \throws UsageError for options that make no sense, or that need a file
[[nodiscard]] JobRequest request_on_arrays(const SimplifyOptions& options);
[[nodiscard]] JobRequest request_on_arrays(const RemeshJobOptions& options);
[[nodiscard]] JobRequest request_on_arrays(const SmoothOptions& options);
[[nodiscard]] JobRequest request_on_arrays(const ResampleOptions& options);
/// By the name of a command and options by their keys, as a job file has them.
[[nodiscard]] JobRequest request_on_arrays(const std::string& command, const Json& options);

/// \throws what request_on_arrays() and call_on_arrays() throw
template <class Options>
[[nodiscard]] ArraysResult run_on_arrays(const MeshArrays& mesh, const Options& options,
                                         const RunOptions& how = {}, const ProgressCall& progress = {}) {
  JobRequest request = request_on_arrays(options);
  request.state.run = how;
  return call_on_arrays(mesh, std::move(request), progress);
}

}  // namespace tessera
