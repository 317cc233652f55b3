#include "kernels/decimate/reference_mesh.h"

#include <catch2/catch.hpp>

#include "tests/helpers/block_meshes.h"

namespace tessera::reference_mesh_test {
namespace {

using test::grid_block;

/// Squares in a plane; the line y = 1 is a crease that steps aside by `step` at x = 1.
struct Creased {
  explicit Creased(double step)
      : mesh(grid_block(3, 2, [&](double x, double y) { return x == 1.0 && y == 1.0 ? step : 0.0; }),
             Double3{}) {
    for (std::uint32_t c = 0; c < 4 * mesh.faces().size(); ++c) {
      if ((c & 3u) == 3u) continue;
      const Double3 &a = mesh.at(mesh.vertex(next_corner(c))), &b = mesh.at(mesh.vertex(prev_corner(c)));
      if (a[1] == 1.0 && b[1] == 1.0) mesh.mark_crease(c);
    }
    reference = ReferenceMesh(mesh, true);
  }
  std::uint32_t at(double x, double y) const {
    for (std::uint32_t v = 0; v < mesh.vertices(); ++v)
      if (mesh.at(v)[0] == x && mesh.at(v)[1] == y) return v;
    FAIL("no vertex there");
    return 0;
  }
  CollapseMesh mesh;
  ReferenceMesh reference;
};

}  // namespace

TEST_CASE("reference mesh: a line deviates by its farthest vertex, and must lead to both ends", "[unit]") {
  const Creased c(0.25);
  double deviation = 0.0;
  REQUIRE(line_deviation(c.reference, c.at(1, 1), c.at(0, 1), c.at(2, 1), 0.3, deviation));
  CHECK(deviation == Approx(0.25));
  CHECK(line_deviation(c.reference, c.at(2, 1), c.at(1, 1), c.at(3, 1), 0.3, deviation));
  CHECK_FALSE(line_deviation(c.reference, c.at(1, 1), c.at(0, 1), c.at(2, 1), 0.2, deviation));
  CHECK_FALSE(line_deviation(c.reference, c.at(1, 1), c.at(2, 1), c.at(2, 0), 9.0, deviation));
}

TEST_CASE("reference mesh: a fan is closed inside and begins behind its line", "[unit]") {
  const Creased c(0.0);
  const std::uint32_t inside = c.at(1, 1), border = c.at(1, 0);
  std::vector<std::uint32_t> fan;
  const std::uint32_t start = corner_behind_line(c.reference, inside);
  REQUIRE(start != kNoCorner);
  CHECK(c.reference.is_line(prev_corner(start)));
  CHECK(gather_fan(c.reference, start, fan));
  CHECK(fan.size() == 6);
  for (const std::uint32_t k : fan) CHECK(c.reference.vertex(k) == inside);
  CHECK_FALSE(gather_fan(c.reference, c.reference.corner[border], fan));
  CHECK(fan.size() == 3);
  const ReferenceMesh smooth(CollapseMesh(grid_block(2, 2, [](double, double) { return 0.0; }), Double3{}));
  for (std::uint32_t v = 0; v < 9; ++v)
    if (smooth.vertices[v].at == Double3{1, 1, 0}) CHECK(corner_behind_line(smooth, v) == kNoCorner);
}

TEST_CASE("reference mesh: a face's bound is kept beside its lines, never lessened", "[unit]") {
  MeshBlock block = grid_block(2, 2, [](double, double) { return 0.0; });
  block.face_bound.assign(block.faces.size(), 0.1f);
  block.face_bound[0] = 0.0f;
  const CollapseMesh mesh(block, Double3{});
  const ReferenceMesh reference(mesh, true);
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    const float bound = mesh.face(f).bound, kept = reference.faces[f].bound();
    CHECK(kept >= bound);
    CHECK(kept <= bound * 1.0001f);
    for (std::uint32_t c = 4 * f; c < 4 * f + 3; ++c) CHECK(reference.is_line(c) == mesh.border_edge(c));
  }
  CHECK(reference.max_height[0] == Approx(std::sqrt(0.5)));
}

}  // namespace tessera::reference_mesh_test
