/// \file uv_mesh_writer.h
/// A mesh in memory with texture coordinates into a file: OBJ (`vt`, one per vertex) or binary PLY
/// (properties s, t).
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>

#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

/// \throws UsageError unless `path` ends in .obj or .ply
void require_uv_extension(const std::filesystem::path& path);

/// Writes under a part name, then renames. \pre header counts are those of the spans
/// \throws UsageError for another extension, ResourceError when the disk is full
void write_uv_mesh(const std::filesystem::path& path, const MeshHeader& header,
                   std::span<const Double3> positions, std::span<const std::array<double, 2>> uv,
                   std::span<const std::array<std::uint32_t, 3>> faces);

}  // namespace tessera
