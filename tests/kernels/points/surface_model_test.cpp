// The surface model of scenes seen from above: layers of columns, what stands in for strewn points, walls of steps, holes.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "kernels/points/surface_model.h"
#include "kernels/points/terrain.h"
#include "tests/helpers/random.h"

namespace surface_model_test {

using namespace tessera;
using test::Random;

namespace {

constexpr int kEdge = 3 * kBrickCells;  ///< one brick column and its context
constexpr std::int32_t kCell = kQuantaPerCell;

std::int32_t cells(double h) {
  return static_cast<std::int32_t>(std::lround(h * kCell));
}

/// A measured column with its top and bottom at this height.
ColumnLayers column(double height, bool volumetric = false) {
  ColumnLayers c;
  c.top.height = c.bottom.height = cells(height);
  c.top.points = c.bottom.points = 4;
  c.top.volumetric = c.bottom.volumetric = volumetric ? 4 : 0;
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

std::vector<ModelSample> samples_of(const SurfaceModel& model) {
  std::vector<ModelSample> samples;
  sample_surface_model(model, kBrickCells, 2 * kBrickCells,
                       [&](const ModelSample& m) { samples.push_back(m); });
  return samples;
}

bool in_square(int u, int v, int low, int high) {
  return u >= low && v >= low && u < high && v < high;
}

std::uint64_t count_of(const SurfaceModel& model, std::uint8_t flag) {
  std::uint64_t n = 0;
  for (const std::uint8_t f : model.flags) n += (f & flag) != 0;
  return n;
}

}  // namespace

TEST_CASE("column layers: the top is where points lie, not the highest of them", "[unit]") {
  std::vector<ColumnPoint> points;
  const auto add = [&](double height, bool volumetric, std::uint32_t rgba) {
    ColumnPoint p;
    p.column = 5, p.volumetric = volumetric, p.height = cells(height), p.rgba = rgba;
    points.push_back(p);
  };
  for (int i = 0; i < 20; ++i) add(30.0 + 0.1 * i, true, 0xff000000u | 40u);
  for (int i = 0; i < 12; ++i) add(2.0 + 0.05 * i, false, 0xff000000u | 90u);
  add(90.0, false, 0);   // a bird
  add(-40.0, false, 0);  // a multipath echo
  std::vector<ColumnLayers> layers(kBrickCells * kBrickCells);
  find_column_layers(points, layers);
  CHECK(std::abs(layers[5].top.height - cells(31.0)) <= cells(0.1));
  CHECK(layers[5].top.points == 20);
  CHECK(layers[5].top.volumetric == 20);
  CHECK((layers[5].top.rgba & 0xffu) == 40);
  CHECK(std::abs(layers[5].bottom.height - cells(2.3)) <= cells(0.1));
  CHECK(layers[5].bottom.volumetric == 0);
  CHECK(layers[4].top.height == kNoHeight);
}

TEST_CASE("column layers: steep points tell of the wall of a column and the way it faces", "[unit]") {
  std::vector<ColumnPoint> points;
  for (int i = 0; i < 10; ++i) {
    ColumnPoint p;
    p.column = 7, p.height = cells(i), p.steep = true, p.normal_u = -120;
    points.push_back(p);
  }
  std::vector<ColumnLayers> layers(kBrickCells * kBrickCells);
  find_column_layers(points, layers);
  CHECK(layers[7].wall_low == 0);
  CHECK(layers[7].wall_high == cells(9));
  CHECK(layers[7].wall_u == -120);
  // Two points far apart are no wall.
  points.resize(2);
  points[0].height = 0, points[1].height = cells(9);
  layers.assign(kBrickCells * kBrickCells, {});
  find_column_layers(points, layers);
  CHECK(layers[7].wall_low == layers[7].wall_high);
}

TEST_CASE("surface model: plain ground stands for itself", "[unit]") {
  const SurfaceModel model =
      fit_surface_model(layers_of([](int u, int) { return column(10 + 0.3 * u); }), kEdge);
  CHECK(count_of(model, 0xff) == 0);
  CHECK(samples_of(model).empty());
}

TEST_CASE("surface model: a crown becomes one smooth skin with walls down to the ground", "[unit]") {
  Random random(11);
  const auto layers = layers_of([&](int u, int v) {
    if (!in_square(u, v, 80, 112)) return column(5);
    ColumnLayers c = column(25 + random.in(-2.0, 2.0), true);
    c.bottom = column(5).bottom;
    return c;
  });
  const SurfaceModel model = fit_surface_model(layers, kEdge);
  CHECK((model.flags[model.at(96, 96)] & kModelStands) != 0);
  CHECK((model.flags[model.at(60, 96)] & kModelStands) == 0);
  // Smooth: far less rough than what was measured, and where it was.
  double rough = 0.0;
  for (int v = 84; v < 108; ++v)
    for (int u = 84; u < 107; ++u) {
      const std::size_t i = model.at(u, v);
      CHECK(std::abs(model.height[i] - cells(25)) < cells(2));
      rough = std::max(rough, static_cast<double>(std::abs(model.height[i + 1] - model.height[i])) / kCell);
    }
  CHECK(rough < 0.6);
  // The step is kept, and samples a cell apart go down it.
  CHECK(model.height[model.at(76, 96)] == cells(5));
  std::uint64_t steps = 0, level = 0, outward = 0;
  for (const ModelSample& m : samples_of(model)) {
    (m.step ? steps : level) += 1;
    if (m.step && m.u < cells(82) && m.v > cells(85) && m.v < cells(107)) outward += m.normal[0] < -0.9f;
    CHECK(std::fabs(norm(m.normal) - 1.0f) < 1e-5f);
  }
  CHECK(level >= 32 * 32);
  CHECK(steps > 4 * 30 * 15);
  CHECK(outward > 20 * 15);
}

TEST_CASE("surface model: walls that nobody saw have no streaks of the columns above them", "[unit]") {
  // A block whose columns are black and white in turn, over grey ground.
  const bool skin = GENERATE(false, true);
  const auto layers = layers_of([](int u, int v) {
    const bool block = in_square(u, v, 80, 110);
    ColumnLayers c = column(block ? 30 : 2, block);
    c.top.rgba = !block ? 0xff808080u : (u + v) % 2 == 0 ? 0xff000000u : 0xffffffffu;
    c.bottom.rgba = c.top.rgba;
    return c;
  });
  const SurfaceModel model = fit_surface_model(layers, kEdge, skin ? ModelUse::kSkin : ModelUse::kStandIn);
  std::uint64_t edge = 0, wall = 0;
  int darkest = 255, brightest = 0;
  for (const ModelSample& m : samples_of(model)) {
    if (!m.step || !m.unseen || m.height < cells(4)) continue;
    const int shade = static_cast<int>(m.rgba & 0xffu);
    if (m.height > cells(29)) edge += shade < 64 || shade > 192;
    if (m.height > cells(25)) continue;
    ++wall;
    darkest = std::min(darkest, shade), brightest = std::max(brightest, shade);
  }
  CHECK(edge > 50);
  REQUIRE(wall > 1000);
  CHECK(darkest >= 110);
  CHECK(brightest <= 145);
}

TEST_CASE("surface model: no samples where the wall of a step was measured", "[unit]") {
  const bool seen = GENERATE(false, true);
  const auto layers = layers_of([&](int u, int) {
    ColumnLayers c = column(u < 96 ? 5 : 25);
    // The roof hangs two columns over its wall.
    if (seen && u == 98) c.wall_low = cells(5), c.wall_high = cells(24), c.wall_u = -127;
    return c;
  });
  const SurfaceModel model = fit_surface_model(layers, kEdge);
  std::uint64_t steps = 0;
  for (const ModelSample& m : samples_of(model)) steps += m.step;
  CHECK((steps == 0) == seen);
  CHECK((count_of(model, kModelStep) == 0) == seen);
}

TEST_CASE("surface model: a skin goes down every step, and tells the walls that were seen", "[unit]") {
  const bool seen = GENERATE(false, true);
  const auto layers = layers_of([&](int u, int) {
    ColumnLayers c = column(u < 96 ? 5 : 25);
    if (seen && u == 98) c.wall_low = cells(5), c.wall_high = cells(24), c.wall_u = -127;
    return c;
  });
  const SurfaceModel model = fit_surface_model(layers, kEdge, ModelUse::kSkin);
  std::uint64_t steps = 0, unseen = 0;
  for (const ModelSample& m : samples_of(model)) steps += m.step, unseen += m.step && m.unseen;
  CHECK(steps == 40 * kBrickCells);  // two a cell
  CHECK(unseen == (seen ? 0 : steps));
  CHECK((model.flags[model.at(96, 96)] & kModelStands) != 0);
  CHECK(model.flags[model.at(80, 96)] == kModelSkin);
}

TEST_CASE("surface model: a skin has no ground below crowns, and stands where thin things hide it",
          "[unit]") {
  const auto layers = layers_of([](int u, int v) {
    if (in_square(u, v, 110, 114)) return column(7, true);  // too thin to be a crown
    if (!in_square(u, v, 70, 100)) return column(5);
    ColumnLayers c = column(40, true);
    c.bottom = column(5, true).bottom;
    return c;
  });
  const SurfaceModel in_place = fit_surface_model(layers, kEdge),
                     skin = fit_surface_model(layers, kEdge, ModelUse::kSkin);
  CHECK(in_place.ground[in_place.at(85, 85)] != kNoHeight);
  CHECK(skin.ground[skin.at(85, 85)] == kNoHeight);
  CHECK((in_place.flags[in_place.at(112, 112)] & kModelStands) == 0);
  CHECK((skin.flags[skin.at(112, 112)] & kModelStands) != 0);
}

TEST_CASE("surface model: beside a crown the skin goes down to the points of the ground", "[unit]") {
  Random random(12);
  const auto layers = layers_of([&](int u, int v) {
    return in_square(u, v, 80, 112) ? column(8 + random.in(-1.5, 1.5), true) : column(5);
  });
  const SurfaceModel skin = fit_surface_model(layers, kEdge, ModelUse::kSkin);
  std::uint64_t ground = 0;
  for (int v = 66; v < 126; ++v)
    for (int u = 66; u < 126; ++u) {
      const std::size_t i = skin.at(u, v);
      if ((skin.flags[i] & kModelStands) != 0) continue;
      ++ground;
      REQUIRE(skin.height[i] == cells(5));
    }
  CHECK(ground > 1500);
}

TEST_CASE("surface model: the skin reaches farther where it is steep, by half a step at most", "[unit]") {
  const double slope = GENERATE(0.0, 2.0, 9.0);
  const SurfaceModel skin =
      fit_surface_model(layers_of([&](int u, int) { return column(slope * u); }), kEdge, ModelUse::kSkin);
  CHECK(skin.reach(skin.at(96, 96)) == cells(2 + std::min(slope, 3.0) / 2));
}

TEST_CASE("surface model: holes up to twenty columns wide are filled from their low side, wider ones are not",
          "[unit]") {
  const auto layers = layers_of([&](int u, int v) {
    if (in_square(u, v, 70, 86) || in_square(u, v, 100, 126)) return ColumnLayers{};
    return column(u < 70 ? 25 : 5);  // what lies behind a building
  });
  const SurfaceModel model = fit_surface_model(layers, kEdge);
  CHECK(model.height[model.at(113, 113)] == kNoHeight);
  for (int v = 72; v < 84; ++v)
    for (int u = 72; u < 84; ++u) {
      const std::size_t i = model.at(u, v);
      CHECK((model.flags[i] & kModelFilled) != 0);
      CHECK(model.height[i] < cells(13));
    }
}

TEST_CASE("surface model: wires and poles do not make roofs", "[unit]") {
  const auto layers = layers_of([](int u, int v) {
    const bool wire = v == 90 || v == 102, pole = in_square(u, v, 120, 123);
    return wire || pole ? column(40, true) : column(5);
  });
  CHECK(count_of(fit_surface_model(layers, kEdge), kModelFilled) == 0);
  const SurfaceModel model = fit_surface_model(layers, kEdge);
  for (int u = 70; u < 118; ++u) CHECK(model.height[model.at(u, 96)] == cells(5));
}

TEST_CASE("surface model: smooth bottoms under crowns are ground, ragged ones are not", "[unit]") {
  Random random(3);
  const bool smooth = GENERATE(false, true);
  const auto layers = layers_of([&](int u, int v) {
    if (!in_square(u, v, 70, 120)) return column(5);
    ColumnLayers c = column(40 + random.in(-1.0, 1.0), true);
    c.bottom = column(smooth ? 5 + 0.05 * u : 5 + random.in(0.0, 20.0), true).bottom;
    return c;
  });
  const SurfaceModel model = fit_surface_model(layers, kEdge);
  std::uint64_t ground = 0;
  for (const std::int32_t h : model.ground) ground += h != kNoHeight;
  if (smooth) {
    CHECK(ground > 35 * 35);
    CHECK(std::abs(model.ground[model.at(95, 95)] - cells(5 + 0.05 * 95)) < cells(0.2));
  } else {
    CHECK(ground < 50);
  }
}

TEST_CASE("surface model: ground keeps its pits, and synthetic columns are samples that nobody saw",
          "[unit]") {
  const auto layers = layers_of([&](int u, int v) {
    // A ditch below crowns, and a part of a slope on which something stood.
    ColumnLayers c = column(u >= 78 && u < 84 ? 4.0 : 10.0, in_square(u, v, 70, 90));
    if (in_square(u, v, 100, 110)) c = column(10.0 + 0.8 * (u - 100)), c.synthetic = true;
    return c;
  });
  const SurfaceModel model = fit_surface_model(layers, kEdge, ModelUse::kGround);
  CHECK(model.height[model.at(80, 82)] < cells(6));
  CHECK(fit_surface_model(layers, kEdge, ModelUse::kSkin).height[model.at(80, 82)] > cells(9));
  CHECK(count_of(model, kModelFilled) == 100);
  CHECK((model.flags[model.at(75, 75)] & (kModelStands | kModelFilled)) == kModelStands);
  for (const ModelSample& m : samples_of(model)) {
    const int u = m.u / kCell, v = m.v / kCell;
    if (in_square(u, v, 101, 109)) CHECK(m.unseen);
    if (in_square(u, v, 70, 90) && !m.step) CHECK_FALSE(m.unseen);
  }
}

TEST_CASE("surface model: below what was cleared the ground goes on, and roofs stay", "[unit]") {
  const std::vector<ColumnLayers> layers = layers_of([](int u, int v) {
    ColumnLayers c = column(3 + 0.01 * u);
    if (in_square(u, v, 70, 90)) c.cleared = true, c.synthetic = u >= 80;
    if (in_square(u, v, 100, 110)) c.top = column(20).top;
    return c;
  });
  const SurfaceModel model = fit_surface_model(layers, kEdge, ModelUse::kCleared);
  for (const int u : {72, 85, 88}) {
    const std::size_t i = model.at(u, 80);
    CHECK((model.flags[i] & kModelCleared) != 0);
    CHECK((model.flags[i] & kModelSkin) == 0);
    CHECK(((model.flags[i] & kModelStands) != 0) == (u >= 80));
    CHECK(std::abs(model.height[i] - cells(3 + 0.01 * u)) < kCell / 4);
  }
  CHECK((model.flags[model.at(60, 80)] & (kModelCleared | kModelStands)) == 0);
  CHECK(std::abs(model.height[model.at(105, 105)] - cells(20)) < kCell / 4);
  std::size_t unseen = 0;
  for (const ModelSample& m : samples_of(model))
    unseen += m.unseen && !m.step && in_square(m.u / kCell, m.v / kCell, 81, 89);
  CHECK(unseen == 8 * 8);
}

TEST_CASE("surface model: a column depends on nothing beyond the halo", "[property]") {
  // The same scene in a raster and in one shifted by a brick: equal where both know their surroundings.
  const ModelUse use = GENERATE(ModelUse::kStandIn, ModelUse::kSkin, ModelUse::kGround, ModelUse::kCleared);
  const bool on_terrain = use == ModelUse::kGround || use == ModelUse::kCleared;
  const auto height = [on_terrain](int u, int v) {
    const std::uint32_t mixed =
        (static_cast<std::uint32_t>(u) * 2654435761u) ^ (static_cast<std::uint32_t>(v) * 40503u);
    const std::uint32_t r = (mixed ^ mixed >> 13) * 2246822519u >> 16;
    if (r % 41 == 0) return ColumnLayers{};
    const bool crown = (u / 23 + v / 17) % 3 == 0;
    ColumnLayers c = column((crown ? 30 : 3) + (r % 100) * (crown ? 0.05 : 0.002), crown && r % 5 != 0);
    c.top.rgba = c.bottom.rgba = 0xff000000u | (r * 2654435761u & 0xffffffu);
    c.bottom = column(3 + (r % 7) * 0.01, crown).bottom;
    c.synthetic = u / 31 % 4 == 0 && on_terrain;
    if (on_terrain) c.terrain = c.bottom.height;
    return c;
  };
  constexpr int kWide = 4 * kBrickCells;
  std::vector<ColumnLayers> wide;
  for (int v = 0; v < kWide; ++v)
    for (int u = 0; u < kWide; ++u) wide.push_back(height(u, v));
  std::vector<ColumnLayers> narrow =
      layers_of([&](int u, int v) { return height(u + kBrickCells, v + kBrickCells); });
  if (on_terrain) follow_measured(wide, kWide), follow_measured(narrow, kEdge);
  const SurfaceModel all = fit_surface_model(wide, kWide, use);
  const SurfaceModel part = fit_surface_model(narrow, kEdge, use);
  std::uint64_t stands = 0;
  for (int v = kBrickCells; v < 2 * kBrickCells; ++v)
    for (int u = kBrickCells; u < 2 * kBrickCells; ++u) {
      const std::size_t a = all.at(u + kBrickCells, v + kBrickCells), b = part.at(u, v);
      REQUIRE(all.height[a] == part.height[b]);
      REQUIRE(all.flags[a] == part.flags[b]);
      REQUIRE(all.foot[a] == part.foot[b]);
      REQUIRE(all.noise[a] == part.noise[b]);
      REQUIRE(all.ground[a] == part.ground[b]);
      REQUIRE(all.reach(a) == part.reach(b));
      stands += (part.flags[b] & kModelStands) != 0;
    }
  CHECK(stands > 500);
  // Their colours too.
  const auto sampled = [](const SurfaceModel& model, int first) {
    std::vector<std::array<std::int64_t, 4>> samples;
    sample_surface_model(model, first, first + kBrickCells, [&](const ModelSample& m) {
      samples.push_back({m.u - first * kCell, m.v - first * kCell, m.height, m.rgba});
    });
    std::sort(samples.begin(), samples.end());
    return samples;
  };
  const bool same = sampled(all, 2 * kBrickCells) == sampled(part, kBrickCells);
  CHECK(same);
}

TEST_CASE("column layers: what lies between the top and the bottom is counted", "[unit]") {
  std::vector<ColumnPoint> points;
  for (const double height : {40.0, 39.8, 20.0, 15.0, 5.2, 5.0}) {
    ColumnPoint p;
    p.column = 3, p.height = cells(height);
    points.push_back(p);
  }
  std::vector<ColumnLayers> layers(std::size_t{kBrickCells} * kBrickCells);
  find_column_layers(points, layers);
  CHECK(layers[3].between == 2);
  points.erase(points.begin() + 2, points.begin() + 4);
  find_column_layers(points, layers);
  CHECK(layers[3].between == 0);
}

}  // namespace surface_model_test
