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

struct DisplacedBatch {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;  ///< empty without colour
  NormalDisplacements displaced;    ///< for who works on it
  std::vector<double> distance;     ///< the same
  double largest = 0.0;             ///< the same

  static constexpr std::uint64_t kVertexBytes = 24 + 4 + 8 + sizeof(NormalDisplacement) + sizeof(TangentRest);
};

/// Batches in memory at a time.
constexpr std::size_t vertex_window(const RunOptions& run) {
  return 2 * static_cast<std::size_t>(run.threads);
}

/// \param window  vertex_window()
/// \param work    on any thread of the pool, with the number of the batch
/// \param use     in the order of the file, one at a time
void stream_vertices(MeshReader& mesh, std::size_t window, TaskContext& context,
                     const std::function<void(std::uint64_t number, DisplacedBatch&)>& work,
                     const std::function<void(DisplacedBatch&)>& use);

}  // namespace tessera
