/// \file tangled_tile.h
/// Faces of a tile of a smoothed mesh that came to cross, overlap or touch others, and how they may be kept from it.
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "stream/meshes/mesh_store.h"
#include "stream/stages/smooth/smooth_tiles.h"
#include "stream/stages/smooth/vertices_back.h"

namespace tessera {

class TangledTile {
 public:
  /// \param given  the mesh before it was smoothed: the same patches, faces and keys
  /// \param tile   its margin holds what may have come near it   \param move  how far smoothing moved a vertex, at most
  /// \param back   what rounds before found
  TangledTile(const MeshStore& smoothed, const MeshStore& given, const SmoothTile& tile, double move,
              const VerticesBack& back);

  /// Pairs of faces, one of them at least of the tile, that meet beyond what they share and did not as they were given.
  /// \param found  gets their vertices that can go back, some more than once
  /// \param widely  and those of all faces around them
  /// \returns how many pairs; those that reach into other tiles are counted in one of them
  std::uint64_t find(bool widely, std::vector<VertexBack>& found) const;

  /// How far from each other faces may lie before smoothing and meet after it, or while vertices go back.
  static double reach(double move);
  static std::uint64_t bytes(std::uint64_t vertices, std::uint64_t faces);

 private:
  std::uint32_t given(std::uint32_t v) const;
  bool moved_vertex(std::uint32_t v) const;
  bool moved(std::uint32_t f) const;
  bool met_before(std::uint32_t one, std::uint32_t other) const;
  /// Where smoothing left a vertex.
  const Double3& smoothed(std::uint32_t v) const;

  MeshHaloBlock near_;  ///< as the rounds before left it
  MeshBlock given_;
  std::vector<std::uint32_t> in_given_;  ///< per vertex of near_: its number there
  std::vector<std::pair<std::uint32_t, Double3>>
      before_back_;  ///< those that earlier rounds found, ascending
};

}  // namespace tessera
