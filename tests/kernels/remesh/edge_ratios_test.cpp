#include "kernels/remesh/edge_ratios.h"

#include <catch2/catch.hpp>

#include <algorithm>

#include "tests/helpers/block_meshes.h"

namespace edge_ratios_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr double kAimed = 1.05;  ///< so that many edges of a rough sheet cost something

MeshBlock rough_sheet() {
  MeshBlock sheet = grid_block(9, 8, [](double, double) { return 0.0; });
  add_noise(sheet, 0.2, 4);
  return sheet;
}

EdgeRatios ratios_of(const CollapseMesh& mesh) {
  return {mesh, std::vector<std::uint8_t>(mesh.vertices(), 1), kAimed};
}

/// The cost of all edges, from nothing but the mesh.
double cost_of(const CollapseMesh& mesh) {
  const EdgeRatios ratios = ratios_of(mesh);
  double sum = 0.0;
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    if (mesh.face(f).state & kStateDead) continue;
    for (std::uint32_t c = 4 * f; c < 4 * f + 3; ++c) {
      if (mesh.opposite(c) != kNoCorner && mesh.opposite(c) < c) continue;
      const double over = ratios.ratio(mesh.vertex(next_corner(c)), mesh.vertex(prev_corner(c))) - kAimed;
      if (over > 0.0) sum += over * over;
    }
  }
  return sum;
}

/// A corner across from an edge that has two faces, far from the border.
std::uint32_t inner_corner(const CollapseMesh& mesh) {
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f)
    for (std::uint32_t c = 4 * f; c < 4 * f + 3; ++c) {
      const std::uint32_t o = mesh.opposite(c);
      if (o == kNoCorner) continue;
      const std::uint32_t around[4] = {mesh.vertex(c), mesh.vertex(o), mesh.vertex(next_corner(c)),
                                       mesh.vertex(prev_corner(c))};
      if (std::none_of(around, around + 4,
                       [&](std::uint32_t v) { return (mesh.state(v) & kVertexBorder) != 0; }))
        return c;
    }
  return kNoCorner;
}

std::uint32_t border_corner(const CollapseMesh& mesh) {
  for (std::uint32_t c = 0; c < 4 * mesh.faces().size(); ++c)
    if ((c & 3u) != 3u && mesh.border_edge(c)) return c;
  return kNoCorner;
}

}  // namespace

TEST_CASE("edge ratios: what an edit is said to add is what it adds to the cost of all edges", "[unit]") {
  const MeshBlock sheet = rough_sheet();
  const auto check = [&](const auto& ask, const auto& edit) {
    CollapseMesh mesh(sheet, Double3{});
    mesh.reserve(2 * sheet.faces.size());
    EdgeRatios ratios = ratios_of(mesh);
    const double before = cost_of(mesh), adds = ask(mesh, ratios);
    REQUIRE(before > 0.1);
    edit(mesh);
    CHECK(adds != 0.0);
    CHECK(adds == Approx(cost_of(mesh) - before).margin(1e-12));
  };
  SECTION("flip") {
    check([](auto& mesh, auto& ratios) { return ratios.flip_adds(inner_corner(mesh)); },
          [](auto& mesh) { mesh.flip(inner_corner(mesh)); });
  }
  SECTION("splits inside and of the border") {
    for (const auto& corner : {inner_corner, border_corner}) {
      const auto middle = [&](const CollapseMesh& mesh) {
        const std::uint32_t c = corner(mesh);
        return (mesh.at(mesh.vertex(next_corner(c))) + mesh.at(mesh.vertex(prev_corner(c)))) * 0.5;
      };
      check([&](auto& mesh, auto& ratios) { return ratios.split_adds(corner(mesh), middle(mesh)); },
            [&](auto& mesh) { mesh.split(corner(mesh), middle(mesh)); });
    }
  }
  SECTION("collapses inside and along the border") {
    const bool inside = GENERATE(true, false);
    const auto gathered = [&](const CollapseMesh& mesh) {
      Star star;
      const std::uint32_t c = inside ? inner_corner(mesh) : border_corner(mesh);
      REQUIRE(mesh.gather(mesh.vertex(next_corner(c)), star));
      return star;
    };
    check([&](auto& mesh, auto& ratios) { return ratios.collapse_adds(gathered(mesh), 0); },
          [&](auto& mesh) { mesh.collapse(gathered(mesh), 0); });
  }
  SECTION("move") {
    const Double3 by = {0.17, -0.11, 0.05};
    const auto vertex = [](const CollapseMesh& mesh) { return mesh.vertex(inner_corner(mesh)); };
    check(
        [&](auto& mesh, auto& ratios) {
          Star star;
          REQUIRE(mesh.gather(vertex(mesh), star));
          const double old = ratios.open_star(vertex(mesh), star);
          return ratios.move_costs(mesh.at(vertex(mesh)) + by) - old;
        },
        [&](auto& mesh) { mesh.node(vertex(mesh)).at = mesh.at(vertex(mesh)) + by; });
  }
}

TEST_CASE("edge ratios: vertices renewed behind an edit are as if all were made anew", "[unit]") {
  CollapseMesh mesh(rough_sheet(), Double3{});
  mesh.reserve(400);
  EdgeRatios ratios = ratios_of(mesh);
  const std::uint32_t c = inner_corner(mesh), m = mesh.split(c, {4.1, 4.2, 0.0});
  ratios.renew(m);
  mesh.for_each_neighbour(m, [&](std::uint32_t w) { ratios.renew(w); });
  const EdgeRatios anew = ratios_of(mesh);
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) CHECK(ratios.mean(v) == anew.mean(v));
}

TEST_CASE("edge ratios: what touches an edge that is not known is left to others", "[unit]") {
  CollapseMesh mesh(rough_sheet(), Double3{});
  const std::uint32_t c = inner_corner(mesh);
  std::vector<std::uint8_t> whole(mesh.vertices(), 1);
  whole[mesh.vertex(c)] = 0;
  EdgeRatios ratios(mesh, whole, kAimed);
  CHECK(ratios.ratio(mesh.vertex(c), mesh.vertex(next_corner(c))) == 0.0);
  CHECK(ratios.flip_adds(c) == EdgeRatios::kNoRatio);
  CHECK(ratios.flip_adds(next_corner(c)) == EdgeRatios::kNoRatio);
  CHECK(ratios.split_adds(c, {4.0, 4.0, 0.0}) == EdgeRatios::kNoRatio);
  Star star;
  REQUIRE(mesh.gather(mesh.vertex(next_corner(c)), star));
  CHECK(ratios.collapse_adds(star, 0) == EdgeRatios::kNoRatio);
  CHECK(ratios.open_star(mesh.vertex(next_corner(c)), star) == EdgeRatios::kNoRatio);
}

}  // namespace edge_ratios_test
