#include "kernels/maps/disk_topology.h"

#include <algorithm>

#include "octree/edge_faces.h"
#include "octree/error.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

std::string counted(std::size_t n, const std::string& one, const std::string& many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
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
    next_.assign(mesh_.positions.size(), kNone);
    EdgeFaces(mesh_.positions.size(), mesh_.faces)
        .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
          ++edges;
          for (const std::uint32_t h : half) pieces_.unite(half[0] / 3, h / 3);
          if (half.size() == 1) {
            add_border(half[0]);
          } else if (half.size() > 2 || from(half[0]) == from(half[1])) {
            ++out_.irregular_edges;
          }
        });
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

  std::uint32_t from(std::uint32_t half) const { return mesh_.faces[half / 3][half % 3]; }
  std::uint32_t to(std::uint32_t half) const { return mesh_.faces[half / 3][(half % 3 + 1) % 3]; }

  void add_border(std::uint32_t half) {
    if (next_[from(half)] != kNone) {
      ++out_.irregular_vertices;
      return;
    }
    next_[from(half)] = to(half);
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
