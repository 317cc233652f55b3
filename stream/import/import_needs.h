/// \file import_needs.h
/// What the import of a mesh will take, told from what its file says of itself.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stream/import/import_plan.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Of a mesh file. Where the format has no counts, or counts that the file is too short for: what its bytes allow.
struct MeshSize {
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
};
/// \throws InputError as open_mesh_file()
MeshSize claimed_mesh_size(const std::filesystem::path& path);

/// Memory of the stages of an import whose vertices lie as evenly as those of scans.
std::vector<StageNeed> import_needs(const RunOptions& run, const ImportSource& source, const MeshSize& mesh);

/// Of the imports of the first `inputs` of a job. \param folder  of each
std::vector<StageNeed> import_needs(const JobState& state, std::size_t inputs,
                                    const std::function<std::string(std::size_t)>& folder);

}  // namespace tessera
