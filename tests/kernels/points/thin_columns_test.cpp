// Wires in scans seen from above: which columns lie below them, and what the surface model makes of it.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <vector>

#include "kernels/points/surface_model.h"
#include "kernels/points/thin_columns.h"

namespace thin_columns_test {

using namespace tessera;

namespace {

constexpr int kEdge = 3 * kBrickCells;  ///< one brick column and its context
constexpr std::int32_t kCell = kQuantaPerCell;

std::int32_t cells(double h) {
  return static_cast<std::int32_t>(std::lround(h * kCell));
}

/// A measured column with its top and bottom at this height.
ColumnLayers column(double height) {
  ColumnLayers c;
  c.top.height = c.bottom.height = cells(height);
  c.top.points = c.bottom.points = 4;
  return c;
}

/// Layers from a function of the column.
template <class Of>
std::vector<ColumnLayers> layers_of(const Of& of) {
  std::vector<ColumnLayers> layers;
  for (int v = 0; v < kEdge; ++v)
    for (int u = 0; u < kEdge; ++u) layers.push_back(of(u, v));
  return layers;
}

bool in_square(int u, int v, int low, int high) {
  return u >= low && v >= low && u < high && v < high;
}

std::uint64_t count_of(const SurfaceModel& model, std::uint8_t flag) {
  std::uint64_t n = 0;
  for (const std::uint8_t f : model.flags) n += (f & flag) != 0;
  return n;
}

/// Ground at 5, and wires over it at 40: lines of columns every so many; in one column of four the ground below was not seen.
std::vector<ColumnLayers> wires(const std::function<bool(int, int)>& hangs, int between = 0) {
  return layers_of([&](int u, int v) {
    ColumnLayers c = column(5.0);
    if (!hangs(u, v)) return c;
    c.top.height = cells(40.0);
    c.between = static_cast<std::uint16_t>(between);
    if ((u + v) % 4 == 0) c.bottom = c.top;
    return c;
  });
}

}  // namespace

TEST_CASE("thin columns: wires are left out and make no roof", "[unit]") {
  const int far = GENERATE(1, 2, 3);
  const bool slanted = GENERATE(false, true);
  CAPTURE(far, slanted);
  const auto hangs = [&](int u, int v) {
    const int across = slanted ? v - u / 2 - 20 : v - 45;
    return across >= 0 && across <= 2 * far && across % far == 0;
  };
  const SurfaceModel model = fit_surface_model(wires(hangs), kEdge);
  std::uint64_t thin = 0, below = 0;
  for (int v = kBrickCells; v < 2 * kBrickCells; ++v)
    for (int u = kBrickCells; u < 2 * kBrickCells; ++u) {
      below += hangs(u, v);
      thin += hangs(u, v) && (model.flags[model.at(u, v)] & kModelThin) != 0;
      CHECK(std::abs(model.height[model.at(u, v)] - cells(5.0)) < kCell);
    }
  CHECK(thin == below);
}

TEST_CASE("thin columns: roofs, crowns and lone bushes are no wires", "[unit]") {
  const auto roof = [](int u, int v) { return in_square(u, v, 40, 56); };
  CHECK(count_of(fit_surface_model(wires(roof), kEdge), kModelThin) == 0);
  const auto line = [](int, int v) { return v >= 45 && v < 48; };
  CHECK(count_of(fit_surface_model(wires(line), kEdge), kModelThin) > 0);
  CHECK(count_of(fit_surface_model(wires(line, 1), kEdge), kModelThin) == 0);  // leaves below the line
  const auto bush = [](int u, int v) { return in_square(u, v, 45, 48); };
  CHECK(count_of(fit_surface_model(wires(bush), kEdge), kModelThin) == 0);
  const auto solid =
      layers_of([&](int u, int v) { return column(line(u, v) ? 40.0 : 5.0); });  // a narrow roof
  CHECK(count_of(fit_surface_model(solid, kEdge), kModelThin) == 0);
}

TEST_CASE("thin columns: the rims of a roof of five columns are none though they show the ground", "[unit]") {
  const auto roof = layers_of([](int u, int v) {
    if (v < 44 || v > 48 || u < 20 || u > 80) return column(5.0);
    ColumnLayers c = column(40.0);
    if (v == 44 || v == 48 || u == 20 || u == 80) c.bottom.height = cells(5.0);
    return c;
  });
  std::vector<std::int32_t> ground;
  std::uint64_t thin = 0;
  for (const std::uint8_t t : find_thin_columns(roof, kEdge, ground)) thin += t;
  CHECK(thin == 0);
  CHECK(find_thin_columns(layers_of([](int, int) { return column(5.0); }), kEdge, ground).empty());
}

}  // namespace thin_columns_test
