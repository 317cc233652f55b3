#include "kernels/patch_components.h"

#include <numeric>
#include <utility>

namespace tessera {
namespace {

std::uint32_t find_root(std::vector<std::uint32_t>& parent, std::uint32_t v) {
  while (parent[v] != v) {
    parent[v] = parent[parent[v]];
    v = parent[v];
  }
  return v;
}

/// The smaller index becomes the root, so numbering never depends on the order of unions.
void unite(std::vector<std::uint32_t>& parent, std::uint32_t a, std::uint32_t b) {
  a = find_root(parent, a);
  b = find_root(parent, b);
  if (a > b) std::swap(a, b);
  parent[b] = a;
}

}  // namespace

PatchComponents find_components(const Patch& patch) {
  const std::size_t own = patch.position.size();
  const std::size_t all = own + patch.foreign.size();
  std::vector<std::uint32_t> parent(all);
  std::iota(parent.begin(), parent.end(), 0u);
  for (const PatchFace& f : patch.faces) {
    unite(parent, f[0], f[1]);
    unite(parent, f[1], f[2]);
  }
  PatchComponents out;
  out.of_vertex.resize(all);
  for (std::uint32_t v = 0; v < all; ++v) {
    const std::uint32_t root = find_root(parent, v);
    out.of_vertex[v] = root == v ? out.count++ : out.of_vertex[root];
  }
  out.vertices.assign(out.count, 0);
  out.faces.assign(out.count, 0);
  for (std::size_t v = 0; v < own; ++v) ++out.vertices[out.of_vertex[v]];
  for (const PatchFace& f : patch.faces) ++out.faces[out.of_vertex[f[0]]];
  return out;
}

}  // namespace tessera
