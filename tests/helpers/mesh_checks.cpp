#include "tests/helpers/mesh_checks.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "octree/vector.h"

namespace tessera::test {
namespace {

/// Not the product's, which it is there to check.
class UnionFind {
 public:
  explicit UnionFind(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void unite(std::uint32_t a, std::uint32_t b) { parent_[find(a)] = find(b); }
  std::size_t roots() {
    std::size_t n = 0;
    for (std::uint32_t i = 0; i < parent_.size(); ++i) n += find(i) == i;
    return n;
  }

 private:
  std::vector<std::uint32_t> parent_;
};

struct EdgeUse {
  std::uint32_t low, high;
  std::uint32_t corner;  ///< 3 face + i: the edge from corner i to i + 1
  bool forward;
  bool same_edge(const EdgeUse& o) const { return low == o.low && high == o.high; }
};

std::uint32_t next_corner(std::uint32_t c) {
  return c % 3 == 2 ? c - 2 : c + 1;
}

}  // namespace

IndexedMesh weld(const std::vector<Patch>& patches) {
  IndexedMesh mesh;
  std::map<VertexKey, std::uint32_t> by_key;
  std::vector<std::uint32_t> first;
  bool any_colour = false;
  for (const Patch& p : patches) any_colour |= !p.rgba.empty();
  for (const Patch& p : patches) {
    const auto base = static_cast<std::uint32_t>(mesh.position.size());
    first.push_back(base);
    for (std::size_t v = 0; v < p.position.size(); ++v) {
      Double3 x;
      for (std::size_t a = 0; a < 3; ++a)
        x[a] = static_cast<double>(p.brick[a]) * kBrickCells + static_cast<double>(p.position[v][a]);
      mesh.position.push_back(x);
      mesh.vertex_class.push_back(p.vertex_class[v]);
      if (any_colour) mesh.rgba.push_back(p.rgba.empty() ? 0 : p.rgba[v]);
    }
    for (const auto& [key, index] : p.exported) by_key[key] = base + index;
  }
  for (std::size_t n = 0; n < patches.size(); ++n) {
    const Patch& p = patches[n];
    constexpr std::uint32_t kMissing = 0xffffffffu;
    std::vector<std::uint32_t> foreign;
    for (const VertexKey key : p.foreign) {
      const auto found = by_key.find(key);
      mesh.unresolved += found == by_key.end();
      foreign.push_back(found == by_key.end() ? kMissing : found->second);
    }
    for (const PatchFace& f : p.faces) {
      std::array<std::uint32_t, 3> g;
      for (std::size_t i = 0; i < 3; ++i)
        g[i] = f[i] < p.position.size() ? first[n] + f[i] : foreign.at(f[i] - p.position.size());
      if (g[0] != kMissing && g[1] != kMissing && g[2] != kMissing) mesh.faces.push_back(g);
    }
  }
  return mesh;
}

MeshChecks check_mesh(const IndexedMesh& mesh) {
  MeshChecks out;
  const std::size_t faces = mesh.faces.size();
  const std::size_t vertices = mesh.position.size();
  std::vector<EdgeUse> uses;
  std::vector<std::array<std::uint32_t, 3>> sorted;
  std::vector<std::uint8_t> used(vertices, 0);
  for (std::uint32_t f = 0; f < faces; ++f) {
    const auto& t = mesh.faces[f];
    Double3 p[3];
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      uses.push_back({std::min(a, b), std::max(a, b), 3 * f + static_cast<std::uint32_t>(i), a < b});
      used.at(a) = 1;
      p[i] = mesh.position[a];
    }
    const Double3 n = triangle_normal(p[0], p[1], p[2]);
    out.degenerate_faces += dot(n, n) <= 0.0;
    auto s = t;
    std::sort(s.begin(), s.end());
    sorted.push_back(s);
  }
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 1; i < sorted.size(); ++i) out.duplicate_faces += sorted[i] == sorted[i - 1];
  std::sort(uses.begin(), uses.end(), [](const EdgeUse& a, const EdgeUse& b) {
    return std::tie(a.low, a.high, a.corner) < std::tie(b.low, b.high, b.corner);
  });
  UnionFind surface(vertices), corners(3 * faces), border(vertices);
  std::vector<std::uint8_t> on_border(vertices, 0);
  std::size_t edges = 0;
  for (std::size_t i = 0; i < uses.size();) {
    std::size_t end = i + 1;
    while (end < uses.size() && uses[end].same_edge(uses[i])) ++end;
    ++edges;
    surface.unite(uses[i].low, uses[i].high);
    if (end - i == 1) {
      ++out.boundary_edges;
      border.unite(uses[i].low, uses[i].high);
      on_border[uses[i].low] = on_border[uses[i].high] = 1;
    }
    out.non_manifold_edges += end - i > 2;
    if (end - i == 2) out.misoriented_edges += uses[i].forward == uses[i + 1].forward;
    // Corners of the same vertex at faces that share this edge belong to one fan.
    const auto corner_at = [&](const EdgeUse& e, std::uint32_t vertex) {
      return mesh.faces[e.corner / 3][e.corner % 3] == vertex ? e.corner : next_corner(e.corner);
    };
    for (std::size_t j = i + 1; j < end; ++j) {
      corners.unite(corner_at(uses[i], uses[i].low), corner_at(uses[j], uses[j].low));
      corners.unite(corner_at(uses[i], uses[i].high), corner_at(uses[j], uses[j].high));
    }
    i = end;
  }
  std::vector<std::uint32_t> fans(vertices, 0);
  for (std::uint32_t c = 0; c < 3 * faces; ++c) fans[mesh.faces[c / 3][c % 3]] += corners.find(c) == c;
  for (const std::uint32_t f : fans) out.non_manifold_vertices += f > 1;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    out.unused_vertices += !used[v];
    out.components += used[v] && surface.find(v) == v;
    out.boundary_loops += on_border[v] && border.find(v) == v;
  }
  const std::size_t in_use = vertices - out.unused_vertices;
  out.euler =
      static_cast<std::int64_t>(in_use) - static_cast<std::int64_t>(edges) + static_cast<std::int64_t>(faces);
  out.genus = static_cast<std::int64_t>(out.components) -
              (out.euler + static_cast<std::int64_t>(out.boundary_loops)) / 2;
  return out;
}

std::uint64_t patch_hash(const Patch& patch) {
  std::uint64_t h = 0xcbf29ce484222325ULL;
  const auto add = [&](const void* data, std::size_t bytes) {
    const auto* p = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < bytes; ++i) h = (h ^ p[i]) * 0x100000001b3ULL;
  };
  const auto add_array = [&](const auto& v) {
    const std::size_t n = v.size();
    add(&n, sizeof n);
    add(v.data(), n * sizeof v[0]);
  };
  add(&patch.brick, sizeof patch.brick);
  add_array(patch.position);
  add_array(patch.rgba);
  add_array(patch.vertex_class);
  add_array(patch.faces);
  add_array(patch.foreign);
  for (const auto& [key, index] : patch.exported) {
    add(&key, sizeof key);
    add(&index, sizeof index);
  }
  return h;
}

}  // namespace tessera::test
