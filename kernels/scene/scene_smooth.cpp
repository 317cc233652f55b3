/// Scenes that are smooth everywhere and have a parametrisation: sphere, torus, fractal terrain.
#include "kernels/scene/scene_smooth.h"

#include <algorithm>
#include <array>
#include <vector>

#include "kernels/scene/fractal_noise.h"

namespace tessera::synth {
namespace {

// ---------------------------------------------------------------------------------------------- sphere

constexpr double kSphereRadius = 1.0;

/// One sixth of the sphere: a face of the circumscribed cube, pushed out. tan(pi/4 a) would give nearly equal
/// cells; a cubic with the same slope at both ends does as well, and needs no tangent.
class SpherePatch final : public SurfacePatch {
 public:
  explicit SpherePatch(int face) : axis_(face / 2), sign_(face % 2 ? -1.0 : 1.0) {}
  double length_u() const override { return kSphereRadius * 1.45; }
  double length_v() const override { return kSphereRadius * 1.45; }
  double density(double u, double v) const override {
    const double a = 2.0 * u - 1.0, b = 2.0 * v - 1.0;
    const double s = warp(a), t = warp(b);
    const double q = 1.0 + s * s + t * t;
    return kSphereRadius * kSphereRadius * 4.0 * warp_slope(a) * warp_slope(b) / (q * std::sqrt(q));
  }
  void evaluate(std::span<const double> u, std::span<const double> v, SurfaceBatch& out) const override {
    out.resize(u.size());
    for (std::size_t i = 0; i < u.size(); ++i) {
      const double s = warp(2.0 * u[i] - 1.0), t = warp(2.0 * v[i] - 1.0);
      const double f = 1.0 / std::sqrt(1.0 + s * s + t * t);
      const double n[3] = {sign_ * f, sign_ * s * f, t * f};
      out.nx[i] = n[(3 - axis_) % 3];
      out.ny[i] = n[(4 - axis_) % 3];
      out.nz[i] = n[(5 - axis_) % 3];
      out.x[i] = kSphereRadius * out.nx[i];
      out.y[i] = kSphereRadius * out.ny[i];
      out.z[i] = kSphereRadius * out.nz[i];
    }
  }

 private:
  static double warp(double a) { return a * (0.785398163397448 + 0.214601836602552 * a * a); }
  static double warp_slope(double a) { return 0.785398163397448 + 3.0 * 0.214601836602552 * a * a; }
  int axis_;
  double sign_;
};

class SphereScene final : public Scene {
 public:
  SphereScene() {
    for (int face = 0; face < 6; ++face) pieces_.emplace_back(face);
  }
  std::string_view name() const override { return "sphere"; }
  Box3 bounds() const override {
    return {{-kSphereRadius, -kSphereRadius, -kSphereRadius}, {kSphereRadius, kSphereRadius, kSphereRadius}};
  }
  SurfacePoint closest(const Double3& p) const override {
    const double r = norm(p);
    const Double3 n = r > 0.0 ? p * (1.0 / r) : Double3{0, 0, 1};
    return {n * kSphereRadius, n};
  }
  bool intersect(const Ray& ray, double limit, RayHit& hit) const override {
    const double b = dot(ray.origin, ray.direction);
    const double disc = b * b - dot(ray.origin, ray.origin) + kSphereRadius * kSphereRadius;
    if (disc <= 0.0) return false;
    const double root = std::sqrt(disc);
    const double t = -b - root > 0.0 ? -b - root : -b + root;
    if (!(t > 0.0) || t > limit) return false;
    hit = {t, closest(ray.origin + ray.direction * t)};
    return true;
  }
  std::vector<const SurfacePatch*> patches() const override {
    std::vector<const SurfacePatch*> out;
    for (const auto& piece : pieces_) out.push_back(&piece);
    return out;
  }

