/// \file coverage_check.h
/// How much of a scan is in a mesh that lies there, as a reconstruction tells it of its own, without a job.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/runtime/options.h"

namespace tessera {

/// Sorts the scan and cuts the mesh up in a scratch folder of `run.temp`, about as much disk as both take.
/// \param scans  files that are told of in the coordinates of the mesh  \param run  memory_bytes and threads > 0
/// \returns `coverage` of a report (coverage_stage.h), without a picture; {"measured": false} where points tell nothing
/// \throws InputError for what cannot be read; EmptyError for a scan or a mesh of nothing; ResourceError; StoppedError
Json measure_coverage(const std::filesystem::path& mesh, const std::vector<std::string>& scans,
                      const RunOptions& run);

}  // namespace tessera
