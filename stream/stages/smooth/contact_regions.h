/// \file contact_regions.h
/// Boxes of a smoothed mesh outside of which no faces came to meet: what a search there may leave out.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "stream/meshes/mesh_store.h"
#include "stream/stages/smooth/patch_range.h"

namespace tessera {

/// Of a tile of the last round of smoothing.
struct SearchedTile {
  std::vector<MeshBox> patches;   ///< of its own faces: a tile's one box would overlap those beside it widely
  std::vector<MeshBox> contacts;  ///< around its own faces that meet each other
};
/// \pre at least one
MeshBox box_around(std::span<const Double3> vertices);
/// Looks for contacts. \param core  of a block of the tile: 1 for its own faces   \param patches  boxes of their vertices
SearchedTile search_tile(const MeshBlock& block, std::span<const std::uint8_t> core,
                         std::vector<MeshBox> patches);
/// What search_tile() holds beside the block.
std::uint64_t search_tile_bytes(std::uint64_t faces);
/// Own faces may meet anywhere between these vertices.
SearchedTile unsearched_tile(std::span<const Double3> vertices);
/// \returns bytes written
std::uint64_t save_searched(const std::filesystem::path& path, std::span<const SearchedTile> tiles);

class ContactRegions {
 public:
  ContactRegions() = default;
  /// Where own faces of tiles meet, and where patches of two tiles overlap: both faces of any pair meet such a box.
  /// \param files  what save_searched() wrote of all tiles   \throws InputError where that is nothing
  explicit ContactRegions(const std::vector<std::filesystem::path>& files);
  /// Around vertices. Both faces of a pair meet such a box if one of them has such a vertex.
  /// \param store  smoothed: there the vertices are at `at`   \param longest  edges by patch, before it was smoothed
  /// \param move    how far all vertices are, at most, from where they were before and are in the store
  /// \param widely  and all faces around the corners of such pairs do
  ContactRegions(const MeshStore& store, std::span<const Double3> at, const PatchRange& longest, double move,
                 bool widely);

  /// Patches that may have faces which meet a box, ascending.
  std::vector<std::size_t> patches(const MeshStore& store) const;
  /// Whether some of a patch may. \param patch  box of it, as in the store
  bool near(const MeshBox& patch) const;
  /// Per face of a patch: 1 where it may meet a box. \param patch  box of it, as in the store
  std::vector<std::uint8_t> faces(const MeshBlock& block, const MeshBox& patch) const;
  std::uint64_t bytes() const { return boxes_.size() * sizeof(MeshBox); }

 private:
  void sort();
  /// Those that may overlap a box.
  std::span<const MeshBox> beside(const MeshBox& box) const;

  std::vector<MeshBox> boxes_;  ///< by their low sides
  double widest_ = 0.0;         ///< of them, along x
  double move_ = 0.0;           ///< how far vertices are from where they are in the store
};

}  // namespace tessera
