/// \file mesh_store_output.h
/// A store becomes one mesh file: one global numbering, vertices in the order of patches and keys, then
/// faces. Streamed.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stream/formats/meshes/mesh_io.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

struct MeshStoreOutput {
  std::filesystem::path path;  ///< by extension (create_mesh_file)
  std::vector<std::string> comments;
  Double3 origin = {0, 0, 0};  ///< of positions in formats of floats (mesh_precision.h)
  std::filesystem::path temp;  ///< folder for what does not fit in memory
  std::uint64_t memory_bytes = std::uint64_t{64} << 20;  ///< of its sorts; patches come on top
  std::size_t patches_at_once = 1;             ///< loaded on all threads, to be written one after the other
  std::function<void()> check_stop;            ///< may be empty; called from several threads
  std::function<void(std::uint64_t)> advance;  ///< faces written; may be empty
};

struct MeshStoreOutputReport {
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
  std::uint64_t bytes = 0;
  std::uint64_t shared_vertices = 0;  ///< that more than one patch uses
  std::uint64_t synthetic_faces = 0;  ///< that close holes: marked where the format can
  MeshRounding rounding;              ///< what the format's floats did to the mesh
  std::uint64_t flat_faces = 0;       ///< without area (flat_faces.h)
};

/// Reads every patch three times: once to find the vertices that patches share, once for vertices, once for
/// faces. \throws EmptyError when there is no face; UsageError when the format cannot hold the mesh; ValidationError where
/// its floats cannot (MeshWriter::finish); ResourceError
MeshStoreOutputReport write_mesh_store(const MeshStore& store, const MeshStoreOutput& output);

/// Upper bound of what write_mesh_store allocates. \param patch_bytes  MeshStore::largest_patch_bytes()
std::uint64_t write_mesh_store_bytes(std::uint64_t patch_bytes, std::uint64_t patches,
                                     std::uint64_t sort_bytes, std::size_t patches_at_once = 1);

}  // namespace tessera