 private:
  std::vector<SpherePatch> pieces_;
};

// ---------------------------------------------------------------------------------------------- torus

constexpr double kTorusMajor = 1.0;
constexpr double kTorusMinor = 0.4;

class TorusPatch final : public SurfacePatch {
 public:
  double length_u() const override { return 2.0 * kPi * kTorusMajor; }
  double length_v() const override { return 2.0 * kPi * kTorusMinor; }
  double density(double, double v) const override {
    return 4.0 * kPi * kPi * kTorusMinor * (kTorusMajor + kTorusMinor * sin_cos(2.0 * kPi * v).cos);
  }
  void evaluate(std::span<const double> u, std::span<const double> v, SurfaceBatch& out) const override {
    out.resize(u.size());
    for (std::size_t i = 0; i < u.size(); ++i) {
      const SinCos around = sin_cos(2.0 * kPi * u[i]);
      const SinCos tube = sin_cos(2.0 * kPi * v[i]);
      const double r = kTorusMajor + kTorusMinor * tube.cos;
      out.x[i] = r * around.cos;
      out.y[i] = r * around.sin;
      out.z[i] = kTorusMinor * tube.sin;
      out.nx[i] = tube.cos * around.cos;
      out.ny[i] = tube.cos * around.sin;
      out.nz[i] = tube.sin;
    }
  }
};

class TorusScene final : public Scene {
 public:
  std::string_view name() const override { return "torus"; }
  Box3 bounds() const override {
    constexpr double r = kTorusMajor + kTorusMinor;
    return {{-r, -r, -kTorusMinor}, {r, r, kTorusMinor}};
  }
  SurfacePoint closest(const Double3& p) const override {
    const double rho = std::sqrt(p[0] * p[0] + p[1] * p[1]);
    const Double3 spoke = rho > 0.0 ? Double3{p[0] / rho, p[1] / rho, 0.0} : Double3{1, 0, 0};
    const Double3 core = spoke * kTorusMajor;
    const Double3 off = p - core;
    const double r = norm(off);
    const Double3 n = r > 0.0 ? off * (1.0 / r) : Double3{0, 0, 1};
    return {core + n * kTorusMinor, n};
  }
  bool intersect(const Ray& ray, double limit, RayHit& hit) const override {
    // The signed distance is exact, so a step of its size never crosses the surface.
    double t = 0.0;
    for (int step = 0; step < 512 && t <= limit; ++step) {
      const Double3 p = ray.origin + ray.direction * t;
      const double rho = std::sqrt(p[0] * p[0] + p[1] * p[1]) - kTorusMajor;
      const double d = std::sqrt(rho * rho + p[2] * p[2]) - kTorusMinor;
      if (d < 1e-12) {
        if (!(t > 0.0)) return false;
        hit = {t, closest(p)};
        return true;
      }
      t += d;
    }
    return false;
  }
  std::vector<const SurfacePatch*> patches() const override { return {&piece_}; }

 private:
  TorusPatch piece_;
};

// ---------------------------------------------------------------------------------------------- terrain

/// Square of rolling hills, z up, seen as one patch over (x, y).
class TerrainScene final : public Scene, private SurfacePatch {
 public:
  explicit TerrainScene(const FractalOptions& relief) : relief_(relief) {}
  std::string_view name() const override { return "terrain"; }
  bool open() const override { return true; }
  int octaves() const override { return relief_.octaves; }
  bool at_border(const Double3& p) const override {
    return p[0] <= 0.0 || p[1] <= 0.0 || p[0] >= kTerrainSize || p[1] >= kTerrainSize;
  }
  Box3 bounds() const override {
    const double z = fractal_height_bound(relief_);
    return {{0, 0, -z}, {kTerrainSize, kTerrainSize, z}};
  }
  SurfacePoint closest(const Double3& p) const override {
    // Foot point on the tangent plane, again and again: converges where the query is nearer than the radius
    // of curvature. Keeps the best point seen, so that a query beyond that still gets a point of the surface.
    Double3 best = on_surface(p[0], p[1]), at = best;
    Double3 normal = normal_at(p[0], p[1]), best_normal = normal;
    double best_d = norm(p - best);
    for (int round = 0; round < 40; ++round) {
      const Double3 foot = p - normal * dot(p - at, normal);
      const double x = std::clamp(foot[0], 0.0, kTerrainSize), y = std::clamp(foot[1], 0.0, kTerrainSize);
      if (std::fabs(x - at[0]) + std::fabs(y - at[1]) < 1e-13 * kTerrainSize) break;
      at = on_surface(x, y);
      normal = normal_at(x, y);
      const double d = norm(p - at);
      if (d < best_d) {
        best_d = d;
        best = at;
        best_normal = normal;
      }
    }
    return {best, best_normal};
  }
  bool intersect(const Ray& ray, double limit, RayHit& hit) const override {
    return intersect_heightfield(
        [this](const Double3& p, double& height, Double3& normal) {
          if (p[0] < 0.0 || p[1] < 0.0 || p[0] > kTerrainSize || p[1] > kTerrainSize) return false;
          height = on_surface(p[0], p[1])[2];
          normal = normal_at(p[0], p[1]);
          return true;
        },
        bounds(), ray, limit, fractal_slope_bound(relief_) * 0.4, hit);
  }
  std::vector<const SurfacePatch*> patches() const override { return {this}; }
  std::uint32_t colour(const SurfacePoint& p) const override { return terrain_colour(p, relief_.amplitude); }

