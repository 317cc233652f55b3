/// \file system_beside.h
/// The coordinate system of a mesh stands in a file beside it, MESH.prj (WKT, as geographic programs have it): jobs that
/// make one mesh of another carry it on.
#pragma once
#include <filesystem>
#include <string>

#include "stream/runtime/job.h"

namespace tessera {

/// "site.ply.prj" for "site.ply".
std::filesystem::path system_path(const std::filesystem::path& mesh);

/// What that file holds; empty where there is none.
std::string system_beside(const std::filesystem::path& mesh);

/// What lies beside the job's first input, beside its output; nothing where nothing does.
BesideOutput carried_system();

}  // namespace tessera
