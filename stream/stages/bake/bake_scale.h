/// \file bake_scale.h
/// What all stages of a baking job agree on once its points are known: widths, distances, blocks.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "stream/meshes/mesh_blocking.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

struct BakeScale {
  double texel = 0.0;         ///< units of the mesh
  double spacing = 0.0;       ///< mean one of the points on the surface
  double max_distance = 0.0;  ///< of points that give colours
  std::vector<double> areas;  ///< per patch of the mesh

  static BakeScale of_work(const std::filesystem::path& work);
  /// Blocks of the mesh that a task works on: bounded by faces and texels.
  std::vector<MeshBlockCut> blocks(const MeshStore& mesh) const;
  double block_texels(const MeshBlockCut& block) const;
};

/// Texels of charts of one block: between their boxes much is empty.
inline constexpr std::uint64_t kBlockTexels = 1u << 19, kBlockTextureFaces = 1u << 15;
/// Bytes of the rasters of the charts of a block with so many texels, no chart being larger than a page.
std::uint64_t block_raster_bytes(double texels, std::uint64_t page_size, std::uint64_t bytes_per_texel);

}  // namespace tessera
