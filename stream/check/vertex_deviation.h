/// \file vertex_deviation.h
/// How far the vertices of a mesh lie from another mesh.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

struct VertexDeviation {
  std::vector<float>
      distance;               ///< one a vertex, scan units; infinite farther away than a 16th of the diagonal
  double percentile99 = 0.0;  ///< of the sizes of the finite ones, rounded up to two digits
};

/// \param mesh       the file \param position  of its vertices, finite where faces use them
/// \param with_sign  negative behind the closest face of the reference
/// \param temp       folder for both meshes, which are streamed \param memory_bytes  that may be used beside `position`
/// \throws InputError; ResourceError when the cap cannot suffice, naming one that would, or the disk is full
VertexDeviation vertex_deviation(const std::filesystem::path& mesh, std::span<const Double3> position,
                                 const std::filesystem::path& reference, bool with_sign,
                                 const std::filesystem::path& temp, std::uint64_t memory_bytes);

}  // namespace tessera
