/// \file deform_job.h
/// The jobs of `tessera deform`: a mesh of any size is bent through a base surface (thesis 5 and 6).
#pragma once
#include "stream/runtime/job.h"
#include "stream/stages/deform/deform_options.h"

namespace tessera {

/// Mode deform: JobState::inputs is the mesh; the report's `mesh` says what was written, `edit` what was solved.
/// Mode onto: inputs are the mesh and scans; the report's `onto` says how far the scan was from it before and after.
/// Mode prepare: the same, the output is a basis. Mode apply: inputs are a basis and its mesh.
JobDescription deform_job(const DeformOptions& options);

/// The mesh that a basis was prepared for, if it still is that one.
/// \throws InputError when it is gone or changed \param mesh  empty: where it was
std::filesystem::path mesh_of_basis(const std::filesystem::path& basis, const std::filesystem::path& mesh);

}  // namespace tessera
