/// \file tangled_tile.h
/// Faces of a tile of a smoothed mesh that came to cross, overlap or touch others, and how they may be kept from it.
#pragma once
#include <cstdint>
#include <map>
#include <vector>

#include "stream/meshes/mesh_store.h"
#include "stream/stages/smooth/contact_regions.h"
#include "stream/stages/smooth/smooth_tiles.h"
#include "stream/stages/smooth/vertices_back.h"

namespace tessera {

class TangledTile {
 public:
  /// \param given  the mesh before it was smoothed: the same patches, faces and keys. Patches are loaded where faces meet
  /// \param tile   its margin holds what may have come near it   \param regions  hold all faces that may meet others
  /// \param back   what rounds before found
  TangledTile(const MeshStore& smoothed, const MeshStore& given, const SmoothTile& tile,
              const VerticesBack& back, const ContactRegions& regions);

  /// Pairs of faces, one of them at least of the tile, that meet beyond what they share and did not as they were given.
  /// \param found  gets their vertices that can go back, some more than once
  /// \param widely  and those of all faces around them
  /// \returns how many pairs; those that reach into other tiles are counted in one of them
  std::uint64_t find(bool widely, std::vector<VertexBack>& found);

  /// How far from each other faces may lie before smoothing and meet after it, or while vertices go back.
  static double reach(double move);
  static std::uint64_t bytes(std::uint64_t vertices, std::uint64_t faces);

 private:
  const Double3& given(std::uint32_t v);
  bool moved_vertex(std::uint32_t v);
  bool moved(std::uint32_t f);
  bool met_before(std::uint32_t one, std::uint32_t other);
  VertexBack back(std::uint32_t v);

  /// Where vertices of a patch were before it was smoothed.
  struct GivenPatch {
    std::vector<std::uint64_t> key;
    std::vector<Double3> position;
  };

  const MeshStore& given_store_;
  MeshBlock block_;  ///< as the rounds before left it
  std::vector<std::uint8_t> core_;
  std::vector<std::uint32_t> patch_of_;           ///< per vertex: one that has it
  std::map<std::uint32_t, GivenPatch> given_;     ///< by patch, as they are asked for
  std::map<std::uint64_t, Double3> before_back_;  ///< those that earlier rounds found, by key
};

}  // namespace tessera
