/// \file scene_file.h
/// Scenes by name or by file: a mesh is a scene too.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "kernels/scene/scene.h"

namespace tessera {

/// Whether a scene's name is that of a mesh file: it ends in .ply or as only meshes do (file_extension.h).
bool is_mesh_scene(const std::string& name);

/// The scene of this name, or the mesh of this file, whole in memory.
/// \throws UsageError for an unknown name; InputError when the file is no mesh; ResourceError when it takes more than
///         `memory_bytes`
std::unique_ptr<synth::Scene> open_scene(const synth::SceneOptions& options, std::uint64_t memory_bytes);

}  // namespace tessera
