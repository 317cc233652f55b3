/// \file edge_faces.h
/// Which faces of a triangle mesh meet at an edge. Half-edge 3 f + k runs from corner k of face f to the next corner.
/// An edge of more than two faces is an edge like all others, but no two of its faces are neighbours: nothing tells which.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lists.h"

namespace tessera {

inline constexpr std::uint32_t kNoHalfEdge = ~std::uint32_t{0};

/// The half-edges of a mesh, gathered by edge.
/// \cost one counting sort over the vertices and short sorts; 4 bytes a vertex and 8 a half-edge
class EdgeFaces {
 public:
  using Face = std::array<std::uint32_t, 3>;

  /// \pre corners below `vertices`, fewer than 2^32 / 3 faces
  EdgeFaces(std::size_t vertices, std::span<const Face> faces)
      : EdgeFaces(vertices, faces, [](std::uint32_t) { return true; }) {}
  /// \param keep  tells of a half-edge whether it takes part
  template <class Keep>
  EdgeFaces(std::size_t vertices, std::span<const Face> faces, const Keep& keep)
      : by_low_(make_lists<End>(vertices, [&](const auto& put) {
          for (std::uint32_t f = 0; f < faces.size(); ++f)
            for (std::uint32_t k = 0; k < 3; ++k) {
              if (!keep(3 * f + k)) continue;
              const std::uint32_t from = faces[f][k], to = faces[f][k == 2 ? 0 : k + 1];
              put(std::min(from, to), {std::max(from, to), 3 * f + k});
            }
        })) {
    for (std::size_t v = 0; v < by_low_.size(); ++v) sort(by_low_[v]);
  }

  /// use(low, high, half-edges) for every edge, ascending by its smaller vertex and then by the larger one; its half-edges
  /// ascend.
  template <class Use>
  void for_each(const Use& use) const {
    std::vector<std::uint32_t> half;
    for (std::uint32_t low = 0; low < by_low_.size(); ++low) {
      const std::span<const End> ends = by_low_[low];
      for (std::size_t i = 0; i < ends.size();) {
        const std::uint32_t high = ends[i].high;
        half.clear();
        for (; i < ends.size() && ends[i].high == high; ++i) half.push_back(ends[i].half);
        use(low, high, std::span<const std::uint32_t>(half));
      }
    }
  }

 private:
  struct End {
    std::uint32_t high, half;
  };
  /// Most vertices have a few edges; a hub may have millions.
  static void sort(std::span<End> ends) {
    constexpr std::size_t kFew = 24;
    const auto less = [](const End& a, const End& b) {
      return a.high != b.high ? a.high < b.high : a.half < b.half;
    };
    if (ends.size() > kFew) {
      std::sort(ends.begin(), ends.end(), less);
      return;
    }
    for (std::size_t i = 1; i < ends.size(); ++i)
      for (std::size_t j = i; j > 0 && less(ends[j], ends[j - 1]); --j) std::swap(ends[j], ends[j - 1]);
  }

  Lists<End> by_low_;
};

/// Across every half-edge that of the other face; kNoHalfEdge at borders and at edges of more than two faces.
[[nodiscard]] std::vector<std::uint32_t> opposite_half_edges(std::size_t vertices,
                                                             std::span<const EdgeFaces::Face> faces);

}  // namespace tessera
