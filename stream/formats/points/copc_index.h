/// \file copc_index.h
/// The octree of a COPC file (a LAZ file whose chunks are the nodes of an octree, coarse points first): which of its
/// chunks hold what is wanted, without reading the others. Its hierarchy is a claim, compared with the chunk table.
/// Source: COPC 1.0 (Hobu), "copc" records 1 and 1000.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stream/files/read_file.h"
#include "stream/formats/points/las_header.h"
#include "stream/formats/points/laz_chunks.h"

namespace tessera {

struct CopcInfo {
  Double3 centre{};
  double half_size = 0.0;
  double spacing = 0.0;  ///< of the points of level 0; half of it a level further
  std::uint64_t root_at = 0, root_bytes = 0;
  std::uint64_t at = 0;  ///< byte of the file where it stands
};

/// A chunk that is wanted.
struct CopcChunk {
  std::size_t chunk = 0;  ///< of the chunk table
  Double3 min{}, max{};   ///< of its cube: no point lies outside
  std::string name;       ///< level-x-y-z
};

/// Nothing for a file that is no COPC. \throws InputError naming file and byte for one whose record makes no sense
std::optional<CopcInfo> find_copc(const ReadFile& file, const LasHeader& header);

/// Chunks whose cubes meet the box, of levels up to the first one whose spacing is at most `resolution` (0 = all), in
/// the order of the file. \param slack  by which cubes are wider than they claim: a step of the coordinates
/// \throws InputError naming file and byte when the hierarchy and the chunk table differ, or pages run in a circle
std::vector<CopcChunk> copc_chunks(const ReadFile& file, const CopcInfo& copc, const LazChunks& chunks,
                                   const std::optional<PointBox>& box, double resolution, double slack);

}  // namespace tessera
