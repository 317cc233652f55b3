/// \file face_components.h
/// Connected components of faces over shared vertices.
#pragma once
#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

struct FaceComponents {
  std::vector<std::uint32_t> of_vertex;  ///< n; components are numbered by their first vertex
  std::vector<std::uint32_t> faces;      ///< per component; a vertex without faces is one of none
};

/// O(n) with path halving. \pre corners of faces below vertices
[[nodiscard]] FaceComponents find_components(std::size_t vertices,
                                             std::span<const std::array<std::uint32_t, 3>> faces);

/// Per component the vertices at which its faces fold by some 70 degrees, as foil does: their normals, summed by area, are shorter
/// by that than their areas. Only of components of which a strip is all there is, those with fewer than kStripDepth faces per
/// border count; 0 of others.
/// \param position  of the first vertices; faces at those beyond do not count
/// \param border    per component: edges or vertices at which it ends
template <std::floating_point T>
[[nodiscard]] std::vector<std::uint32_t> count_folded(std::span<const Vector3<T>> position,
                                                      std::span<const std::array<std::uint32_t, 3>> faces,
                                                      std::span<const std::uint32_t> of_vertex,
                                                      std::span<const std::uint32_t> component_faces,
                                                      std::span<const std::uint32_t> border) {
  constexpr std::uint32_t kStripDepth = 8;
  constexpr T kFolded = static_cast<T>(0.819);  // cosine of half of 70 degrees
  std::vector<std::uint32_t> folded(component_faces.size(), 0);
  std::vector<std::uint8_t> strip(folded.size());
  bool any = false;
  for (std::size_t c = 0; c < strip.size(); ++c) {
    if (component_faces[c] >= kStripDepth * std::uint64_t{border[c]}) continue;
    strip[c] = 1;
    any = true;
  }
  if (!any) return folded;
  std::vector<Vector3<T>> sum(position.size());
  std::vector<T> area(position.size(), T{0});
  for (const auto& f : faces) {
    if (!strip[of_vertex[f[0]]] || std::max({f[0], f[1], f[2]}) >= position.size()) continue;
    const Vector3<T> normal = triangle_normal(position[f[0]], position[f[1]], position[f[2]]);
    const T size = norm(normal);
    for (const std::uint32_t v : f) sum[v] = sum[v] + normal, area[v] += size;
  }
  for (std::size_t v = 0; v < sum.size(); ++v)
    folded[of_vertex[v]] += norm(sum[v]) < kFolded * area[v] ? 1 : 0;
  return folded;
}

}  // namespace tessera
