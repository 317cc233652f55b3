/// \file vertex_batches.h
/// The vertices of a mesh's file from front to back, in batches of kDisplacedVertices that are worked on in parallel and used in
/// order.
#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/stage.h"
#include "stream/stages/deform/deform_files.h"

namespace tessera {

struct VertexBatch {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;  ///< empty without colour
  Displacements displaced;          ///< for who works on it
  double largest = 0.0;             ///< the same

  static constexpr std::uint64_t kVertexBytes = 24 + 4 + sizeof(Displacement) + sizeof(TangentRest);
};

/// \param window  batches that are in memory
/// \param work    on any thread of the pool, with the number of the batch
/// \param use     in the order of the file, one at a time
void stream_vertices(MeshReader& mesh, std::size_t window, TaskContext& context,
                     const std::function<void(std::uint64_t number, VertexBatch&)>& work,
                     const std::function<void(VertexBatch&)>& use);

}  // namespace tessera
