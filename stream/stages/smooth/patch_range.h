/// \file patch_range.h
/// How far a ring can reach in every patch of a store, by the lengths of its edges.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "stream/files/json.h"

namespace tessera {

/// Edges of a patch: a bound of the longest one, and the sum of the squares of those of its faces.
struct PatchEdges {
  double longest = 0.0, squares = 0.0;
};
PatchEdges edges_of(const MeshBlock& patch);

/// What a round must know of every patch, in the order of the store.
struct PatchRange {
  std::vector<double> longest_edge;  ///< it bounds how far a ring reaches
  std::vector<double> edge_squares;  ///< sum of the squared edges of its faces

  /// Root mean square of all edges, those inside counted twice.
  double edge(std::uint64_t faces) const;

  void save(const std::filesystem::path& path) const;
  static PatchRange load(const std::filesystem::path& path);
};

/// From `edges` of the summaries of a stage's tasks: [patch, longest edge, sum of squares].
PatchRange range_of(const std::vector<Json>& summaries, std::size_t patches);

}  // namespace tessera
