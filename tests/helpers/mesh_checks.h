/// \file mesh_checks.h
/// Welds patches by key alone and counts everything that could be wrong with the result.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/mesh/patch.h"

namespace tessera::test {

struct IndexedMesh {
  std::vector<Double3> position;  ///< global, cells from the lattice origin
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<VertexClass> vertex_class;  ///< empty or one per vertex
  std::vector<std::uint32_t> rgba;        ///< empty or one per vertex
  std::size_t unresolved = 0;  ///< foreign vertices that no patch exports; faces with them are left out
};

IndexedMesh weld(const std::vector<Patch>& patches);

struct MeshChecks {
  std::size_t boundary_edges = 0;
  std::size_t boundary_loops = 0;
  std::size_t non_manifold_edges = 0;     ///< more than two faces
  std::size_t non_manifold_vertices = 0;  ///< more than one fan
  std::size_t misoriented_edges = 0;      ///< two faces that run along the edge in the same direction
  std::size_t duplicate_faces = 0;        ///< same three vertices
  std::size_t degenerate_faces = 0;       ///< repeated vertex or no area
  std::size_t unused_vertices = 0;
  std::size_t components = 0;
  std::int64_t euler = 0;  ///< vertices - edges + faces
  std::int64_t genus = 0;  ///< sum over components

  /// Everything that must be zero in any output of ours.
  std::size_t defects() const {
    return non_manifold_edges + non_manifold_vertices + misoriented_edges + duplicate_faces +
           degenerate_faces + unused_vertices;
  }
};

MeshChecks check_mesh(const IndexedMesh& mesh);

/// Hash over all bytes of a patch, for comparisons between blocks.
std::uint64_t patch_hash(const Patch& patch);

}  // namespace tessera::test
