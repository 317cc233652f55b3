/// \file border_edges.h
/// Edges of a streamed mesh that do not have exactly two faces, found by sorting, in bounded memory.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

struct BorderEdges {
  std::vector<std::array<std::uint64_t, 2>> border;        ///< one face; in order of their vertices
  std::vector<std::array<std::uint64_t, 2>> non_manifold;  ///< three faces or more
  std::uint64_t border_count = 0, non_manifold_count = 0;  ///< also where the lists were cut
};

/// Streams all faces to the sink it is given; called once per pass.
using FaceStream = std::function<void(const std::function<void(std::span<const MeshFace>)>&)>;

/// Bytes of the edge table per face.
std::uint64_t edge_table_bytes(std::uint64_t vertices, std::uint64_t faces);

/// Faces with a repeated vertex have no edges.
/// Passes over the faces: as many as the table needs in `memory_bytes`.
/// The lists hold at most `max_listed` edges each.
BorderEdges find_border_edges(const FaceStream& faces, std::uint64_t vertices, std::uint64_t face_count,
                              std::uint64_t memory_bytes, std::size_t max_listed);

}  // namespace tessera
