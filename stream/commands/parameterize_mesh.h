/// \file parameterize_mesh.h
/// A mesh file in, the same mesh with texture coordinates out. In core: one linear system spans the mesh.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>

#include "kernels/maps/parameterize.h"

namespace tessera {

struct ParameterizeMeshOptions {
  ParameterizeOptions map;
  std::uint64_t memory_bytes = 0;  ///< peak resident memory; 0 = 0.8 of what is there
  std::function<void()> check_stop;
};

struct ParameterizeMeshReport {
  std::uint64_t vertices = 0, faces = 0;
  double read_s = 0.0, map_s = 0.0, write_s = 0.0;
  ParameterizeReport map;
};

/// Triangle soups (STL) are merged by exact position; colours are left out.
/// \throws InputError     damaged, or not a disk (says what it is instead)
/// \throws ResourceError  mesh and multigrid do not fit the memory (says what would do)
/// \throws UsageError     for an output that holds no texture coordinates
ParameterizeMeshReport parameterize_mesh(const std::filesystem::path& input,
                                         const std::filesystem::path& output,
                                         const ParameterizeMeshOptions& options);

}  // namespace tessera