 private:
  double length_u() const override { return kTerrainSize; }
  double length_v() const override { return kTerrainSize; }
  double density(double u, double v) const override {
    const Double3 n = normal_at(u * kTerrainSize, v * kTerrainSize);
    return kTerrainSize * kTerrainSize / n[2];
  }
  void evaluate(std::span<const double> u, std::span<const double> v, SurfaceBatch& out) const override {
    const std::size_t n = u.size();
    out.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      out.x[i] = u[i] * kTerrainSize;
      out.y[i] = v[i] * kTerrainSize;
    }
    constexpr std::size_t kBlock = 512;  // stays in the first cache across octaves
    for (std::size_t first = 0; first < n; first += kBlock) {
      const std::size_t m = std::min(kBlock, n - first);
      fractal_heights(relief_, {out.x.data() + first, m}, {out.y.data() + first, m},
                      {out.z.data() + first, m}, {out.nx.data() + first, m}, {out.ny.data() + first, m});
    }
    for (std::size_t i = 0; i < n; ++i) {
      const double f = 1.0 / std::sqrt(1.0 + out.nx[i] * out.nx[i] + out.ny[i] * out.ny[i]);
      out.nx[i] *= -f;
      out.ny[i] *= -f;
      out.nz[i] = f;
    }
  }

  Double3 on_surface(double x, double y) const {
    double z, sx, sy;
    fractal_heights(relief_, {&x, 1}, {&y, 1}, {&z, 1}, {&sx, 1}, {&sy, 1});
    return {x, y, z};
  }
  Double3 normal_at(double x, double y) const {
    double z, sx, sy;
    fractal_heights(relief_, {&x, 1}, {&y, 1}, {&z, 1}, {&sx, 1}, {&sy, 1});
    return unit(Double3{-sx, -sy, 1.0});
  }

  FractalOptions relief_;
};

}  // namespace

std::uint32_t terrain_colour(const SurfacePoint& p, double amplitude) {
  // Grass on the flat, rock on slopes, pale on the heights.
  const double slope = std::clamp((1.0 - p.normal[2]) * 4.0, 0.0, 1.0);
  const double high = std::clamp(p.position[2] / amplitude + 0.4, 0.0, 1.0);
  const auto blend = [&](double grass, double rock, double pale) {
    const double ground = grass + (pale - grass) * high;
    return static_cast<std::uint32_t>(ground + (rock - ground) * slope);
  };
  return blend(86, 128, 196) | blend(122, 112, 190) << 8 | blend(64, 96, 160) << 16 | 0xff000000u;
}

FractalOptions terrain_relief(int octaves, double spacing) {
  FractalOptions relief;
  relief.octaves = octaves;
  if (octaves <= 0) {
    // What the samples cannot resolve is no truth to measure against.
    relief.octaves = 1;
    while (relief.octaves < 12 && relief.wavelength * std::ldexp(1.0, -relief.octaves) >= 32.0 * spacing) {
      ++relief.octaves;
    }
  }
  return relief;
}

std::unique_ptr<Scene> make_sphere() {
  return std::make_unique<SphereScene>();
}
std::unique_ptr<Scene> make_torus() {
  return std::make_unique<TorusScene>();
}
std::unique_ptr<Scene> make_terrain(const FractalOptions& relief) {
  return std::make_unique<TerrainScene>(relief);
}

}  // namespace tessera::synth
