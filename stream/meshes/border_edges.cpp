#include "stream/meshes/border_edges.h"

#include <algorithm>

namespace tessera {
namespace {

/// Spreads edges over passes; any fixed mixing will do, the result does not depend on it.
std::uint64_t mixed(std::uint64_t low, std::uint64_t high) {
  std::uint64_t x = low * 0x9e3779b97f4a7c15ull + high;
  x ^= x >> 29;
  x *= 0xbf58476d1ce4e5b9ull;
  return x ^ (x >> 32);
}

template <typename Index>
BorderEdges find(const FaceStream& faces, std::uint64_t face_count, std::uint64_t memory_bytes,
                 std::size_t max_listed) {
  using Edge = std::array<Index, 2>;
  const std::uint64_t need = 3 * face_count * sizeof(Edge);
  // Passes are uneven by a little: the table gets 3/4 of the memory on average.
  const std::uint64_t passes =
      std::max<std::uint64_t>(1, (need + need / 3 + memory_bytes - 1) / memory_bytes);
  BorderEdges result;
  std::vector<Edge> table;
  for (std::uint64_t pass = 0; pass < passes; ++pass) {
    table.clear();
    table.reserve(3 * face_count / passes + (passes > 1 ? face_count / passes / 4 : 0));
    faces([&](std::span<const MeshFace> batch) {
      for (const MeshFace& f : batch) {
        if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0]) continue;
        for (std::size_t i = 0; i < 3; ++i) {
          const std::uint64_t low = std::min(f[i], f[(i + 1) % 3]);
          const std::uint64_t high = std::max(f[i], f[(i + 1) % 3]);
          if (passes > 1 && mixed(low, high) % passes != pass) continue;
          table.push_back({static_cast<Index>(low), static_cast<Index>(high)});
        }
      }
    });
    std::sort(table.begin(), table.end());
    for (std::size_t i = 0; i < table.size();) {
      std::size_t end = i + 1;
      while (end < table.size() && table[end] == table[i]) ++end;
      const std::array<std::uint64_t, 2> edge = {table[i][0], table[i][1]};
      if (end - i == 1) {
        ++result.border_count;
        if (result.border.size() < max_listed) result.border.push_back(edge);
      } else if (end - i > 2) {
        ++result.non_manifold_count;
        if (result.non_manifold.size() < max_listed) result.non_manifold.push_back(edge);
      }
      i = end;
    }
  }
  std::sort(result.border.begin(), result.border.end());
  std::sort(result.non_manifold.begin(), result.non_manifold.end());
  return result;
}

bool small_indices(std::uint64_t vertices) {
  return vertices <= 0xffffffffull;
}

}  // namespace

std::uint64_t edge_table_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return 3 * faces * (small_indices(vertices) ? 8 : 16);
}

BorderEdges find_border_edges(const FaceStream& faces, std::uint64_t vertices, std::uint64_t face_count,
                              std::uint64_t memory_bytes, std::size_t max_listed) {
  return small_indices(vertices) ? find<std::uint32_t>(faces, face_count, memory_bytes, max_listed)
                                 : find<std::uint64_t>(faces, face_count, memory_bytes, max_listed);
}

}  // namespace tessera
