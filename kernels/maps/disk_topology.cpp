#include "kernels/maps/disk_topology.h"

#include <algorithm>

#include "octree/error.h"
#include "octree/lists.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

struct HalfEdge {
  std::uint64_t edge;  ///< smaller vertex << 32 | larger
  std::uint32_t face;
  bool forward;  ///< from the smaller to the larger
};

std::string counted(std::size_t n, const std::string& one, const std::string& many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

/// Sorted by edge, then face: a counting sort over the smaller vertex, then tiny sorts.
std::vector<HalfEdge> sorted_half_edges(const TriangleSpan& mesh) {
  Lists<HalfEdge, std::size_t> half =
      make_lists<HalfEdge, std::size_t>(mesh.positions.size(), [&](const auto& put) {
        for (std::size_t f = 0; f < mesh.faces.size(); ++f)
          for (std::size_t k = 0; k < 3; ++k) {
            const std::uint32_t a = mesh.faces[f][k], b = mesh.faces[f][(k + 1) % 3];
            put(std::min(a, b), {static_cast<std::uint64_t>(std::min(a, b)) << 32 | std::max(a, b),
                                 static_cast<std::uint32_t>(f), a < b});
          }
      });
  for (std::size_t v = 0; v < half.size(); ++v)
    std::sort(half[v].begin(), half[v].end(), [](const HalfEdge& a, const HalfEdge& b) {
      return a.edge != b.edge ? a.edge < b.edge : a.face < b.face;
    });
  return std::move(half.item);
}

class Surveyor {
 public:
  explicit Surveyor(const TriangleSpan& mesh) : mesh_(mesh), pieces_(mesh.faces.size()) {
    const std::size_t n = mesh.positions.size();
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const auto& face = mesh.faces[f];
      for (const std::uint32_t v : face)
        if (v >= n)
          throw InputError("face " + std::to_string(f) + " names vertex " + std::to_string(v) +
                           ", but there are only " + std::to_string(n));
      if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0])
        throw InputError("face " + std::to_string(f) + " names vertex " +
                         std::to_string(face[0] == face[1] ? face[0] : face[2]) +
                         " twice; repair the mesh first");
    }
  }

  SurfaceTopology survey() {
    std::size_t edges = 0;
    const std::vector<HalfEdge> half = sorted_half_edges(mesh_);
    next_.assign(mesh_.positions.size(), kNone);
    for (std::size_t i = 0, last; i < half.size(); i = last) {
      for (last = i + 1; last < half.size() && half[last].edge == half[i].edge;) ++last;
      ++edges;
      for (std::size_t k = i + 1; k < last; ++k) pieces_.unite(half[i].face, half[k].face);
      if (last - i == 1) {
        add_border(half[i]);
      } else if (last - i > 2 || half[i].forward == half[i + 1].forward) {
        ++out_.irregular_edges;
      }
    }
    std::vector<std::uint8_t> used(mesh_.positions.size(), 0);
    for (const auto& face : mesh_.faces)
      for (const std::uint32_t v : face) used[v] = 1;
    const auto vertices = static_cast<std::size_t>(std::count(used.begin(), used.end(), 1));
    out_.unused_vertices = used.size() - vertices;
    out_.euler = static_cast<std::int64_t>(vertices) - static_cast<std::int64_t>(edges) +
                 static_cast<std::int64_t>(mesh_.faces.size());
    for (std::uint32_t f = 0; f < mesh_.faces.size(); ++f) out_.components += pieces_.find(f) == f;
    trace_loops();
    return std::move(out_);
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffU;

  void add_border(const HalfEdge& e) {
    const auto low = static_cast<std::uint32_t>(e.edge >> 32), high = static_cast<std::uint32_t>(e.edge);
    const std::uint32_t from = e.forward ? low : high, to = e.forward ? high : low;
    if (next_[from] != kNone) {
      ++out_.irregular_vertices;
      return;
    }
    next_[from] = to;
  }

  void trace_loops() {
    for (std::uint32_t v = 0; v < next_.size(); ++v) {
      if (next_[v] == kNone) continue;
      std::vector<std::uint32_t> loop;
      for (std::uint32_t at = v; next_[at] != kNone;) {
        loop.push_back(at);
        const std::uint32_t to = next_[at];
        next_[at] = kNone;
        at = to;
      }
      out_.loops.push_back(std::move(loop));
    }
  }

  const TriangleSpan& mesh_;
  UnionFind pieces_;
  std::vector<std::uint32_t> next_;  ///< along the border, per vertex
  SurfaceTopology out_;
};

}  // namespace

std::string SurfaceTopology::describe() const {
  std::string text = "Euler characteristic " + std::to_string(euler) + ", " +
                     counted(loops.size(), "border", "borders") + ", " +
                     counted(components, "piece", "pieces");
  if (irregular_edges > 0)
    text += ", " + counted(irregular_edges, "edge", "edges") +
            " with more than two faces or faces of opposite sides";
  if (irregular_vertices > 0)
    text += ", " + counted(irregular_vertices, "vertex", "vertices") + " where borders meet";
  return text;
}

SurfaceTopology surface_topology(const TriangleSpan& mesh) {
  return Surveyor(mesh).survey();
}

}  // namespace tessera
