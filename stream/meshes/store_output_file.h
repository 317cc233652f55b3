/// \file store_output_file.h
/// A store becomes a mesh file of a kind that create_mesh_file() does not know.
#pragma once
#include <functional>
#include <memory>

#include "stream/meshes/mesh_store_output.h"

namespace tessera {

/// \param create  makes the file. It is given the faces of one patch at a time, in the order of patches and of their faces.
/// \throws as write_mesh_store(), and what `create` throws
MeshStoreOutputReport write_mesh_store_as(
    const MeshStore& store, const MeshStoreOutput& output,
    const std::function<std::unique_ptr<MeshWriter>(const MeshHeader& header)>& create);

}  // namespace tessera
