// Where a level of displacement volumes begins: positions of free vertices, shares of displacements. What its sweeps do is held by
// displacement_volumes_test.cpp.
#include "kernels/edit/layer_relaxation.h"

#include <catch2/catch.hpp>

namespace layer_relaxation_test {

namespace {

using namespace tessera;

/// A square of four triangles around a free vertex in its middle, its layer above it.
struct Tent {
  std::vector<Double3> base = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {1, 1, 0}};
  std::vector<Double3> layer = {{0, 0, 1}, {2, 0, 1}, {2, 2, 1}, {0, 2, 1}, {1, 1, 1.5}};
  std::vector<std::array<std::uint32_t, 3>> faces = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  std::vector<std::uint8_t> free = {0, 0, 0, 0, 1};
  std::vector<Rotation> rotation = std::vector<Rotation>(5, Rotation{1, 0, 0, 0, 1, 0, 0, 0, 1});
  LayerRelaxation relaxation{{base, layer}, {base, layer}, faces, free, rotation, {}};
};

}  // namespace

TEST_CASE("layer relaxation: set() takes positions of free vertices and leaves the others", "[unit]") {
  Tent tent;
  CHECK(tent.relaxation.prisms() == 4);
  CHECK(tent.relaxation.surface() == tent.layer);
  const std::vector<Double3> elsewhere(5, Double3{1.25, 0.5, 3});
  tent.relaxation.set(elsewhere);
  const std::vector<Double3> now = tent.relaxation.surface();
  CHECK(now[4] == elsewhere[4]);
  for (std::size_t v = 0; v < 4; ++v) CHECK(now[v] == tent.layer[v]);
}

TEST_CASE("layer relaxation: scale() multiplies what is free and takes shares of what the others were given",
          "[unit]") {
  Tent tent;
  tent.relaxation.scale(0.5, 0.25);
  tent.relaxation.scale(3.0, 0.5);  // of what is there; of what was given
  const std::vector<Double3> now = tent.relaxation.surface();
  CHECK(now[4] == Double3{1, 1, 1.5 * 0.5 * 3.0});
  for (std::size_t v = 0; v < 4; ++v) CHECK(now[v] == Double3{tent.base[v][0], tent.base[v][1], 0.5});
}

}  // namespace layer_relaxation_test
