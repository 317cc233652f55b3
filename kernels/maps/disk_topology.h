/// \file disk_topology.h
/// Whether a mesh in memory is a disk, and its border.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "solvers/laplacian.h"

namespace tessera {

struct SurfaceTopology {
  /// Borders, each along its faces, from its smallest vertex; by it.
  std::vector<std::vector<std::uint32_t>> loops;
  std::int64_t euler = 0;      ///< vertices - edges + faces, unused vertices left out
  std::size_t components = 0;  ///< pieces joined by edges
  std::size_t unused_vertices = 0;
  std::size_t irregular_edges = 0;  ///< more than two faces, or two that run along it in the same direction
  std::size_t irregular_vertices = 0;  ///< more than one fan of faces

  [[nodiscard]] bool is_disk() const {
    return euler == 1 && loops.size() == 1 && components == 1 && irregular_edges == 0 &&
           irregular_vertices == 0;
  }
  /// "Euler characteristic 2, 0 borders, 1 piece": what is_disk() looks at.
  [[nodiscard]] std::string describe() const;
};

/// \throws InputError for a face that names an unknown vertex or one vertex twice
[[nodiscard]] SurfaceTopology surface_topology(const TriangleSpan& mesh);

}  // namespace tessera
