/// \file scene.h
/// Scenes whose surface is known exactly: what a simulated scanner looks at, and what a mesh is measured
/// against. A scene is a pure function of its name and options: the same bits on every machine.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "octree/portable_math.h"

namespace tessera::synth {

struct Box3 {
  Double3 lo{}, hi{};
};

/// A point of the truth surface and the outward (solid) or upward (terrain) unit normal there.
struct SurfacePoint {
  Double3 position{};
  Double3 normal{};
};

struct Ray {
  Double3 origin{};
  Double3 direction{};  ///< unit
};

struct RayHit {
  double range = 0.0;  ///< along the ray, > 0
  SurfacePoint point;
};

/// Batch of surface points, structure of arrays.
struct SurfaceBatch {
  std::vector<double> x, y, z;
  std::vector<double> nx, ny, nz;
  void resize(std::size_t n);
  void push_back(const SurfacePoint& p);
  [[nodiscard]] std::size_t size() const { return x.size(); }
};

/// A piece of the surface over the unit square, for direct sampling. Positions are exact; the area density
/// only decides how many samples go where.
class SurfacePatch {
 public:
  virtual ~SurfacePatch() = default;
  /// Typical lengths of the patch along u and v, scene units: they choose the sampling grid.
  [[nodiscard]] virtual double length_u() const = 0;
  [[nodiscard]] virtual double length_v() const = 0;
  /// Surface area per unit of du dv.
  [[nodiscard]] virtual double density(double u, double v) const = 0;
  /// Exact points and normals at u[i], v[i] in [0, 1]; `out` is resized.
  virtual void evaluate(std::span<const double> u, std::span<const double> v, SurfaceBatch& out) const = 0;
  /// Whether (u, v) belongs to the patch; trimmed() says whether asking is needed at all.
  [[nodiscard]] virtual bool inside(double, double) const { return true; }
  [[nodiscard]] virtual bool trimmed() const { return false; }
};

/// A curve where the surface has a crease, or a corner where creases meet.
struct SharpFeature {
  bool corner = false;
  double distance = 0.0;  ///< from the query to the nearest crease or corner
  Double3 position{};
};

class Scene {
 public:
  virtual ~Scene() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  [[nodiscard]] virtual Box3 bounds() const = 0;  ///< encloses the surface

  /// Nearest point of the surface. Exact (to rounding) for queries nearer to it than its radii of curvature,
  /// for sphere, torus, cube, csg, fandisk everywhere; else a point of the surface, so that the distance is
  /// never understated.
  [[nodiscard]] virtual SurfacePoint closest(const Double3& p) const = 0;
  /// First hit with 0 < range <= limit. \returns false if there is none
  virtual bool intersect(const Ray& ray, double limit, RayHit& hit) const = 0;

  /// Every crossing of a ray up to `limit`, in order, entering or leaving. Only scenes without patches() have
  /// it.
  virtual void crossings(const Ray&, double, std::vector<SurfacePoint>& out) const { out.clear(); }
  /// Pieces for direct sampling; empty for scenes that have no parametrisation.
  [[nodiscard]] virtual std::vector<const SurfacePatch*> patches() const { return {}; }
  /// Nearest point of any crease. \returns false if the scene has none or does not know them
  virtual bool nearest_crease(const Double3&, SharpFeature&) const { return false; }
  /// Nearest corner. \returns false if the scene has none or does not know them
  virtual bool nearest_corner(const Double3&, SharpFeature&) const { return false; }
  /// All corners, and points along all creases at most `step` apart. Empty where not known.
  [[nodiscard]] virtual std::vector<Double3> corners() const { return {}; }
  [[nodiscard]] virtual std::vector<Double3> crease_points(double) const { return {}; }
  /// Whether a point of the surface lies where the surface ends, so that what is beyond says nothing of
  /// accuracy.
  [[nodiscard]] virtual bool at_border(const Double3&) const { return false; }
  /// Whether the surface ends somewhere (terrain), so that meshes of it have a border.
  [[nodiscard]] virtual bool open() const { return false; }
  /// Where a terrestrial scanner stands in the scene; empty = around it.
  [[nodiscard]] virtual std::vector<Double3> stations() const { return {}; }
  /// Octaves of fractal relief in it, 0 without.
  [[nodiscard]] virtual int octaves() const { return 0; }
  /// Colour at a point of the surface: r | g<<8 | b<<16 | 255<<24.
  [[nodiscard]] virtual std::uint32_t colour(const SurfacePoint& p) const;
};

struct SceneOptions {
  std::string name = "terrain";
  /// Octaves of the fractal terrain; 0 = as many as give a smallest wavelength of at least 32 `spacing`.
  int octaves = 0;
  double spacing = 0.0;  ///< of the samples to come, scene units; only read when octaves is 0
};

/// Names of all scenes, alphabetical, with one line each.
struct SceneName {
  std::string_view name, summary;
};
[[nodiscard]] std::span<const SceneName> scene_names();

/// \throws UsageError for an unknown name, listing those that exist
[[nodiscard]] std::unique_ptr<Scene> make_scene(const SceneOptions& options);

}  // namespace tessera::synth
