/// \file preview_mesh.h
/// A copy of a finished mesh that is small enough to be turned in a browser, and figures of all its faces on the way.
/// A mesh of at most kMaxPreviewFaces comes as it is; of a larger one the vertices are clustered
/// (kernels/decimate/vertex_clustering.h): two passes over the file at any size, where decimation would take as long as
/// the job itself. Of a mesh of millions of faces an even sample shapes the vertices of cells and is counted in the figures.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

inline constexpr std::uint64_t kMaxPreviewFaces = 200'000;

struct PreviewMesh {
  Double3 origin{};  ///< of the positions, in the frame of the file
  std::vector<Float3> position;
  std::vector<std::uint32_t> rgba;  ///< as points carry colours; none where the mesh has no colours
  std::vector<std::array<std::uint32_t, 3>> faces;
  double cell = 0.0;             ///< vertices of one such cell are one; 0: the mesh itself
  std::uint64_t mesh_faces = 0;  ///< read

  // Of all faces, or of that sample of them.
  /// Faces by their smallest angle, in steps of 5 degrees.
  std::array<std::uint64_t, 12> smallest_angle{};
  /// Sides of faces by length: bin i holds those in [2^(i/2), 2^((i+1)/2)) times shortest_edge_bin.
  std::vector<std::uint64_t> edge_length;
  double shortest_edge_bin = 0.0;
};

/// \param temp  folder for positions that do not fit \param memory_bytes  that it may use
/// \throws ResourceError when that is less than preview_bytes(), naming how much it takes, or the disk is full; InputError
PreviewMesh make_preview(const std::filesystem::path& mesh, const std::filesystem::path& temp,
                         std::uint64_t memory_bytes);

/// The least that make_preview() needs.
std::uint64_t preview_bytes();

}  // namespace tessera
