#include "stream/stages/deform/vertex_batches.h"

#include <algorithm>

#include "stream/runtime/parallel.h"

namespace tessera {

void stream_vertices(MeshReader& mesh, std::size_t window, TaskContext& context,
                     const std::function<void(std::uint64_t number, DisplacedBatch&)>& work,
                     const std::function<void(DisplacedBatch&)>& use) {
  std::vector<DisplacedBatch> batches(window);
  std::size_t full = 0;
  std::uint64_t first = 0;
  const auto flush = [&](std::size_t count) {
    parallel_for(count, [&](std::size_t k) { work(first + k, batches[k]); });
    for (std::size_t k = 0; k < count; ++k) {
      context.check_stop();
      use(batches[k]);
      context.advance(batches[k].position.size());
      batches[k].position.clear();
      batches[k].rgba.clear();
    }
    first += count;
    full = 0;
  };
  mesh.read_vertices([&](std::span<const Double3> points, std::span<const std::uint32_t> rgba) {
    context.check_stop();
    for (std::size_t i = 0; i < points.size();) {
      DisplacedBatch& b = batches[full];
      const std::size_t n = std::min(points.size() - i, kDisplacedVertices - b.position.size());
      const auto part = points.subspan(i, n);
      b.position.insert(b.position.end(), part.begin(), part.end());
      if (!rgba.empty()) {
        const auto colours = rgba.subspan(i, n);
        b.rgba.insert(b.rgba.end(), colours.begin(), colours.end());
      }
      i += n;
      if (b.position.size() == kDisplacedVertices && ++full == window) flush(window);
    }
  });
  flush(full + (batches[full].position.empty() ? 0 : 1));
}

}  // namespace tessera
