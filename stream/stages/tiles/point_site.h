/// \file point_site.h
/// Scans as 3D Tiles: an octree of which every level adds points to those above it (copc_nodes.h), its nodes GLB files of points, packed by
/// EXT_meshopt_compression. Refinement is additive: `geometricError` is the distance between neighbouring points of a level, 0 for leaves.
/// Source: OGC 22-025r4, 3D Tiles 1.1.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stream/formats/copc/copc_nodes.h"
#include "stream/stages/tiles/site_frame.h"

namespace tessera {

struct PointSiteOptions {
  std::vector<std::filesystem::path> inputs;
  std::filesystem::path
      site;  ///< an empty folder, or none yet; where it is there, its tiles and tileset.json are replaced
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  int threads = 0;  ///< 0 = all cores
};

struct PointSiteReport {
  std::uint64_t points = 0, not_finite = 0;
  std::uint64_t tiles = 0, tilesets = 0, bytes = 0;
  int levels = 0;
  bool colour = false;
  double spacing = 0.0;  ///< of the root's points, scan units
  SiteFrame frame;
  std::vector<std::string> notes;  ///< of the inputs, one sentence each
};

/// Every finite point is in one tile, moved along an axis by at most a 65,000th of the tile's edge; coloured where any input is. The same bytes
/// whatever the order of inputs, threads and memory. Written beside the folder and moved there last, the tileset at the very end.
/// \throws InputError (scans of different coordinate systems too), EmptyError, ResourceError
PointSiteReport write_point_site(const PointSiteOptions& options);

/// tileset.json, and tilesets in tilesets where there are more nodes than one file shall have. \param cube  in the frame of the site
/// \param sink  as that of write_tilesets
void write_point_tilesets(const std::vector<CopcNode>& nodes, const CopcCube& cube,
                          const std::array<double, 16>& transform, std::size_t most_tiles,
                          const std::function<void(const std::string& name, const std::string& text)>& sink);

}  // namespace tessera
