/// \file system_beside.h
/// The coordinate system of a mesh stands in a file beside it (WKT, as geographic programs have it), "site.ply.prj" or
/// "site.prj" for "site.ply": jobs that make one mesh of another carry it on.
#pragma once
#include <filesystem>
#include <string>

#include "stream/runtime/job.h"

namespace tessera {

/// "site.ply.prj" for "site.ply": where jobs write it.
std::filesystem::path system_path(const std::filesystem::path& mesh);

/// What the first of these files holds that is there and not empty; empty where none is.
std::string system_beside(const std::filesystem::path& mesh);

/// What lies beside the job's first input, beside its output; nothing where nothing does.
BesideOutput carried_system();

}  // namespace tessera
