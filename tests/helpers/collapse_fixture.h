/// \file collapse_fixture.h
/// A small collapse mesh whose vertices are named as in its block, and the star of one of them.
#pragma once
#include <catch2/catch.hpp>

#include <utility>
#include <vector>

#include "kernels/decimate/collapse_mesh.h"
#include "tests/helpers/block_meshes.h"

namespace tessera::test {

struct CollapseFixture {
  CollapseFixture(const std::vector<Double3>& position,
                  const std::vector<std::array<std::uint32_t, 3>>& faces)
      : CollapseFixture(make_block(position, faces)) {}
  explicit CollapseFixture(MeshBlock from)
      : block(std::move(from)), mesh(block, Double3{}), vertex(mesh.vertices()) {
    for (std::uint32_t v = 0; v < mesh.vertices(); ++v) vertex[mesh.block_vertex(v)] = v;
  }
  /// The star of u; returns where v is in its ring.
  std::size_t gather(std::uint32_t u, std::uint32_t v) {
    REQUIRE(mesh.gather(vertex[u], star));
    std::size_t at = 0;
    while (at < star.ring_size() && star.ring[at] != vertex[v]) ++at;
    REQUIRE(at < star.ring_size());
    return at;
  }
  Double3& at(std::uint32_t v) { return mesh.node(vertex[v]).at; }
  /// All edges between two vertices that pass become creases.
  template <class Pass>
  void mark_creases(const Pass& pass) {
    for (std::uint32_t c = 0; c < 4 * mesh.faces().size(); ++c)
      if ((c & 3u) != 3u && pass(mesh.at(mesh.vertex(next_corner(c)))) &&
          pass(mesh.at(mesh.vertex(prev_corner(c)))))
        mesh.mark_crease(c);
    for (const std::uint32_t v : vertex)
      if (pass(mesh.at(v))) mesh.add_state(v, kVertexCrease);
  }
  MeshBlock block;
  CollapseMesh mesh;
  std::vector<std::uint32_t> vertex;
  Star star;
};

/// 4 x 4 unit squares: vertex 5 j + i at (i, j, 0), that in the middle, 12, at (2, 2, raised).
inline CollapseFixture sheet(double raised = 0.0) {
  return CollapseFixture(
      grid_block(4, 4, [&](double x, double y) { return x == 2.0 && y == 2.0 ? raised : 0.0; }));
}

}  // namespace tessera::test
