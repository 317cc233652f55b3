/// \file deform_output.h
/// What writers of moved meshes share: the vertices of the file elsewhere, its faces as they are.
#pragma once
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <span>

#include "stream/formats/meshes/mesh_io.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

inline bool finite(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// True counts: headers count polygons, or nothing.
struct MeshCounts {
  std::uint64_t vertices = 0, faces = 0;
};
MeshCounts count_mesh(MeshReader& mesh, TaskContext& context);

/// \pre there are points
MeshBox bounds_of(std::span<const Double3> points);

/// Where floats are too coarse so far from zero, what moves is written in doubles though the mesh came in floats.
/// \param stays  nothing moves
void place_output(MeshHeader& header, const std::filesystem::path& output, const MeshBox& box, bool stays);

/// \param reverse  the other side of every face becomes its front
void write_deformed_faces(MeshReader& mesh, bool reverse, MeshWriter& writer, TaskContext& context);

}  // namespace tessera
