/// \file import_mesh.h
/// A mesh file as a store, outside of a job: for commands that need one for a while.
#pragma once
#include <filesystem>
#include <functional>
#include <string>

#include "stream/files/json.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/options.h"

namespace tessera {

/// Imports a mesh file as a store in `work`/`folder`, which must not hold one. \throws as run_stages, InputError
MeshStore import_mesh(const std::filesystem::path& mesh, const std::filesystem::path& work,
                      const std::string& folder, const RunOptions& run,
                      const std::function<void()>& check_stop, Json* report = nullptr);

}  // namespace tessera
