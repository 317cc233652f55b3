#include "kernels/scene/scene.h"

#include <algorithm>
#include <array>

#include "kernels/scene/scene_models.h"
#include "kernels/scene/scene_smooth.h"
#include "kernels/scene/scene_solid.h"
#include "octree/error.h"

namespace tessera::synth {
namespace {

constexpr std::array kScenes = {
    SceneName{"city", "buildings, streets and trees on rolling ground, 600 x 600, z up, open"},
    SceneName{"csg", "block with a cylinder standing out of it and a bore: convex and concave creases"},
    SceneName{"cube", "edge 2: straight creases and corners"},
    SceneName{"fandisk", "planes and cylinders, sharp and tangent joints, oblique cut"},
    SceneName{"indoor", "furnished room, 8 x 6 x 3, seen from inside"},
    SceneName{"parts", "machine parts with blends, bores and teeth on a table, 5 x 4"},
    SceneName{"sphere", "radius 1"},
    SceneName{"statue", "seated bear with a rough skin on a pedestal, 2.6 high"},
    SceneName{"terrain", "fractal hills, 1000 x 1000, z up, open"},
    SceneName{"torus", "radii 1 and 0.4"},
};

}  // namespace

std::span<const SceneName> scene_names() {
  return kScenes;
}

std::uint32_t Scene::colour(const SurfacePoint& p) const {
  // Painted plaster: hue by the direction of the surface, so that creases show in a coloured point cloud.
  const auto channel = [](double n) {
    return static_cast<std::uint32_t>(176.0 + 48.0 * std::clamp(n, -1.0, 1.0));
  };
  return channel(p.normal[0]) | channel(p.normal[1]) << 8 | channel(p.normal[2]) << 16 | 0xff000000u;
}

std::unique_ptr<Scene> make_scene(const SceneOptions& options) {
  const std::string& name = options.name;
  if (name == "sphere") return make_sphere();
  if (name == "torus") return make_torus();
  if (name == "cube") return make_cube();
  if (name == "csg") return make_csg();
  if (name == "fandisk") return make_fandisk();
  if (name == "city") return make_city();
  if (name == "indoor") return make_indoor();
  if (name == "parts") return make_parts();
  if (name == "statue") return make_statue();
  if (name == "terrain") return make_terrain(terrain_relief(options.octaves, options.spacing));
  std::string known;
  for (const auto& scene : kScenes) known += (known.empty() ? "" : ", ") + std::string(scene.name);
  throw UsageError("scene '" + name + "' is unknown: choose one of " + known);
}

}  // namespace tessera::synth
