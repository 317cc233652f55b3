/// \file mesh_topology.h
/// The heart of the mesh check. Corners (vertex, next, previous) are partitioned by ranges of vertices;
/// around each vertex its faces tell edges, fans, borders and duplicates; sets that reach beyond a range are
/// joined by records sent to the range of the other vertex, which is always a later one. Memory follows the
/// largest range and the number of parts cut by range borders, never the mesh.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "stream/check/mesh_check.h"
#include "stream/check/mesh_shape.h"
#include "stream/files/spill_buckets.h"
#include "stream/formats/vertex_store.h"

namespace tessera {

/// Ranges of vertices and what they may cost.
struct TopologyPlan {
  std::vector<std::uint64_t> bounds;  ///< range k is [bounds[k], bounds[k+1]); first 0, last the vertex count
  std::size_t chunk_bytes = 65536;    ///< per range and kind of record, while being filled
  std::uint64_t link_bytes = 0;       ///< limit of the sets that cross ranges, all kinds together
};

/// Bytes that a range needs when it is analysed, at worst (every edge a boundary).
constexpr std::uint64_t topology_range_bytes(std::uint64_t vertices, std::uint64_t corners, bool wide) {
  const std::uint64_t index = wide ? 8 : 4;
  return vertices * (sizeof(Double3) + 13) +
         corners * (2 * index + 2 * (2 * index + 5) + sizeof(MeshComponent) / 3);
}

class MeshTopology {
 public:
  virtual ~MeshTopology() = default;
  /// Every index below the vertex count. Faces that repeat an index are counted and only make vertices
  /// referenced.
  virtual void add(std::span<const MeshFace> faces) = 0;
  /// After all faces, once: fills the topology part of `check` and hands every proper face to `shape`.
  virtual void analyse(VertexStore& positions, MeshShape& shape, const std::function<void()>& check_stop,
                       MeshCheck& check) = 0;
};

/// 32-bit records below 2^32 vertices, 64-bit ones beyond. `pool` outlives the result.
std::unique_ptr<MeshTopology> make_mesh_topology(const TopologyPlan& plan, SpillPool& pool);

}  // namespace tessera
