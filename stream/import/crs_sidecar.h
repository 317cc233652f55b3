/// \file crs_sidecar.h
/// The coordinate reference system of a mesh as a sidecar file (WKT): "site.ply.prj" or "site.prj" for "site.ply". Jobs that make
/// one mesh of another carry it on.
#pragma once
#include <filesystem>
#include <string>

#include "stream/runtime/job.h"

namespace tessera {

/// "site.ply.prj" for "site.ply": where jobs write it.
std::filesystem::path crs_sidecar_path(const std::filesystem::path& mesh);

/// What the first of these files holds that is there and not empty; empty where none is.
std::string crs_of_mesh(const std::filesystem::path& mesh);

/// The sidecar of the job's first input, written for its output; nothing where the input has none.
SidecarOutput carried_crs();
/// That of a job that finds its own: `coordinate_system` of its report.
SidecarOutput found_crs();

}  // namespace tessera
