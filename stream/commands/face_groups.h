/// \file face_groups.h
/// The faces of a mesh, component by component: what OBJ calls groups.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>

#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

struct FaceGroupOptions {
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  std::filesystem::path temp;
  std::function<void()> check_stop;  ///< may throw StoppedError; may be empty
};

/// Hands the faces to `writer`, those of each component behind a group "component_1", "component_2", ..., in the order of their first
/// vertices and, within one, of the mesh. Faces that share a vertex are of one component. Reads the faces twice and sorts them outside of
/// memory. \param vertices  of the mesh, 4 bytes each are held
/// \returns how many components there are \throws ResourceError for more vertices than memory_bytes holds, or than 2^32 - 1
std::uint64_t write_face_groups(MeshReader& mesh, std::uint64_t vertices, MeshWriter& writer,
                                const FaceGroupOptions& options);

}  // namespace tessera
