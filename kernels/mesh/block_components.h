/// \file block_components.h
/// Connected components of a mesh block, for finding islands across blocks.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

struct BlockComponents {
  std::vector<std::uint32_t> of_vertex;  ///< n; components are numbered by their first vertex
  std::vector<std::uint32_t> faces;      ///< per component
  std::vector<std::uint32_t> border;     ///< per component: edges at which the surface ends
  std::vector<std::uint32_t> folded;     ///< per component: vertices at which it folds (count_folded)
  std::vector<std::uint8_t> open;        ///< per component: 1 if it goes on beyond the block
};

/// \param complete  per vertex: 1 if its star is complete (complete_stars)
[[nodiscard]] BlockComponents find_components(const MeshBlock& block, std::span<const std::uint8_t> complete);

/// Without the faces at these vertices. \param gone  keys, ascending  \pre canonical \post canonical
[[nodiscard]] MeshBlock without_vertices(const MeshBlock& block, std::span<const std::uint64_t> gone);

}  // namespace tessera
